"""Values of two and more bounces on a grid of angles, and at the data's points, in JAX."""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp

from brdftab.models.smith_multi.twin.nodes import CORE

# points of local interpolation along an axis
STENCIL = 6


def spread_modes(modes: Any, n: dict[str, Any]) -> Any:
    """Return values (I, O, F) on the grid of angles from modes (M, n, n) at the solved polar angles."""
    if "refined" in n:
        modes = n["refined"] @ modes @ n["refined"].T
    return jnp.einsum("mio,mf->iof", modes, n["synthesis"])


def _nearest(own: Any, x: Any) -> tuple[Any, Any]:
    """Return the index (1, N) of the data's own angle, and weight 1."""
    middle = 0.5 * (own[1:] + own[:-1])
    return jnp.searchsorted(middle, x)[None], jnp.ones((1, 1))


def _local(place: Any, size: int) -> tuple[Any, Any]:
    """Return indices and Lagrange weights (STENCIL, N) about a place in units of the grid's steps."""
    first = jnp.clip(jnp.floor(place).astype(int) - (STENCIL // 2 - 1), 0, size - STENCIL)
    x = place - first
    weights = []
    for k in range(STENCIL):
        others = [j for j in range(STENCIL) if j != k]
        scale = math.prod(k - j for j in others)
        product = jnp.ones_like(x)
        for j in others:
            product = product * (x - j)
        weights.append(product / scale)
    return first + jnp.arange(STENCIL)[:, None], jnp.stack(weights)


def _polar(n: dict[str, Any], theta: Any, size: int) -> tuple[Any, Any]:
    if "own_theta" in n:
        return _nearest(n["own_theta"], theta)
    part = jnp.clip(theta / n["span_theta"], 0.0, 1.0)
    return _local(jnp.arcsin(part) * (2.0 / math.pi * (size - 1)), size)


def _azimuth(n: dict[str, Any], phi: Any, size: int) -> tuple[Any, Any]:
    # from the mirror direction
    away = jnp.abs(math.pi - jnp.mod(phi, 2.0 * math.pi))
    if "own_azimuth" in n:
        return _nearest(n["own_azimuth"], away)
    return _local(jnp.arcsinh(away / CORE) / n["span_azimuth"] * (size - 1), size)


def at_points(grid: Any, n: dict[str, Any], d: Any) -> Any:
    """Return the grid's values at pairs of directions, (N,)."""
    polar, _, azimuths = grid.shape
    (i, wi), (o, wo), (f, wf) = _polar(n, d.theta_i, polar), _polar(n, d.theta_o, polar), _azimuth(n, d.phi, azimuths)
    index = (i[:, None, None] * polar + o[None, :, None]) * azimuths + f[None, None]
    picked = grid.reshape(-1)[index]
    return jnp.einsum("an,bn,cn,abcn->n", wi, wo, wf, picked)
