"""Normal distribution functions in JAX; codes and shape numbers as in the Numba module."""

from __future__ import annotations

import math

import jax.numpy as jnp
from jax.scipy.special import gammaln

BECKMANN, GGX, PHONG = 0, 1, 2
# Beckmann's exponent beyond which the density is 0, as in the kernel
FARTHEST = 700.0


def shape_at(ndf, isotropic, alpha_x, alpha_y, cos_phi, sin_phi):
    """Return the shape number at an azimuth and the factor alpha_phi^2/(alpha_x alpha_y) of D there.

    Parameters
    ----------
    ndf : int
        Static code.
    isotropic : bool
        Static; alpha_x serves both axes.
    alpha_x, alpha_y : Array
        Roughness, > 0.
    cos_phi, sin_phi : Array (N,)
        Azimuth of the half vector.
    """
    if ndf == PHONG:
        return 2.0 / (alpha_x * alpha_x) - 2.0, 1.0
    if isotropic:
        return alpha_x, 1.0
    c, s = cos_phi / alpha_x, sin_phi / alpha_y
    a2 = 1.0 / (c * c + s * s)
    return jnp.sqrt(a2), a2 / (alpha_x * alpha_y)


def density(ndf, shape, c, s):
    """D (1/sr) of a facet with tilt cosine c and sine s, up to the factor of `shape_at`; 0 where c <= 0."""
    front = c > 0.0
    c = jnp.where(front, c, 1.0)
    if ndf == BECKMANN:
        t = s / (c * shape)
        live = front & (t * t <= FARTHEST)
        t = jnp.where(live, t, 0.0)
        c2 = c * c
        return jnp.where(live, jnp.exp(-t * t) / (math.pi * shape * shape * c2 * c2), 0.0)
    if ndf == GGX:
        a2 = shape * shape
        d = a2 * c * c + s * s
        return jnp.where(front, a2 / (math.pi * d * d), 0.0)
    # the cosine of a small tilt has lost the tilt's digits
    log_c = jnp.where(s < 0.5, 0.5 * jnp.log1p(-jnp.where(s < 0.5, s * s, 0.0)), jnp.log(c))
    return jnp.where(front, (shape + 2.0) / (2.0 * math.pi) * jnp.exp(shape * log_c), 0.0)


def opposite_norm(ndf, shape):
    """Return the constant N of P(r) = N D(r) sin^2 r, which integrates to 1 on [0, pi/2] (Lee 2018, Eq. 20).

    Phong: shape > -1.
    """
    if ndf == BECKMANN:
        return 4.0 * math.sqrt(math.pi) / shape
    if ndf == GGX:
        return 4.0 / shape
    x = 0.5 * shape + 0.5
    big = x > 5e3
    y = jnp.where(big, x, 5e3)
    series = y * jnp.sqrt(y) * (1.0 + (0.375 - 7.0 / (128.0 * y)) / y)
    z = jnp.where(big, 1.0, x)
    ratio = jnp.where(big, series, jnp.exp(gammaln(z + 1.5) - gammaln(z)))
    return 8.0 * math.sqrt(math.pi) / (shape + 2.0) * ratio
