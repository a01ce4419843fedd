"""Single-bounce microfacets with Smith masking."""

from brdftab.models.common_params import FRESNEL_PARAMS, NDF_PARAMS, NDFS
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="smith",
    title="Smith microfacets, single bounce",
    summary="single-bounce microfacets with Smith masking, separable or height-correlated",
    params=(
        *NDF_PARAMS,
        Param(
            "masking",
            "",
            "height-correlated",
            None,
            "masking-shadowing; smith-walter is separable with Walter's rational fit of Beckmann's G1",
            "choice",
            ("height-correlated", "separable", "smith-walter"),
        ),
        *FRESNEL_PARAMS,
    ),
    components=("specular",),
    ndfs=NDFS,
    citation="Heitz: Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs, JCGT 3(2), 2014",
    doi="10.1145/1276377.1276417",
    variant=(
        "Height-correlated masking by default; separable is what most renderers use. Phong takes Beckmann's Lambda "
        "with the same alpha (Walter et al. 2007, whose DOI is given)."
    ),
)
