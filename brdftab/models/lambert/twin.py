"""Lambert in JAX: f = kd/pi above the horizon."""

from __future__ import annotations

import math

import jax.numpy as jnp

from brdftab.models._shared.twin.frame import lifted

SHAPE_PARAMS: tuple[str, ...] = ()


def shapes(static, p, d):
    """Return 1/pi above the horizon, (N,)."""
    above, _ = lifted(d)
    return (jnp.where(above, 1.0 / math.pi, 0.0),)


def value(static, p, shapes, d):
    """Return the BRDF (1/sr) of one channel, (N,)."""
    return p["kd"] * shapes[0]
