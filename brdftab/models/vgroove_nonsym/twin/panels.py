"""Panels over the right facet's tilt r in JAX: support, kinks of the beam, scale of the distribution; see `panels`.

All panels of all points are held in arrays of a fixed number of edges; those not needed have no width and come last.
Nothing here carries a derivative: the integral over r does not depend on where its panels begin.
"""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp
from jax import Array, lax

from brdftab.models._shared.twin.ndf import BECKMANN, GGX, PHONG
from brdftab.models.vgroove_nonsym.panels import BROAD, VERTICAL, WALL_CUTS, WALL_RATIO

PI = math.pi
HALF_PI = 0.5 * math.pi
TINY = 1e-13
STEPS = 40
Cuts = list[Array]


def left_tilt(t: Array, u: Array, k: Array, odd: bool) -> tuple[Array, Array]:
    """Return (l0, slope) of l = l0 - slope r for order k, real numbers (T,)."""
    if odd:
        return ((k - 1.0) * PI - (t + u)) / (k + 1.0), (k - 1.0) / (k + 1.0)
    return PI - (PI + t - u) / k, jnp.ones_like(k)


def _support_even(t: Array, u: Array, l0: Array) -> tuple[Array, Array, Cuts]:
    """Return low, high and kinks (nan where there is none) for an even order."""
    th, d = 0.5 * (t + u), 0.5 * (t - u)
    low = jnp.maximum(0.0, l0 - HALF_PI + jnp.maximum(0.0, jnp.maximum(th, t)))
    high = jnp.minimum(l0, HALF_PI + jnp.minimum(0.0, jnp.minimum(th, u)))
    ratio = jnp.sin(th) / jnp.cos(d)
    cuts = [HALF_PI + t, l0 - HALF_PI + u]
    for side in (d, -d):
        angle = jnp.arcsin(-ratio * jnp.cos(l0 + side))
        cuts += [0.5 * (l0 + th + angle), 0.5 * (l0 + th + PI - angle)]
    return low, high, cuts


def _support_odd(t: Array, u: Array, l0: Array, slope: Array) -> tuple[Array, Array, Cuts]:
    """Return low, high and kinks for an odd order >= 3; pi/2 < 2 l + r + max(t, u) < 3 pi/2 bounds the support."""
    big, small = jnp.maximum(t, u), jnp.minimum(t, u)
    low = jnp.maximum(0.0, (l0 - HALF_PI + jnp.maximum(big, 0.0)) / slope)
    high = jnp.minimum(HALF_PI, l0 / slope)
    a, b = 2.0 * l0 + big, 1.0 - 2.0 * slope
    level = jnp.abs(b) < 1e-12
    b = jnp.where(level, 1.0, b)
    shut = level & ((a <= HALF_PI) | (a >= 3.0 * HALF_PI))
    high = jnp.where(shut, low, jnp.where(level, high, jnp.minimum(high, (HALF_PI - a) / b)))
    low = jnp.where(level, low, jnp.maximum(low, (3.0 * HALF_PI - a) / b))
    start = HALF_PI + small
    cuts = [(l0 - 0.5 * (HALF_PI - big)) / slope, start]
    return low, high, cuts + _crossings(jnp.maximum(low, start), high, start < high, l0, slope, big, small)


def _crossings(x0: Array, high: Array, live: Array, l0: Array, slope: Array, big: Array, small: Array) -> Cuts:
    """Return the roots of top - bottom of the beam in three parts of (x0, high): regula falsi, Illinois damping."""

    def gap(r: Array) -> Array:
        left = l0 - slope * r
        return jnp.sin(r) * jnp.cos(left + big) + jnp.sin(left) * jnp.cos(r - small)

    step = (high - x0) / 3.0
    ends = jnp.stack([x0, x0 + step, x0 + step + step, x0 + step + step + step])
    g = gap(ends)
    found = live & (g[:-1] * g[1:] < 0.0)

    def going(state: tuple[Array, ...]) -> Array:
        return (state[0] < STEPS) & ~jnp.all(state[-1])

    def improve(state: tuple[Array, ...]) -> tuple[Array, ...]:
        count, x0, g0, x1, g1, x, done = state
        spread = g1 - g0
        new = x0 - (x1 - x0) * g0 / jnp.where(spread == 0.0, 1.0, spread)
        x = jnp.where(done, x, new)
        gx = gap(x)
        done = done | (jnp.abs(gx) < 1e-13)
        left = g0 * gx < 0.0
        return (
            count + 1,
            jnp.where(left, x0, x),
            jnp.where(left, 0.5 * g0, gx),
            jnp.where(left, x, x1),
            jnp.where(left, gx, 0.5 * g1),
            x,
            done,
        )

    start: tuple[Array, ...] = (jnp.asarray(0), ends[:-1], g[:-1], ends[1:], g[1:], ends[:-1], ~found)
    x = lax.while_loop(going, improve, start)[-2]
    return list(jnp.where(found, x, jnp.nan))


def _slope_curvature(ndf: int, shape: Array, x: Array) -> tuple[Array, Array]:
    """Return first and second derivative of -log D over a facet's tilt (Beckmann: tan^2/alpha^2, Phong: -n log cos)."""
    tan = jnp.tan(jnp.clip(x, 0.0, HALF_PI - 1e-9))
    sec2 = 1.0 + tan * tan
    if ndf == BECKMANN:
        f = 2.0 / (shape * shape)
        return f * tan * sec2, f * sec2 * (1.0 + 3.0 * tan * tan)
    return shape * tan, shape * sec2


def _depth(ndf: int, shape: Array, x: Array) -> Array:
    if ndf == BECKMANN:
        tan = jnp.tan(jnp.clip(x, 0.0, HALF_PI - 1e-9))
        return tan * tan / (shape * shape)
    return -shape * jnp.log(jnp.maximum(jnp.cos(x), 1e-300))


def _peak(
    ndf: int, shape: Array, l0: Array, slope: Array, low: Array, high: Array, limit: Array, wanted: Array
) -> tuple[Array, Array, Cuts]:
    """Return range and cuts around the peak of D(l) D(r) where `wanted`; no range where it lies deeper than `limit`."""

    def fall(r: Array) -> tuple[Array, Array]:
        (gr, hr), (gl, hl) = _slope_curvature(ndf, shape, r), _slope_curvature(ndf, shape, l0 - slope * r)
        return gr - slope * gl, hr + slope * slope * hl

    def going(state: tuple[Array, ...]) -> Array:
        return (state[0] < STEPS) & ~jnp.all(state[-1])

    def improve(state: tuple[Array, ...]) -> tuple[Array, ...]:
        count, x0, x1, r, done = state
        g, h = fall(r)
        x0, x1 = jnp.where(g > 0.0, x0, r), jnp.where(g > 0.0, r, x1)
        new = jnp.minimum(jnp.maximum(r - g / h, low), high)
        new = jnp.where((new < x0) | (new > x1), 0.5 * (x0 + x1), new)
        near = jnp.abs(new - r) < 1e-3 / jnp.sqrt(h)
        return count + 1, x0, x1, jnp.where(done, r, new), done | near

    middle = jnp.minimum(jnp.maximum(l0 / (1.0 + slope), low), high)
    start: tuple[Array, ...] = (jnp.asarray(0), low, high, middle, ~wanted)
    r = lax.while_loop(going, improve, start)[3]
    g, h = fall(r)
    g = jnp.abs(g)
    deep = _depth(ndf, shape, r) + _depth(ndf, shape, l0 - slope * r) > limit
    near, far, reach = (2.0 * f / (g + jnp.sqrt(g * g + 2.0 * h * f)) for f in (1.2, 8.0, 35.0))
    first = jnp.maximum(low, r - 1.3 * reach)
    last = jnp.where(deep, first, jnp.minimum(high, r + 1.3 * reach))
    return first, last, [r - near, r + near, r - far, r + far]


def _scales(first: Array, ratio: float, count: int, l0: Array, slope: Array) -> Cuts:
    """Return cuts where tan r and tan l pass first * ratio^j: the decades of a heavy-tailed distribution."""
    cuts = []
    for j in range(count):
        angle = jnp.arctan(first * ratio**j)
        cuts += [angle, (l0 - angle) / slope]
    return cuts


def _walls(low: Array, high: Array, l0: Array, slope: Array, cuts: Cuts) -> Cuts:
    """Return the middle and cuts towards the vertical of either facet; see `panels.wall_cuts`."""
    margin = 1e-12 * (high - low)
    middle = 0.5 * (low + high)

    def towards(gap: Any, end: Array) -> list[Array]:
        far = gap(middle)
        near = far
        for cut in cuts:
            near = jnp.minimum(near, jnp.where((low + margin < cut) & (cut < high - margin), gap(cut), far))
        start = jnp.where(gap(end) > VERTICAL, gap(end), near)
        return [jnp.minimum(start * WALL_RATIO ** (n + 1), far) for n in range(WALL_CUTS)]

    right = [HALF_PI - x for x in towards(lambda r: HALF_PI - r, high)]
    left = [(l0 - HALF_PI + x) / slope for x in towards(lambda r: HALF_PI - l0 + slope * r, low)]
    return [middle, *right, *left]


def panel_edges(
    t: Array, u: Array, k: Array, odd: bool, ndf: int, shape: Array, fine: bool, depth_limit: Array
) -> tuple[Array, Array]:
    """Return the sorted panel edges (E, T) of order k on one side, and how many panels (T,) have a width.

    Parameters as in the kernel; `odd`, `ndf` and `fine` are static.
    """
    l0, slope = left_tilt(t, u, k, odd)
    low, high, cuts = _support_odd(t, u, l0, slope) if odd else _support_even(t, u, l0)
    open_ = high - low >= TINY
    if ndf == GGX:
        if fine:
            cuts += _scales(0.5 * shape, 4.0, 8, l0, slope)
        else:
            cuts += [jnp.where(shape < 0.6, x, jnp.nan) for x in _scales(shape, 4.0, 4, l0, slope)]
    else:
        if ndf == BECKMANN:
            # broad lobes are flat up to tan = alpha and then fall at once: no parabola describes them
            broad = shape > 1.2
            far = jnp.where(broad, jnp.arctan(6.4 * shape), HALF_PI)
            scales = _scales(0.25 * shape, 1.6 if fine else 2.56, 7 if fine else 4, l0, slope)
            wide = jnp.maximum(low, (l0 - far) / slope), jnp.minimum(high, far)
        else:
            broad = shape <= BROAD
            walls = [jnp.where(shape < 0.0, x, jnp.nan) for x in _walls(low, high, l0, slope, cuts)]
            scales = _scales(jnp.full_like(shape, 4.0), 4.0, 8 if fine else 3, l0, slope)
            scales = [jnp.where(shape < 0.0, jnp.nan, x) for x in scales]
            wide = low, high
        first, last, peaks = _peak(ndf, shape, l0, slope, low, high, depth_limit, open_ & ~broad)
        low, high = jnp.where(broad, wide[0], first), jnp.where(broad, wide[1], last)
        peaks += [jnp.full_like(low, jnp.nan)] * (len(scales) - len(peaks))
        cuts += [jnp.where(broad, x, y) for x, y in zip(scales, peaks, strict=True)]
        if ndf == PHONG:
            cuts += walls
        open_ &= high - low >= TINY
    low, high = jnp.where(open_, low, 0.0), jnp.where(open_, high, 0.0)
    margin = jnp.where((ndf == PHONG) & (shape < 0.0), 1e-12, 1e-12 if fine else 1e-3) * (high - low)
    inner = jnp.stack(cuts)
    kept = (low + margin < inner) & (inner < high - margin)
    edges = jnp.sort(jnp.concatenate([low[None], jnp.where(kept, inner, high), high[None]]), axis=0)
    return edges, jnp.where(open_, 1 + jnp.sum(kept, axis=0), 0)
