"""Interfaced Lambertian microfacets with the body in closed form: fast, approximate, for shaders and previews."""

from brdftab.models import Model, Param

SPEC = Model(
    name="ilm-approx",
    title="Interfaced Lambertian microfacets, approximate body",
    summary="ilm with its body integral in closed form, for shaders: RMS error 0.3 % to 4 % below 75 degrees",
    params=(
        Param("kd", "", 0.5, (0.0, 1.0), "albedo of the body below the interface; one value or three", "channels"),
        Param("ior", "", 1.5, (1.0, 3.0), "refractive index n_i of the interface; one value or three", "channels"),
        Param(
            "f0",
            "",
            None,
            (0.0, 0.25),
            "reflectance at normal incidence instead of ior, which follows from it; one value or three",
            "channels",
        ),
        Param("ndf", "", "beckmann", None, "normal distribution function; ilm has the others", "choice", ("beckmann",)),
        Param("sigma", "", 0.3, (0.0, 2.0), "roughness (slope scale) in the range of the fit; 0 is flat"),
        Param(
            "masking",
            "",
            "torrance-sparrow",
            None,
            "masking-shadowing of the facets, V-cavities; ilm has Smith's",
            "choice",
            ("torrance-sparrow",),
        ),
    ),
    components=("specular", "body"),
    ndfs=("beckmann",),
    roughness="sigma",
    citation=(
        "Meneveaux, Bringier, Tauzia, Ribardiere, Simonot: Rendering Rough Opaque Materials with Interfaced Lambertian "
        "Microfacets, IEEE TVCG 24(3), 2018"
    ),
    doi="10.1109/TVCG.2017.2660490",
    variant=(
        "f = F D G/(4 i_z o_z) + kappa L(i, o) T(c_i) T(c_o)/pi: Lambertian facets L and the cosines c_i, c_o at which "
        "facets are met are polynomials of our own, fitted to the body integral of ilm; single bounces."
    ),
    errata=(
        "The paper's coefficients of Eqs. 32 and 33 are in its supplement only. Replaced: T at an effective cosine "
        "instead of a T + b (1 - r_e), and a fitted L instead of Oren and Nayar's."
    ),
)
