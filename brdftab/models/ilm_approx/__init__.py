"""Interfaced Lambertian microfacets with a closed form in place of the body integral."""

from brdftab.models.common_params import ALBEDOS, INDICES, TILTS
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="ilm-approx",
    title="Interfaced Lambertian microfacets, closed form",
    summary="ilm with V-cavities and Beckmann facets, its body integral replaced by a fitted closed form; has a shader",
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
            (1.0, 2.5),
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
            (0.0, 0.18),
            "reflectance at normal incidence instead of ior, which follows from it; one value or three",
            "channels",
            role="optics",
            extremes=(0.0, 1e-12, 0.04, 0.9, 1.0),
            neutral=0.0,
            canonical=("a",),
            start=(0.02, 0.9),
        ),
        Param("ndf", "", "beckmann", None, "normal distribution function", "choice", ("beckmann",), role="roughness"),
        Param(
            "sigma",
            "",
            0.3,
            (0.0, 1.5),
            "roughness (slope scale), as far as the form was fitted; flat below 1e-9",
            role="roughness",
            extremes=TILTS,
        ),
    ),
    components=("specular", "body"),
    ndfs=("beckmann",),
    kinked=True,
    roughness="sigma",
    citation=(
        "Meneveaux, Bringier, Tauzia, Ribardiere, Simonot: Rendering Rough Opaque Materials with Interfaced Lambertian "
        "Microfacets, IEEE TVCG 24(3), 2018"
    ),
    doi="10.1109/TVCG.2017.2660490",
    variant=(
        "Exact specular part; body kappa L_a(sigma) T(c_i) T(c_o) with a form and coefficients of our own in place of "
        "Eqs. 32-33, whose coefficients are not public: RMS relative error of "
        "the body up to 75 degrees 0.2 % (sigma 0.1), 0.8 % (0.3), 2.5 % (1), 4.6 % (1.5), largest 52 %. "
        "Mirror directions at 85 degrees are off by a factor of up to 3.4. A "
        "tolerance does not lessen this error, and no estimate counts it."
    ),
    approximates={"ilm": ("masking", "bounces")},
)
