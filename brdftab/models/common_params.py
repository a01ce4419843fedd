"""Parameters that every microfacet model shares: the normal distribution and the Fresnel reflectance."""

from __future__ import annotations

from brdftab.models.declaration import Param

# what has broken such formulas before, by what a number is: nothing, almost nothing, and far too much
ROUGHNESSES = (1e-4, 1e-3, 0.01, 0.1, 0.5, 1.0, 2.0, 10.0)
TILTS = (0.0, 1e-8, 1e-4, 0.01, 0.1, 0.5, 1.0, 2.0)
INDICES = (1.0, 1.0 + 1e-12, 1.0 + 1e-6, 1.01, 1.5, 2.5, 1e3)
ALBEDOS = (0.0, 1e-12, 0.5, 1.0)
EXPONENTS = (0.0, 1.0, 1e3, 1e6)

NDFS = ("beckmann", "ggx", "phong")

NDF_PARAMS = (
    Param("ndf", "", "beckmann", None, "normal distribution function", "choice", NDFS, role="roughness"),
    Param(
        "alpha",
        "",
        0.5,
        (1e-4, 10.0),
        "roughness; Phong's exponent is 2/alpha^2 - 2",
        role="roughness",
        extremes=ROUGHNESSES,
    ),
    Param(
        "alpha_x",
        "",
        None,
        (1e-4, 10.0),
        "roughness along azimuth 0 (Beckmann and GGX), with alpha_y",
        role="roughness",
        extremes=ROUGHNESSES,
    ),
    Param(
        "alpha_y",
        "",
        None,
        (1e-4, 10.0),
        "roughness along azimuth 90 degrees, with alpha_x",
        role="roughness",
        extremes=ROUGHNESSES,
    ),
    Param("exponent", "", None, (-1.98, 2e8), "Phong exponent, instead of alpha", role="roughness", extremes=EXPONENTS),
)

FRESNEL_PARAMS = (
    Param(
        "material",
        "",
        "Au",
        None,
        "mirror (F = 1) or a metal by name; several wavelengths projected to linear sRGB",
        "choice",
        role="optics",
    ),
    Param(
        "eta",
        "",
        None,
        (1e-6, 1e4),
        "own refractive index, with k: one value, three (R, G, B) or one a wavelength",
        "channels",
        role="optics",
        extremes=(1e-6, 0.2, 1.0, 1e3),
        scale="log",
        canonical=("a",),
        start=(0.3, 4.0),
    ),
    Param(
        "k",
        "",
        None,
        (0.0, 1e4),
        "own extinction coefficient, with eta",
        "channels",
        role="optics",
        extremes=(0.0, 1e-8, 3.0, 1e3),
        canonical=("b",),
        start=(0.3, 6.0),
    ),
    Param(
        "ior",
        "",
        None,
        (1.0, 1e4),
        "dielectric refractive index; one value or three",
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
        (0.0, 1.0),
        "Schlick's reflectance at normal incidence; one value or three",
        "channels",
        role="optics",
        extremes=(0.0, 1e-12, 0.04, 0.9, 1.0),
        neutral=0.0,
        canonical=("a",),
        start=(0.02, 0.9),
    ),
    Param(
        "wavelengths",
        "nm",
        None,
        (200.0, 2500.0),
        "write these wavelengths as channels instead of RGB",
        "channels",
        role="optics",
    ),
    Param(
        "spectral_samples",
        "",
        None,
        (3, 81),
        "wavelengths behind RGB (default: chosen for the metal)",
        "int",
        role="optics",
    ),
)

MAX_BOUNCES = Param(
    "max_bounces",
    "",
    None,
    (1, 1_000_000),
    "leave out higher bounce orders; the energy lost is reported",
    "int",
    role="bounces",
    extremes=(1, 2, 5, 100_000),
)

NDF_NO_PHONG = (
    Param(
        "ndf",
        "",
        "ggx",
        None,
        "normal distribution function",
        "choice",
        ("beckmann", "ggx"),
        "phong is left out: it has no Smith Lambda of its own, which every further bounce needs",
        "roughness",
    ),
    *(p for p in NDF_PARAMS if p.name.startswith("alpha")),
)

BOUNDARY_PARAMS = tuple(
    Param(
        "ior",
        "",
        None,
        (1.01, 10.0),
        "refractive index below the surface, air above: reflects and transmits; one value or three",
        "channels",
        (),
        "below 1 swap the sides: give 1/ior and put the light below the surface, theta_i above 90 degrees",
        "optics",
        extremes=INDICES,
        neutral=1.0,
        canonical=("a",),
        shared=True,
        start=(1.05, 2.5),
    )
    if p.name == "ior"
    else p
    for p in FRESNEL_PARAMS
)

SAMPLING_PARAMS = (
    Param(
        "samples", "", None, (1, 2**31), "paths a cell of estimators (default: as tolerance asks)", "int", role="paths"
    ),
    Param(
        "seed", "", 0, (0, 2**53), "seed of estimators; any thread count gives the same numbers", "int", role="paths"
    ),
    Param(
        "roulette",
        "",
        "off",
        None,
        "end dim paths of the estimators at random",
        "choice",
        ("off", "on"),
        role="paths",
    ),
)

SMITH_MASKING = Param(
    "masking",
    "",
    "separable",
    None,
    "masking-shadowing of the single bounce",
    "choice",
    ("separable", "height-correlated"),
)
