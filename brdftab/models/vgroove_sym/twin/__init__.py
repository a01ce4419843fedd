"""JAX twin of the symmetric groove: first order as Cook-Torrance, further orders from `twin_bounces`."""

from __future__ import annotations

from functools import partial

import jax.numpy as jnp
from jax import Array

from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.twin.frame import Directions, groove_plane, half_vector, lifted
from brdftab.models._shared.twin.grooves import groove_value, higher
from brdftab.models._shared.twin.masking import v_cavity
from brdftab.models._shared.twin.ndf import density, shape_at
from brdftab.models._shared.twin.static import Static
from brdftab.models.vgroove_sym.twin.bounces import bounces, rankings

SHAPE_PARAMS = ("alpha_x", "alpha_y")
# rules grow with the class of roughness
ROUGH_RULES = True


def shapes(static: Static, p: dict[str, Array], d: Directions) -> tuple[Array, ...]:
    """Return what the channels share.

    Parameters
    ----------
    static : Static
        Choices of the setup.
    p : dict of Array ()
        alpha_x and, unless isotropic, alpha_y.
    d : Directions
        Of arrays (N,).

    Returns
    -------
    tuple of Array (N,)
        First order without reflectance; if there are further orders also shape number and factor of D at the groove's
        azimuth and four rankings (see `rankings`). A mirror's is the BRDF itself.
    """
    above, d = lifted(d)
    sin_h, cos_h, i_h, cos_a, sin_a = half_vector(d)
    shape, amp = shape_at(static.ndf, static.isotropic, p["alpha_x"], p["alpha_y"], cos_a, sin_a)
    shape, amp = jnp.broadcast_to(shape, sin_h.shape), jnp.broadcast_to(amp, sin_h.shape)
    first = amp * density(static.ndf, shape, cos_h, sin_h) * v_cavity(cos_h, d.ci, d.co, i_h) / (4.0 * d.ci * d.co)
    first = jnp.where(above, first, 0.0)
    if static.max_bounces == 1:
        return (first,)
    ranks = rankings(static, shape, groove_plane(d))
    if static.fresnel == MIRROR:
        return (first + higher(bounces, static, p, (shape, amp, *ranks), above, d),)
    return (first, shape, amp, *ranks)


value = partial(groove_value, bounces)
