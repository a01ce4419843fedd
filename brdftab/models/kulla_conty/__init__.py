"""Smith single bounce plus Kulla and Conty's lobe for the energy that it misses."""

from brdftab.models.common_params import FRESNEL_PARAMS, NDF_NO_PHONG, SMITH_MASKING
from brdftab.models.declaration import Model

SPEC = Model(
    name="kulla-conty",
    title="Smith with Kulla-Conty compensation",
    summary="single bounce plus a lobe without azimuth that carries the missing energy; cheap stand-in for smith-multi",
    params=(*(p for p in NDF_NO_PHONG if p.name in ("ndf", "alpha")), SMITH_MASKING, *FRESNEL_PARAMS),
    components=("specular", "compensation"),
    ndfs=("beckmann", "ggx"),
    citation=(
        "Kulla, Conty: Revisiting Physically Based Shading at Imageworks. SIGGRAPH Course Physically Based Shading 2017"
    ),
    doi="10.1145/3084873.3084893",
    variant=(
        "f = f_1 + F_ms (1 - E(i)) (1 - E(o))/(pi (1 - E_avg)), with E the albedo of f_1 for F = 1 by our own "
        "quadrature (no table), F_ms = F_avg^2 E_avg/(1 - F_avg (1 - E_avg)), a wavelength each."
    ),
    errata=(
        "The course's F_ms has F_avg to the first power; light of two bounces and more has met two facets at least, "
        "hence the square."
    ),
    # the solver's settings have no meaning here
    approximates={"smith-multi": ("estimator", "samples", "seed", "roulette")},
)
