"""Ashikhmin and Shirley's anisotropic Phong highlight over a matte base."""

from brdftab.models.common_params import ALBEDOS, EXPONENTS, FRESNEL_PARAMS
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="ashikhmin-shirley",
    title="Ashikhmin-Shirley anisotropic Phong",
    summary="a highlight of the half vector's tilt, narrow along one axis and wide along the other, over a matte base",
    params=(
        Param(
            "nu", "", 200.0, (0.0, 1e6), "Phong exponent along azimuth 0; the larger, the narrower", extremes=EXPONENTS
        ),
        Param("nv", "", 20.0, (0.0, 1e6), "Phong exponent along azimuth 90 degrees", extremes=EXPONENTS),
        Param(
            "kd",
            "",
            0.0,
            (0.0, 1.0),
            "albedo of the base, lit by what F leaves; one value or three",
            "channels",
            role="albedo",
            extremes=ALBEDOS,
            neutral=0.0,
        ),
        *FRESNEL_PARAMS,
    ),
    components=("specular", "diffuse"),
    grain=True,
    citation="Ashikhmin, Shirley: An Anisotropic Phong BRDF Model, Journal of Graphics Tools 5(2), 2000",
    doi="10.1080/10867651.2000.10487522",
    variant=(
        "f = F(i.h) p(h)/(4 (i.h) max(i_z, o_z)) + 28 kd (1 - F(1))/(23 pi) (1 - (1 - i_z/2)^5)(1 - (1 - o_z/2)^5), "
        "p(h) = sqrt((nu + 1)(nv + 1))/(2 pi) h_z^(nu cos^2 + nv sin^2) (Eqs. 4 and 5); any Fresnel term takes the "
        "place of Schlick's, a wavelength each."
    ),
    errata=(
        "There is no masking: max(i_z, o_z) alone keeps the highlight's albedo below F, and light that would leave "
        "below the horizon is lost. The base takes 1 - F at normal incidence, not at the actual angle."
    ),
)
