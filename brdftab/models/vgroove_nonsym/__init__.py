"""Nonsymmetric V-grooves (independent facets) with all orders of specular interreflection."""

from brdftab.models.common_params import FRESNEL_PARAMS, MAX_BOUNCES, NDF_PARAMS, NDFS
from brdftab.models.declaration import Model

SPEC = Model(
    name="vgroove-nonsym",
    title="Nonsymmetric V-grooves, multiple scattering",
    summary="mirror facets in V-grooves with independent sides, every bounce order by panel quadrature",
    params=(*NDF_PARAMS, *FRESNEL_PARAMS, MAX_BOUNCES),
    components=("order",),
    singular=True,
    multibounce=True,
    ndfs=NDFS,
    citation="Lee, Jarabo, Jeon, Gutierrez, Kim: Practical Multiple Scattering for Rough Surfaces, ACM TOG 37(6), 2018",
    doi="10.1145/3272127.3275016",
    variant=(
        "First order in closed form; higher orders by Gauss panels split at the kinks of the beam width and at the "
        "scale of the distribution; isotropic tables at loose tolerance from an interpolated in-plane part."
    ),
    errata=(
        "The constants of P(theta_r) in App. C are wrong; they are replaced by those that make P integrate to 1 on "
        "[0, pi/2]. Eq. 23 runs over [0, pi/2], not [-pi/2, pi/2]. Eqs. 7-9 need every f clamped at 0. Phong is not "
        "normalisable for alpha >= sqrt(2) and is refused there."
    ),
)
