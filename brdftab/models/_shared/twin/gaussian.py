"""Gaussian distribution of the tilt in JAX, under the names of the Numba module."""

from __future__ import annotations

import math

import jax.numpy as jnp

from brdftab.models._shared.facets.gaussian import FAR
from brdftab.quadrature import gauss

_X, _W = gauss(48)


def gaussian_norm(sigma):
    """Return 2 pi C sigma^2 with 1/C = 2 pi int_0^(pi/2) exp(-t^2/(2 sigma^2)) sin t dt; sigma in radians, positive."""
    high = jnp.minimum(FAR, 0.5 * math.pi / sigma)
    v = 0.5 * high * (1.0 + _X)
    t = sigma * v
    return 2.0 / (high * jnp.sum(_W * v * jnp.exp(-0.5 * v * v) * (jnp.sin(t) / t)))


def gaussian_density(sigma, norm, c, s):
    """Return D (1/sr) of a facet with tilt cosine c > 0 and sine s; `norm` is `gaussian_norm` of sigma."""
    v = jnp.arctan2(s, c) / sigma
    return norm * jnp.exp(-0.5 * v * v) / (2.0 * math.pi * sigma * sigma * c)
