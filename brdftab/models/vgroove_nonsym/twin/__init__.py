"""JAX twin of the nonsymmetric groove: first order in closed form, further orders from `twin_bounces`."""

from __future__ import annotations

import math
from functools import partial

import jax.numpy as jnp
from jax import Array

from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.twin.frame import Directions, groove_plane, half_vector, lifted
from brdftab.models._shared.twin.grooves import groove_value, higher
from brdftab.models._shared.twin.ndf import density, shape_at
from brdftab.models._shared.twin.static import Static
from brdftab.models.vgroove_nonsym.rules import MOST_PHONG
from brdftab.models.vgroove_nonsym.twin.bounces import bounces, rankings
from brdftab.models.vgroove_nonsym.twin.first import mean_masking

SHAPE_PARAMS = ("alpha_x", "alpha_y")
# rules grow with the class of roughness
ROUGH_RULES = True


def roughness_bounds(ndf: str) -> tuple[float, float]:
    """Return between which roughnesses a fit may move: Phong ends a hair below sqrt 2, where facets lose their mean."""
    return 0.0, 0.999 * MOST_PHONG if ndf == "phong" else math.inf


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
    cos_a, sin_a = half_vector(d)[3:]
    plane = groove_plane(d)
    sin_h, cos_h, i_h, big_l, st, ct, su, cu = plane
    shape, amp = shape_at(static.ndf, static.isotropic, p["alpha_x"], p["alpha_y"], cos_a, sin_a)
    shape, amp = jnp.broadcast_to(shape, sin_h.shape), jnp.broadcast_to(amp, sin_h.shape)
    ahead = jnp.arctan2(st, ct) >= jnp.arctan2(su, cu)
    sin_m, cos_m = jnp.where(ahead, st, su), jnp.where(ahead, ct, cu)
    g = mean_masking(static.ndf, shape, sin_h, i_h / big_l, sin_m, cos_m)
    first = jnp.where(above, amp * density(static.ndf, shape, cos_h, sin_h) * g / (4.0 * d.ci * d.co), 0.0)
    if static.max_bounces == 1:
        return (first,)
    ranks = rankings(plane)
    if static.fresnel == MIRROR:
        return (first + higher(bounces, static, p, (shape, amp, *ranks), above, d),)
    return (first, shape, amp, *ranks)


value = partial(groove_value, bounces)
