"""Where the integrand over the right facet's tilt r is smooth: support, kinks of the beam, scale of the distribution.

One side of the groove: t is the incoming, u the outgoing in-plane angle; k may be real (the tail integrates over it).
The left tilt follows from r: l = l0 - slope r.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import BECKMANN, GGX

PI = math.pi
HALF_PI = 0.5 * math.pi
TINY = 1e-13
CUTS = 64
# Phong lobes of this exponent and less reach the vertical
BROAD = 4.0
# a facet this close to the vertical is vertical; growth and number of the panels beside it
VERTICAL = 1e-12
WALL_RATIO, WALL_CUTS = 5.0, 12


@kernel
def left_tilt(t, u, k, odd):
    """Return (l0, slope) of l = l0 - slope r for order k."""
    if odd:
        return ((k - 1.0) * PI - (t + u)) / (k + 1.0), (k - 1.0) / (k + 1.0)
    return PI - (PI + t - u) / k, 1.0


@kernel
def support_even(t, u, l0, cuts):
    """Return (low, high, n): the range of r where the beam can be positive and n interior kinks written to cuts."""
    th = 0.5 * (t + u)
    d = 0.5 * (t - u)
    low = max(0.0, l0 - HALF_PI + max(0.0, max(th, t)))
    high = min(l0, HALF_PI + min(0.0, min(th, u)))
    if high - low < TINY:
        return low, high, 0
    n = 0
    ratio = math.sin(th) / math.cos(d)
    for side in range(2):
        v = -ratio * math.cos(l0 + (d if side == 0 else -d))
        if abs(v) <= 1.0:
            angle = math.asin(v)
            cuts[n] = 0.5 * (l0 + th + angle)
            cuts[n + 1] = 0.5 * (l0 + th + PI - angle)
            n += 2
    cuts[n] = HALF_PI + t
    cuts[n + 1] = l0 - HALF_PI + u
    return low, high, n + 2


@kernel
def _crossing(r, l0, slope, high, low):
    """Return sin r cos(l + high) + sin l cos(r - low): zero where the top of the beam meets its bottom."""
    left = l0 - slope * r
    return math.sin(r) * math.cos(left + high) + math.sin(left) * math.cos(r - low)


@kernel
def support_odd(t, u, l0, slope, cuts):
    """Return (low, high, n) for an odd order k >= 3, as `support_even`."""
    big, small = max(t, u), min(t, u)
    low = max(0.0, (l0 - HALF_PI + max(big, 0.0)) / slope)
    high = min(HALF_PI, l0 / slope)
    # pi/2 < 2 l + r + max(t, u) < 3 pi/2
    a = 2.0 * l0 + big
    b = 1.0 - 2.0 * slope
    if abs(b) < 1e-12:
        if a <= HALF_PI or a >= 3.0 * HALF_PI:
            return low, low, 0
    else:
        high = min(high, (HALF_PI - a) / b)
        low = max(low, (3.0 * HALF_PI - a) / b)
    if high - low < TINY:
        return low, high, 0
    cuts[0] = (l0 - 0.5 * (HALF_PI - big)) / slope
    n = 1
    start = HALF_PI + small
    if start >= high:
        return low, high, n
    cuts[n] = start
    n += 1
    x0 = max(low, start)
    step = (high - x0) / 3.0
    g0 = _crossing(x0, l0, slope, big, small)
    for _ in range(3):
        x1 = x0 + step
        g1 = _crossing(x1, l0, slope, big, small)
        if g0 * g1 < 0.0:
            cuts[n] = _illinois(x0, g0, x1, g1, l0, slope, big, small)
            n += 1
        x0, g0 = x1, g1
    return low, high, n


@kernel
def _illinois(x0, g0, x1, g1, l0, slope, big, small):
    """Return the bracketed root of `_crossing` by regula falsi with Illinois damping."""
    x = x0
    for _ in range(40):
        x = x0 - (x1 - x0) * g0 / (g1 - g0)
        g = _crossing(x, l0, slope, big, small)
        if abs(g) < 1e-13:
            break
        if g0 * g < 0.0:
            x1, g1 = x, g
            g0 *= 0.5
        else:
            x0, g0 = x, g
            g1 *= 0.5
    return x


@kernel
def _slope_curvature(ndf, shape, x):
    """Return first and second derivative of -log D over a facet's tilt (Beckmann: tan^2/alpha^2, Phong: -n log cos)."""
    tan = math.tan(min(max(x, 0.0), HALF_PI - 1e-9))
    sec2 = 1.0 + tan * tan
    if ndf == BECKMANN:
        f = 2.0 / (shape * shape)
        return f * tan * sec2, f * sec2 * (1.0 + 3.0 * tan * tan)
    return shape * tan, shape * sec2


@kernel
def _depth(ndf, shape, x):
    if ndf == BECKMANN:
        tan = math.tan(min(max(x, 0.0), HALF_PI - 1e-9))
        return tan * tan / (shape * shape)
    return -shape * math.log(max(math.cos(x), 1e-300))


@kernel
def peak_cuts(ndf, shape, l0, slope, low, high, depth_limit, cuts, n):
    """Clip to the peak of D(l) D(r) and add cuts around it; the depth -log D D there decides whether it counts.

    Returns (low, high, n); an empty range when the peak lies deeper than depth_limit.
    """
    x0, x1 = low, high
    r = min(max(l0 / (1.0 + slope), low), high)
    g, h = 0.0, 1.0
    for _ in range(40):
        gr, hr = _slope_curvature(ndf, shape, r)
        gl, hl = _slope_curvature(ndf, shape, l0 - slope * r)
        g = gr - slope * gl
        h = hr + slope * slope * hl
        if g > 0.0:
            x1 = r
        else:
            x0 = r
        new = min(max(r - g / h, low), high)
        if new < x0 or new > x1:
            new = 0.5 * (x0 + x1)
        if abs(new - r) < 1e-3 / math.sqrt(h):
            r = new
            break
        r = new
    gr, hr = _slope_curvature(ndf, shape, r)
    gl, hl = _slope_curvature(ndf, shape, l0 - slope * r)
    g = abs(gr - slope * gl)
    h = hr + slope * slope * hl
    depth = _depth(ndf, shape, r) + _depth(ndf, shape, l0 - slope * r)
    if depth > depth_limit:
        return low, low, n
    for level in range(3):
        fall = 1.2 if level == 0 else (8.0 if level == 1 else 35.0)
        reach = 2.0 * fall / (g + math.sqrt(g * g + 2.0 * h * fall))
        if level == 2:
            low = max(low, r - 1.3 * reach)
            high = min(high, r + 1.3 * reach)
        else:
            cuts[n] = r - reach
            cuts[n + 1] = r + reach
            n += 2
    return low, high, n


@kernel
def scale_cuts(first, ratio, count, l0, slope, cuts, n):
    """Add cuts where tan r and tan l pass first * ratio^j: the decades of a heavy-tailed distribution."""
    x = first
    for _ in range(count):
        angle = math.atan(x)
        cuts[n] = angle
        cuts[n + 1] = (l0 - angle) / slope
        n += 2
        x *= ratio
    return n


@kernel
def wall_cuts(low, high, l0, slope, cuts, n):
    """Add the middle and cuts towards the vertical of either facet, where D ~ cos^n with n < 0 grows without bound.

    They go out in powers of `WALL_RATIO` from the kink nearest to the vertical, or from the support's own end.
    """
    margin = 1e-12 * (high - low)
    right, left = HALF_PI - high, HALF_PI - l0 + slope * low
    middle = 0.5 * (low + high)
    cuts[n] = middle
    n += 1
    near_right, near_left = HALF_PI - middle, HALF_PI - l0 + slope * middle
    far_right, far_left = near_right, near_left
    for q in range(n - 1):
        if low + margin < cuts[q] < high - margin:
            near_right = min(near_right, HALF_PI - cuts[q])
            near_left = min(near_left, HALF_PI - l0 + slope * cuts[q])
    right = right if right > VERTICAL else near_right
    left = left if left > VERTICAL else near_left
    for _ in range(WALL_CUTS):
        right *= WALL_RATIO
        left *= WALL_RATIO
        cuts[n] = HALF_PI - min(right, far_right)
        cuts[n + 1] = (l0 - HALF_PI + min(left, far_left)) / slope
        n += 2
    return n


@kernel
def panel_edges(t, u, k, odd, ndf, shape, fine, depth_limit, cuts, edges):
    """Write the sorted panel edges of order k on one side and return their number (0: nothing to integrate).

    `fine` adds the scale cuts that only a tight tolerance needs.
    """
    l0, slope = left_tilt(t, u, k, odd)
    if odd:
        low, high, n = support_odd(t, u, l0, slope, cuts)
    else:
        low, high, n = support_even(t, u, l0, cuts)
    if high - low < TINY:
        return 0
    if ndf == GGX:
        if fine:
            n = scale_cuts(0.5 * shape, 4.0, 8, l0, slope, cuts, n)
        elif shape < 0.6:
            n = scale_cuts(shape, 4.0, 4, l0, slope, cuts, n)
    elif ndf == BECKMANN and shape > 1.2:
        # broad lobes are flat up to tan = alpha and then fall at once: no parabola describes them
        far = math.atan(6.4 * shape)
        low, high = max(low, (l0 - far) / slope), min(high, far)
        if high - low < TINY:
            return 0
        n = scale_cuts(0.25 * shape, 1.6 if fine else 2.56, 7 if fine else 4, l0, slope, cuts, n)
    elif ndf == BECKMANN or shape > BROAD:
        low, high, n = peak_cuts(ndf, shape, l0, slope, low, high, depth_limit, cuts, n)
        if high - low < TINY:
            return 0
    elif shape < 0.0:
        fine = True
        n = wall_cuts(low, high, l0, slope, cuts, n)
    else:
        n = scale_cuts(4.0, 4.0, 8 if fine else 3, l0, slope, cuts, n)
    edges[0] = low
    edges[1] = high
    count = 2
    margin = (1e-12 if fine else 1e-3) * (high - low)
    for q in range(n):
        if low + margin < cuts[q] < high - margin:
            edges[count] = cuts[q]
            count += 1
    for i in range(1, count):
        x = edges[i]
        j = i - 1
        while j >= 0 and edges[j] > x:
            edges[j + 1] = edges[j]
            j -= 1
        edges[j + 1] = x
    return count
