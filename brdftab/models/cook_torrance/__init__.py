"""Single-bounce microfacets in symmetric V-cavities."""

from brdftab.models.common_params import FRESNEL_PARAMS, NDF_PARAMS, NDFS
from brdftab.models.declaration import Model

SPEC = Model(
    name="cook-torrance",
    title="Cook-Torrance, V-cavity masking",
    summary="single-bounce microfacets masked by symmetric V-cavities",
    params=(*NDF_PARAMS, *FRESNEL_PARAMS),
    components=("specular",),
    ndfs=NDFS,
    kinked=True,
    citation="Cook, Torrance: A Reflectance Model for Computer Graphics, ACM TOG 1(1), 1982",
    doi="10.1145/357290.357293",
    variant="f = F D G/(4 i_z o_z), G = min(1, 2 h_z i_z/(i.h), 2 h_z o_z/(o.h)); no diffuse term.",
    errata="The 1982 print divides by pi i_z o_z with its own normalisation of D; the normalised form with 4 is used.",
)
