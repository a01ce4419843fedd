"""Where the body integrand has kinks or turns fast: straight lines in slope space, and the radii that they split.

A slope s stands for the normal (s_x, s_y, 1)/|.|, so a direction u of tangent-plane slope t sees it under
u.m = u_z m_z (1 + t.s). The integrand has kinks on t.s = -1 (facets seen edge-on) and, with V-cavities, on t.s = 1 and
(t_i - t_o).s = 0. It turns fast, though smoothly, where u.m is of the order of the interface's grazing scale.

Slopes are stretched by (sx, sy), so that the distribution is round; a line is the azimuth of its normal and its
distance from the origin.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import GGX
from brdftab.models._shared.fresnel.interface import grazing_scale

MOST_LINES = 64
MOST_RADII = 240
# soft lines stand at these multiples of the grazing scale, as long as they are below SOFT_TOP
SOFT_TOP = 0.35


@kernel
def _add(lines, count, normal, distance, level, slope):
    """Store one line (azimuth of its normal, distance, level and slope of soft ones) and return the new count."""
    if count < lines.shape[0]:
        lines[count, 0] = normal
        lines[count, 1] = distance
        lines[count, 2] = level
        lines[count, 3] = slope
        count += 1
    return count


@kernel
def hard_lines(ix, iy, ox, oy, cavity, lines):
    """Fill lines (L, 2) with those of the kinks and return how many; (ix, iy), (ox, oy) are stretched t_i, t_o."""
    count = 0
    for k in range(2):
        x, y = (ix, iy) if k == 0 else (ox, oy)
        h = math.hypot(x, y)
        if h > 0.0:
            count = _add(lines, count, math.atan2(-y, -x), 1.0 / h, 0.0, 0.0)
            if cavity:
                count = _add(lines, count, math.atan2(y, x), 1.0 / h, 0.0, 0.0)
    if cavity and math.hypot(ix - ox, iy - oy) > 1e-12 * (math.hypot(ix, iy) + math.hypot(ox, oy)):
        count = _add(lines, count, math.atan2(iy - oy, ix - ox), 0.0, 0.0, 0.0)
    return count


@kernel
def soft_lines(n, ix, iy, iz, ox, oy, oz, lines, count):
    """Append the curves where u.m is the interface's grazing scale times 1, 4, 16, ...; returns the new count.

    They are straight up to m_z, which `crossing` puts in; their stored distance takes m_z at the foot of t.s = -1.
    """
    scale = grazing_scale(n)
    for k in range(2):
        x, y, z = (ix, iy, iz) if k == 0 else (ox, oy, oz)
        h = math.hypot(x, y)
        sine = math.sqrt(max(1.0 - z * z, 0.0))
        level = scale
        while h > 0.0 and level < SOFT_TOP:
            distance = (level / max(z * sine, 1e-300) - 1.0) / h
            count = _add(lines, count, math.atan2(y, x), abs(distance), level / z, h)
            level *= 4.0
    return count


@kernel
def crossing(line, r, kx, ky, side):
    """Return the azimuth at which a circle of stretched radius r crosses a line on one side, or nan where it does not.

    m_z of a soft line is taken where the line with m_z at its foot crosses: exact for isotropic facets.
    """
    normal, distance, level, slope = line[0], line[1], line[2], line[3]
    if level > 0.0:
        angle = normal
        for _ in range(2):
            x, y = kx * r * math.cos(angle), ky * r * math.sin(angle)
            distance = (level * math.sqrt(1.0 + x * x + y * y) - 1.0) / slope
            if abs(distance) >= r:
                return math.nan
            angle = normal + side * math.acos(distance / r)
        return angle
    if distance >= r:
        return math.nan
    return normal + side * math.acos(distance / r)


@kernel
def axis_lines(ndf, sx, sy, lines, count):
    """Append lines along the axis of the narrow side of anisotropic facets, where m_z turns fast; returns the count."""
    wide, narrow = max(sx, sy), min(sx, sy)
    if wide < 1.2 * narrow or (ndf != GGX and wide < 0.1):
        return count
    normal = 0.5 * math.pi if sy > sx else 0.0
    count = _add(lines, count, normal, 0.0, 0.0, 0.0)
    for k in range(3):
        distance = 0.7 * 3.0**k / wide
        count = _add(lines, count, normal, distance, 0.0, 0.0)
        count = _add(lines, count, normal + math.pi, distance, 0.0, 0.0)
    return count


@kernel
def crossings(lines, hard, radii, count):
    """Append to radii (R,) the distances at which hard lines cross each other; returns the new count."""
    for a in range(hard):
        xa, ya, da = math.cos(lines[a, 0]), math.sin(lines[a, 0]), lines[a, 1]
        for b in range(a):
            xb, yb, db = math.cos(lines[b, 0]), math.sin(lines[b, 0]), lines[b, 1]
            det = xa * yb - ya * xb
            if abs(det) > 1e-9:
                x, y = (da * yb - db * ya) / det, (db * xa - da * xb) / det
                if count < radii.size:
                    radii[count] = math.hypot(x, y)
                    count += 1
    return count


@kernel
def sort(values, count):
    """Sort the first `count` entries of an array in place."""
    for k in range(1, count):
        value = values[k]
        j = k - 1
        while j >= 0 and values[j] > value:
            values[j + 1] = values[j]
            j -= 1
        values[j + 1] = value
