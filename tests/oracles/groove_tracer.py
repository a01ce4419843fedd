"""Mirror tracer of one V-shaped groove in its plane: ray-segment intersections and reflections, no closed forms.

The groove has height 1: left facet from the apex (0, 0) to (-cot l, 1), right facet from the apex to (cot r, 1) with
tilts l and r. Angles are counter-clockwise positive from the vertical, so an angle t is the direction (-sin t, cos t);
the left facet's normal lies at -l and the right one's at +r. Rays come from the direction theta_i and enter through the
opening z = 1.

Why bisection finds every beam: unfold the reflections and a ray becomes a straight line beside the apex. Hitting a
given sequence of mirror images is one interval of offsets, and missing the next image cuts that interval from one side
only. The rays with one signature (first facet, number of bounces) therefore form one interval of the opening: two rays
with equal signatures have nothing else between them, and following a change of signature down to rounding finds each
neighbour.
"""

import math

import numpy as np
from numba import njit, prange

from benchmarks.papers.grooves import trace


@njit(nogil=True)
def beams(theta_i, left, right, widths, angles):
    """Fill widths and angles (2, K + 1) of all beams, indexed [first facet, bounces]; returns the whole width.

    `left` and `right` are the tilts. Widths are perpendicular to the incoming ray, for groove height 1, exact to
    rounding (bisection on signatures). Beams of K bounces or more are counted under K.
    """
    limit = widths.shape[1] - 1
    widths[:] = 0.0
    angles[:] = math.nan
    seen = (1.0 / math.tan(left) + 1.0 / math.tan(right)) * math.cos(theta_i)
    edge = np.empty(256)
    mark = np.empty(256, np.int64)
    lo, hi = 1e-15, 1.0 - 1e-15
    f, k, out = trace(lo, theta_i, left, right, limit)
    here = f * (limit + 1) + k
    if f >= 0:
        angles[f, k] = out
    f, k, out = trace(hi, theta_i, left, right, limit)
    if f >= 0:
        angles[f, k] = out
    edge[0], mark[0], depth = hi, f * (limit + 1) + k, 1
    while depth > 0:
        hi, there = edge[depth - 1], mark[depth - 1]
        mid = 0.5 * (lo + hi)
        if here == there or hi - lo <= 1e-15 or mid <= lo or mid >= hi or depth >= 255:
            for side in (here, there):
                if side >= 0:
                    widths[side // (limit + 1), side % (limit + 1)] += 0.5 * (hi - lo) * seen
            lo, here = hi, there
            depth -= 1
        else:
            f, k, out = trace(mid, theta_i, left, right, limit)
            if f >= 0:
                angles[f, k] = out
            edge[depth], mark[depth] = mid, f * (limit + 1) + k
            depth += 1
    return seen


@njit(parallel=True)
def beams_grid(theta_i, left, right, limit):
    """Run `beams` over 1-D arrays (N,); returns widths, angles (N, 2, limit + 1) and whole widths (N,)."""
    n = theta_i.size
    widths = np.zeros((n, 2, limit + 1))
    angles = np.zeros((n, 2, limit + 1))
    seen = np.zeros(n)
    for i in prange(n):
        seen[i] = beams(theta_i[i], left[i], right[i], widths[i], angles[i])
    return widths, angles, seen
