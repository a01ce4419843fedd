"""Symmetric V-grooves with all orders of specular interreflection."""

from brdftab.models.common_params import FRESNEL_PARAMS, MAX_BOUNCES, NDF_PARAMS, NDFS
from brdftab.models.declaration import Model

SPEC = Model(
    name="vgroove-sym",
    title="Symmetric V-grooves, multiple scattering",
    summary="mirror facets in symmetric V-grooves, every bounce order in closed form",
    params=(*NDF_PARAMS, *FRESNEL_PARAMS, MAX_BOUNCES),
    components=("order",),
    singular=True,
    multibounce=True,
    ndfs=NDFS,
    citation="Lee, Jarabo, Jeon, Gutierrez, Kim: Practical Multiple Scattering for Rough Surfaces, ACM TOG 37(6), 2018",
    doi="10.1145/3272127.3275016",
    variant=(
        "Two-ended closed form of the beam width per bounce order, summed over both sides of the groove; exact "
        "termination of the bounce sum, its far tail as an integral in 1/k."
    ),
    errata=(
        "Eq. 6 lacks the clamp f_k >= f_b (L1 error up to 3.99 without it). Eqs. 13-17: both facet orientations count "
        "for k >= 2 and |i.s| means the orientation of the same term."
    ),
)
