"""Random walks on Smith microfacets, with heights."""

from brdftab.models.common_params import BOUNDARY_PARAMS, MAX_BOUNCES, NDF_NO_PHONG, SAMPLING_PARAMS
from brdftab.models.declaration import Model

SPEC = Model(
    name="smith-walk",
    title="Smith microfacets, random walk",
    summary="height-correlated random walk on Smith microfacets, every bounce; conductors and dielectrics",
    params=(*NDF_NO_PHONG, *BOUNDARY_PARAMS, *SAMPLING_PARAMS, MAX_BOUNCES),
    components=("order",),
    multibounce=True,
    transmits=True,
    ndfs=("beckmann", "ggx"),
    citation=(
        "Heitz, Hanika, d'Eon, Dachsbacher: Multiple-Scattering Microfacet BSDFs with the Smith Model, "
        "ACM Transactions on Graphics 35(4), 2016"
    ),
    doi="10.1145/2897824.2925943",
    variant=(
        "Walks carry a height, so that masking and shadowing are correlated and its orders differ from those of "
        "smith-multi by design; both conserve energy. Next event estimation at every vertex."
    ),
    methods={"roulette": ("on",)},
    # the same surface, with heights: another masking, so that more samples do not close the gap
    approximates={"smith-multi": ("estimator", "samples", "seed", "roulette")},
)
