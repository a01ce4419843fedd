"""What both V-groove twins share: from the bounce sum of a groove to the BRDF of one channel."""

from __future__ import annotations

from collections.abc import Callable

import jax.numpy as jnp
from jax import Array

from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.twin.frame import Directions, groove_plane, half_vector, lifted
from brdftab.models._shared.twin.fresnel import reflectance
from brdftab.models._shared.twin.static import Static

# below this sine of theta_h two or more bounces are not evaluated
MIRROR_SINE = 1e-14


def groove_value(
    bounces: Callable[..., Array], static: Static, p: dict[str, Array], shapes: tuple[Array, ...], d: Directions
) -> Array:
    """Return the BRDF (1/sr) of one channel or wavelength, (N,).

    `bounces` is the model's sum over further bounces, p holds the reflectance: a and b, scalars, as its kind needs
    them. At the mirror direction itself only the first order counts, as in the kernel.
    """
    if static.fresnel == MIRROR:
        return shapes[0]
    above, d = lifted(d)
    i_h = half_vector(d)[2]
    first = shapes[0] * reflectance(static.fresnel, p.get("a"), p.get("b"), i_h)
    if static.max_bounces == 1:
        return first
    return first + higher(bounces, static, p, shapes[1:], above, d)


def higher(
    bounces: Callable[..., Array],
    static: Static,
    p: dict[str, Array],
    shared: tuple[Array, ...],
    above: Array,
    d: Directions,
) -> Array:
    """Return orders two and above, (N,), 0 below the horizon and at the mirror direction."""
    shape, amp, *ranks = shared
    plane = groove_plane(d)
    sin_h, _, i_h, big_l = plane[:4]
    live = above & (sin_h >= MIRROR_SINE)
    total = bounces(static, p.get("a"), p.get("b"), shape, plane, ranks)
    front = amp * big_l / (4.0 * i_h * d.ci * d.co * jnp.where(live, sin_h, 1.0))
    return jnp.where(live, front * total, 0.0)
