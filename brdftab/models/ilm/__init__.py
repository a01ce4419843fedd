"""Interfaced Lambertian microfacets: every facet is a matte body below a smooth dielectric interface."""

from brdftab.models.common_params import ALBEDOS, INDICES, TILTS
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="ilm",
    title="Interfaced Lambertian microfacets",
    summary="rough matte body below a dielectric interface: glossy and matte reflection of one set of facets",
    params=(
        Param(
            "kd",
            "",
            0.5,
            (0.0, 1.0),
            "albedo of the body below the interface; one value or three",
            "channels",
            role="albedo",
            extremes=ALBEDOS,
            neutral=0.0,
        ),
        Param(
            "ior",
            "",
            1.5,
            (1.0, 100.0),
            "refractive index n_i of the interface; one value or three",
            "channels",
            role="optics",
            extremes=INDICES,
            neutral=1.0,
            canonical=("a",),
            shared=True,
            start=(1.05, 2.5),
        ),
        Param(
            "f0",
            "",
            None,
            (0.0, 0.96),
            "reflectance at normal incidence instead of ior, which follows from it; one value or three",
            "channels",
            role="optics",
            extremes=(0.0, 1e-12, 0.04, 0.9, 1.0),
            neutral=0.0,
            canonical=("a",),
            start=(0.02, 0.9),
        ),
        Param(
            "ndf",
            "",
            "beckmann",
            None,
            "normal distribution function",
            "choice",
            ("beckmann", "ggx", "gaussian"),
            role="roughness",
        ),
        Param(
            "sigma",
            "",
            0.3,
            (0.0, 10.0),
            "roughness (slope scale; gaussian: tilt in radians); flat below 1e-9",
            role="roughness",
            extremes=TILTS,
        ),
        Param(
            "sigma_x",
            "",
            None,
            (0.0, 10.0),
            "roughness along azimuth 0 (Beckmann and GGX), with sigma_y",
            role="roughness",
            extremes=TILTS,
        ),
        Param(
            "sigma_y",
            "",
            None,
            (0.0, 10.0),
            "roughness along azimuth 90 degrees, with sigma_x",
            role="roughness",
            extremes=TILTS,
        ),
        Param(
            "masking",
            "",
            "torrance-sparrow",
            None,
            "masking-shadowing of the facets: V-cavities, or separable Smith",
            "choice",
            ("torrance-sparrow", "smith"),
        ),
        Param(
            "bounces",
            "",
            "1",
            None,
            "reflections between the facets of a V-cavity: single, up to two, all",
            "choice",
            ("1", "2", "inf"),
            role="bounces",
        ),
    ),
    components=("specular", "body", "interreflection"),
    ndfs=("beckmann", "ggx", "gaussian"),
    roughness="sigma",
    singular=True,
    kinked=True,
    unkinked={"masking": "smith"},
    citation=(
        "Meneveaux, Bringier, Tauzia, Ribardiere, Simonot: Rendering Rough Opaque Materials with Interfaced Lambertian "
        "Microfacets, IEEE TVCG 24(3), 2018"
    ),
    doi="10.1109/TVCG.2017.2660490",
    variant=(
        "f = F D G/(4 i_z o_z) + kappa I(sigma, n_i) (Eqs. 4, 9 and 13); sigma is sqrt(2) times the standard deviation "
        "of the slope. Gaussian is normalised. Smith masking is separable and exact for each distribution."
    ),
    errata=(
        "Eq. 16 calls sigma the standard deviation of slopes; Eq. 20 needs erfc, Eq. 21 cos^2/sigma_x^2 + "
        "sin^2/sigma_y^2, Eq. 29 atan2, Eq. 31 xi_2; Eq. 26 counts D G twice. Eqs. 8 and 11 are evaluated in forms "
        "that keep their digits at grazing angles and for n_i near 1."
    ),
)
