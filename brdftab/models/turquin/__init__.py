"""Smith single bounce, scaled up by the energy that it misses (Turquin)."""

from brdftab.models.common_params import FRESNEL_PARAMS, NDF_NO_PHONG, SMITH_MASKING
from brdftab.models.declaration import Model

SPEC = Model(
    name="turquin",
    title="Smith with Turquin's compensation",
    summary="single bounce scaled by 1 + F0 (1 - E)/E of the view; cheapest stand-in for smith-multi, not reciprocal",
    params=(*(p for p in NDF_NO_PHONG if p.name in ("ndf", "alpha")), SMITH_MASKING, *FRESNEL_PARAMS),
    components=("specular", "compensation"),
    reciprocal=False,
    ndfs=("beckmann", "ggx"),
    citation="Turquin: Practical Multiple Scattering Compensation for Microfacet Models, technical report, 2019",
    doi="",
    variant=(
        "f = f_1 (1 + F0 (1 - E(o))/E(o)) with E the albedo of f_1 for F = 1 at the view by our own quadrature, F0 a "
        "wavelength each. Swapping light and view changes the value."
    ),
    # the solver's settings have no meaning here
    approximates={"smith-multi": ("estimator", "samples", "seed", "roulette")},
)
