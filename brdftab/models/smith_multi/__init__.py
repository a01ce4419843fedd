"""Smith microfacets with all bounces: noise-free solver, path tracing estimators, dielectrics with transmission."""

from brdftab.models.common_params import BOUNDARY_PARAMS, MAX_BOUNCES, NDF_NO_PHONG, SAMPLING_PARAMS
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="smith-multi",
    title="Smith microfacets, all bounces",
    summary="Smith microfacets with every bounce between them: noise-free solver, pt, bdpt; conductors and dielectrics",
    params=(
        *NDF_NO_PHONG,
        *BOUNDARY_PARAMS,
        Param(
            "estimator",
            "",
            "auto",
            None,
            "solver: no noise, isotropic; pt, bdpt: path tracing; hybrid: orders 1, 2 by quadrature, rest by bdpt; "
            "auto: solver, or for anisotropic surfaces hybrid (conductor) and pt (dielectric); hybrid also where GGX "
            "facets reflect all light from an angle on (eta < 1, k near 0)",
            "choice",
            ("auto", "solver", "pt", "bdpt", "hybrid"),
            role="paths",
        ),
        *SAMPLING_PARAMS,
        MAX_BOUNCES,
    ),
    components=("order",),
    multibounce=True,
    transmits=True,
    ndfs=("beckmann", "ggx"),
    citation=(
        "Wang, Jin, Fan, Yang, Holzschuch, Yan: Position-free Multiple-bounce Computations for Smith Microfacet BSDFs, "
        "ACM Transactions on Graphics 41(4), 2022"
    ),
    doi="10.1145/3528223.3530112",
    variant=(
        "Height-uncorrelated masking as in the paper; all orders add up to 1 in the furnace. A dielectric (ior) "
        "reflects and transmits: f is the BSDF of light at i seen from o, f(i, o)/n_o^2 = f(o, i)/n_i^2."
    ),
    errata=(
        "Eq. 2 with Eq. 3 as printed diverges in the furnace: the vertex term is F D/(4 |cos| |cos|) and the segment "
        "term 1/(1 + Lambda(|cos|)) for directions up and down alike."
    ),
)
