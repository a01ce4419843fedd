"""Mirror paths through the cross-section of a scratch, from aperture to aperture.

In the plane across the scratch a ray that comes from angle p (from the vertical, towards +x) travels along
(-sin p, -cos p); reflections there are those of the extruded scratch, whatever the angle along it. All that a path
leaves behind is its exit angle, how often it bounced, and the cosines of its incidences.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel

# pieces a block; rays skip blocks that lie below them
BLOCK = 16
STEEP = 1e-13
# half widths: a surface this close below the aperture is met where the ray enters, whatever rounding makes of the root
TOUCHING = 1e-14
# representative cosines of a path
GROUPS = 4


def block_tops(knots: np.ndarray, height: np.ndarray, slope: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Return the highest point of every `BLOCK` pieces, (ceil(N/BLOCK),)."""
    width = np.diff(knots)
    turn = np.divide(-0.5 * slope, bend, out=np.zeros_like(slope), where=bend < 0.0)
    turn = np.clip(turn, 0.0, width)
    tops = np.maximum(height, height + width * (slope + width * bend))
    tops = np.maximum(tops, height + turn * (slope + turn * bend))
    starts = np.arange(0, tops.size, BLOCK)
    return np.maximum.reduceat(tops, starts)


@kernel
def _crossing(a, b, c, low, high, forward):
    """Return the first root of a + b u + c u^2 in [low, high] along the direction of travel, -1 if there is none."""
    if abs(c) * (high - low) <= 1e-14 * abs(b):
        if b == 0.0:
            return -1.0
        u = -a / b
        return u if low <= u <= high else -1.0
    d = b * b - 4.0 * a * c
    if d < 0.0:
        return -1.0
    q = -0.5 * (b + math.copysign(math.sqrt(d), b))
    r, s = q / c, (a / q if q != 0.0 else q / c)
    first, second = min(r, s), max(r, s)
    if not forward:
        first, second = second, first
    if low <= first <= high:
        return first
    if low <= second <= high:
        return second
    return -1.0


@kernel
def _next_hit(shape, tops, x, y, n, dx, dy, leaving):
    """Return (x, y, piece) where a ray meets the profile, piece -1 if it leaves.

    `leaving` tells that the ray starts on piece n itself, whose root at the start does not count.
    """
    knots, height, slope, bend = shape
    last = height.size - 1
    if abs(dx) < STEEP:
        if dy > 0.0:
            return x, y, -1
        u = x - knots[n]
        return x, height[n] + u * (slope[n] + u * bend[n]), n
    m = dy / dx
    forward = dx > 0.0
    if not leaving:
        u = x - knots[n]
        surface = height[n] + u * (slope[n] + u * bend[n])
        if y - surface <= TOUCHING:
            return x, surface, n
    if leaving:
        # of the two roots one is the start; they add up to (m - slope)/bend
        if bend[n] != 0.0:
            u0 = x - knots[n]
            u = (m - slope[n]) / bend[n] - u0
            width = knots[n + 1] - knots[n]
            if 0.0 <= u <= width and ((u > u0) if forward else (u < u0)) and abs(u - u0) > 1e-13:
                return knots[n] + u, height[n] + u * (slope[n] + u * bend[n]), n
        at = knots[n + 1] if forward else knots[n]
        y += m * (at - x)
        x = at
        n += 1 if forward else -1
    while 0 <= n <= last:
        if y >= 0.0 and dy > 0.0:
            return x, y, -1
        if forward and n % BLOCK == 0:
            end = knots[min(n + BLOCK, last + 1)]
            then = y + m * (end - x)
            if min(y, then) > tops[n // BLOCK]:
                x, y = end, then
                n += BLOCK
                continue
        elif not forward and n % BLOCK == BLOCK - 1:
            end = knots[n - BLOCK + 1]
            then = y + m * (end - x)
            if min(y, then) > tops[n // BLOCK]:
                x, y = end, then
                n -= BLOCK
                continue
        low, high = knots[n], knots[n + 1]
        # the ray less the profile over this piece
        a = y + m * (low - x) - height[n]
        u0 = x - low
        if a + u0 * (m - slope[n] - u0 * bend[n]) < 0.0:
            # rounding put the ray below the knot
            return x, height[n] + u0 * (slope[n] + u0 * bend[n]), n
        if forward:
            u = _crossing(a, m - slope[n], -bend[n], u0, high - low, True)
        else:
            u = _crossing(a, m - slope[n], -bend[n], 0.0, u0, False)
        if u >= 0.0:
            return low + u, height[n] + u * (slope[n] + u * bend[n]), n
        at = high if forward else low
        y += m * (at - x)
        x = at
        n += 1 if forward else -1
    return x, y, -1


@kernel
def piece_at(knots, x):
    """Return the number of the piece that holds x."""
    low, high = 0, knots.size - 2
    while low < high:
        middle = (low + high + 1) // 2
        if knots[middle] <= x:
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def _groups(cosines, count, quarters):
    """Write the means of up to four equal groups of the sorted cosines; a path reversed has the same."""
    for i in range(1, count):
        c = cosines[i]
        j = i
        while j > 0 and cosines[j - 1] > c:
            cosines[j] = cosines[j - 1]
            j -= 1
        cosines[j] = c
    groups = min(count, GROUPS)
    for g in range(groups):
        low, high = g * count / groups, (g + 1) * count / groups
        total = 0.0
        for n in range(int(low), math.ceil(high)):
            total += cosines[n] * (min(high, n + 1.0) - max(low, float(n)))
        quarters[g] = total / (high - low)
    for g in range(groups, GROUPS):
        quarters[g] = 0.0


@kernel
def path(shape, tops, start, sine, cosine, cosines, ray):
    """Follow the ray that enters the aperture at x = start from the direction (sine, cosine).

    Parameters
    ----------
    shape, tops
        Pieces of the profile and the tops of their blocks.
    start, sine, cosine : float
        Position in [-1, 1] and direction that the light comes from.
    cosines : float64 (cap,)
        Scratch space, as long as the largest number of bounces.
    ray : float64 (3 + GROUPS,)
        Receives position, exit angle (radians), number of bounces (0: cut off by the cap, or lost to rounding below the
        surface), and the means of groups of the sorted cosines of incidence, `GROUPS` or as many as there are bounces.
    """
    knots, _, slope, bend = shape
    dx, dy = -sine, -cosine
    x, y = start, 0.0
    n = piece_at(knots, x)
    count = 0
    ray[0], ray[1], ray[2] = start, 0.0, 0.0
    while True:
        x, y, n = _next_hit(shape, tops, x, y, n, dx, dy, count > 0)
        if n < 0:
            break
        if count == cosines.size:
            return
        s = slope[n] + 2.0 * (x - knots[n]) * bend[n]
        r = 1.0 / math.sqrt(1.0 + s * s)
        nx, ny = -s * r, r
        # grazing a knot, rounding may put the ray behind the wall: it passes along
        c = max(-(dx * nx + dy * ny), 0.0)
        dx += 2.0 * c * nx
        dy += 2.0 * c * ny
        cosines[count] = c
        count += 1
    if dy > 0.0 and count > 0:
        ray[1], ray[2] = math.atan2(dx, dy), count
        _groups(cosines, count, ray[3:])
