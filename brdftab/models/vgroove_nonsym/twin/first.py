"""First order of the nonsymmetric groove in JAX: the mean masking by an independent opposite facet, in closed form."""

from __future__ import annotations

import math

import jax.numpy as jnp
from jax import Array, lax
from jax.scipy.special import erfc

from brdftab.models._shared.twin.ndf import BECKMANN, GGX, opposite_norm
from brdftab.quadrature import gauss

PI = math.pi
ROOT_PI = math.sqrt(PI)
# beyond this, E is below the last digit; larger cotangents would overflow in derivatives
FARTHEST_COTANGENT = 1e60
NODES, WEIGHTS = (0.5 * (x + y) for x, y in zip(gauss(20), (1.0, 0.0), strict=True))


def masked_share(ndf: int, shape: Array, sin_m: Array, cos_m: Array) -> Array:
    """Return E = int P(r) max(0, sin M - cos M cot r) dr, the hidden share of a unit facet at the in-plane angle M.

    Parameters
    ----------
    ndf : int
        Static code.
    shape : Array (N,)
        Shape number at the groove's azimuth.
    sin_m, cos_m : Array (N,)
        Of the in-plane angle; E = 0 where the sine is not positive.
    """
    faces = sin_m > 0.0
    sin_m = jnp.where(faces, sin_m, 0.5)
    cos_m = jnp.where(faces, cos_m, 0.5)
    t = jnp.minimum(cos_m / sin_m, FARTHEST_COTANGENT)
    x = t / shape
    if ndf == BECKMANN:
        live = faces & (x <= 27.0)
        x = jnp.where(live, x, 0.0)
        g = jnp.exp(-x * x)
        share = sin_m * (erfc(x) + 2.0 * x * g / ROOT_PI) - cos_m * 2.0 * g / (ROOT_PI * shape)
        return jnp.where(live, share, 0.0)
    if ndf == GGX:
        # the angle left of pi/2 keeps its digits for large x
        rest = jnp.arctan2(shape, t)
        sc = x / (1.0 + x * x)
        share = sin_m * (2.0 / PI) * (rest + sc) - cos_m * 2.0 * shape / (PI * (shape * shape + t * t))
        return jnp.where(faces, share, 0.0)
    return jnp.where(faces, _phong(shape, sin_m, cos_m), 0.0)


def _phong(shape: Array, sin_m: Array, cos_m: Array) -> Array:
    """Return E of Phong by Gauss panels in v, sin x = sin M exp(-v^2/(n+1)), whose first is as short as the layer."""
    n1 = shape + 1.0
    front = opposite_norm(2, shape) * (shape + 2.0) / (2.0 * PI) * jnp.exp(n1 * jnp.log(sin_m)) / n1
    gap = cos_m * cos_m / (1.0 + sin_m)
    nodes, weights = jnp.asarray(NODES)[:, None], jnp.asarray(WEIGHTS)[:, None]
    # panels need not follow the exponent for the derivative to be right
    width = jnp.minimum(0.5, jnp.sqrt(lax.stop_gradient(n1)))

    def panel(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        left, width, total = state
        v = left + width * nodes
        u = v * v
        below = gap - sin_m * jnp.expm1(-u / n1)
        sx = 1.0 - below
        cx = jnp.sqrt(below * (1.0 + sx))
        part = jnp.sum(weights * 2.0 * v * jnp.exp(-u) * (sin_m * cx - cos_m * sx), axis=0)
        total = total + jnp.where(left < 6.8, width * part, 0.0)
        return left + width, jnp.minimum(2.0 * width, 1.0), total

    start = (jnp.zeros_like(width), width, jnp.zeros_like(front))
    return front * lax.while_loop(lambda state: jnp.any(state[0] < 6.8), panel, start)[2]


def mean_masking(ndf: int, shape: Array, sin_h: Array, cos_d: Array, sin_m: Array, cos_m: Array) -> Array:
    """Return Gbar of the first order, (N,); M is the larger in-plane angle, cos_d = cos((theta_i - theta_o)/2)."""
    hidden = sin_h / cos_d * masked_share(ndf, shape, sin_m, cos_m)
    return jnp.maximum(1.0 - hidden, 0.0)
