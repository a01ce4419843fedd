"""Oren-Nayar in JAX: both parts as multiples of kd and kd^2 that depend on sigma alone."""

from __future__ import annotations

import math

import jax.numpy as jnp

from brdftab.models._shared.twin.frame import lifted

SHAPE_PARAMS = ("sigma",)


def shapes(static, p, d):
    """Return the direct part over kd and the interreflection over kd^2, both (N,) in 1/sr (1994, Eqs. 27-30)."""
    above, d = lifted(d)
    s2 = p["sigma"] * p["sigma"]
    alpha, beta = jnp.maximum(d.theta_i, d.theta_o), jnp.minimum(d.theta_i, d.theta_o)
    cos_phi = jnp.cos(d.phi)
    c1 = 1.0 - 0.5 * s2 / (s2 + 0.33)
    c2 = 0.45 * s2 / (s2 + 0.09)
    tilted = jnp.sin(alpha)
    if static.option("variant") == "qualitative":
        direct = c1 + c2 * jnp.maximum(cos_phi, 0.0) * tilted * jnp.tan(beta)
        return jnp.where(above, direct / math.pi, 0.0), jnp.zeros_like(alpha)
    share = 2.0 * beta / math.pi
    tilted = tilted - jnp.where(cos_phi < 0.0, share * share * share, 0.0)
    both = 4.0 * alpha * beta / (math.pi * math.pi)
    c3 = 0.125 * s2 / (s2 + 0.09) * both * both
    direct = c1 + cos_phi * c2 * tilted * jnp.tan(beta)
    direct = direct + (1.0 - jnp.abs(cos_phi)) * c3 * jnp.tan(0.5 * (alpha + beta))
    inter = 0.17 / math.pi * s2 / (s2 + 0.13) * (1.0 - cos_phi * share * share)
    # where the clamped fit is 0, so is its derivative
    kept = above & (direct > 0.0)
    return jnp.where(kept, direct / math.pi, 0.0), jnp.where(above, inter, 0.0)


def value(static, p, shapes, d):
    """Return the BRDF (1/sr) of one channel, (N,)."""
    direct, inter = shapes
    return p["kd"] * (direct + p["kd"] * inter)
