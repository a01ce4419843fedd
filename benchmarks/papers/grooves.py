"""Mirror tracer of one V-shaped groove in its plane, and the closed forms that it is held against.

The groove has height 1: left facet from the apex (0, 0) to (-cot l, 1), right facet from the apex to (cot r, 1) with
tilts l and r. Angles are counter-clockwise positive from the vertical, so an angle t is the direction (-sin t, cos t);
the left facet's normal lies at -l and the right one's at +r. Rays come from the direction theta_i and enter through the
opening z = 1. The tracer knows ray-segment intersections and reflections alone.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from brdftab.models._shared.grooves.groove2d import width_nonsymmetric, width_symmetric
from brdftab.typing import Array

LEFT, RIGHT = 0, 1


@njit(cache=True, nogil=True)
def hit(px: float, pz: float, dx: float, dz: float, ex: float, ez: float) -> tuple[float, float]:
    """Return (t, s) of the ray p + t d on the segment s e, 0 <= s <= 1; t < 0 where there is no hit ahead."""
    den = ex * dz - ez * dx
    if den == 0.0:
        return -1.0, 0.0
    t = (px * ez - pz * ex) / den
    s = (px * dz - pz * dx) / den
    if t <= 0.0 or s <= 0.0 or s > 1.0:
        return -1.0, 0.0
    return t, s


@njit(cache=True, nogil=True)
def bounce(
    px: float, pz: float, dx: float, dz: float, last: int, top_l: float, top_r: float, limit: int
) -> tuple[int, int, float, float]:
    """Follow a ray inside the groove.

    `last` is the facet it starts on (-1 for none), `top_l` and `top_r` are the horizontal positions of both tops.
    Returns (first facet or -1, number of bounces, dx, dz) when the ray leaves or has made `limit` bounces.
    """
    first, count = -1, 0
    while count < limit:
        facet, nearest, along = -1, math.inf, 0.0
        for f in range(2):
            if f != last:
                t, s = hit(px, pz, dx, dz, top_l if f == LEFT else top_r, 1.0)
                if 0.0 < t < nearest:
                    facet, nearest, along = f, t, s
        if facet < 0:
            break
        ex = top_l if facet == LEFT else top_r
        px, pz = along * ex, along
        norm = math.hypot(ex, 1.0)
        ux, uz = ex / norm, 1.0 / norm
        twice = 2.0 * (dx * ux + dz * uz)
        dx, dz = twice * ux - dx, twice * uz - dz
        if first < 0:
            first = facet
        last = facet
        count += 1
    return first, count, dx, dz


@njit(cache=True, nogil=True)
def trace(fraction: float, theta_i: float, left: float, right: float, limit: int) -> tuple[int, int, float]:
    """Send one ray through the opening at `fraction` of its width; returns (first facet, bounces, outgoing angle)."""
    top_l, top_r = -1.0 / math.tan(left), 1.0 / math.tan(right)
    x = top_l + fraction * (top_r - top_l)
    first, count, dx, dz = bounce(x, 1.0, math.sin(theta_i), -math.cos(theta_i), -1, top_l, top_r, limit)
    return first, count, math.atan2(-dx, dz)


@njit(cache=True, parallel=True, nogil=True)
def counted(
    theta_i: Array, left: Array, right: Array, rays: int, stratified: bool, seed: int, limit: int, out: Array
) -> None:
    """Fill out (N, 2, limit), by first facet and bounces, with shares of rays through the opening of N grooves.

    Stratified rays enter at the middles of equal parts of the opening.
    """
    for n in prange(theta_i.size):
        np.random.seed(seed + n)
        for k in range(rays):
            at = (k + 0.5) / rays if stratified else np.random.random()
            first, count, _ = trace(at, theta_i[n], left[n], right[n], limit - 1)
            if first >= 0:
                out[n, first, count] += 1.0 / rays


@njit(cache=True, parallel=True, nogil=True)
def closed_symmetric(theta_i: Array, tilt: Array, limit: int) -> tuple[Array, Array]:
    """Return closed-form widths and angles (N, 2, limit) of symmetric grooves; the right facet by mirroring."""
    widths = np.zeros((theta_i.size, 2, limit))
    angles = np.zeros((theta_i.size, 2, limit))
    for n in prange(theta_i.size):
        for k in range(1, limit):
            widths[n, 0, k], angles[n, 0, k] = width_symmetric(theta_i[n], tilt[n], k)
            w, out = width_symmetric(-theta_i[n], tilt[n], k)
            widths[n, 1, k], angles[n, 1, k] = w, -out
    return widths, angles


@njit(cache=True, parallel=True, nogil=True)
def closed_nonsymmetric(theta_i: Array, left: Array, right: Array, limit: int) -> tuple[Array, Array]:
    """Return closed-form widths and angles (N, 2, limit) of grooves with two tilts."""
    widths = np.zeros((theta_i.size, 2, limit))
    angles = np.zeros((theta_i.size, 2, limit))
    for n in prange(theta_i.size):
        for k in range(1, limit):
            widths[n, 0, k], angles[n, 0, k] = width_nonsymmetric(theta_i[n], left[n], right[n], k)
            w, out = width_nonsymmetric(-theta_i[n], right[n], left[n], k)
            widths[n, 1, k], angles[n, 1, k] = w, -out
    return widths, angles
