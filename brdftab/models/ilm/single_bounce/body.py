"""The body integral I (Meneveaux et al. 2018, Eq. 13): f_b = kappa I, shared by all channels of one index.

I = 1/pi int P(s) m_z T(i.m) T(o.m) g(a, b) d^2 s with a = 1 + t_i.s, b = 1 + t_o.s over a, b > 0, where P(s) is the
distribution's density of slopes, g = a b with Smith masking (times G1 G1) and min(a b, 2 a, 2 b) with V-cavities.

Two rules: the split rule cuts polar coordinates of the stretched slopes at every kink and holds everywhere; the plain
rule takes Gauss-Laguerre nodes in the squared radius times equal steps in azimuth and serves where the kinks lie so far
out that no facets are there.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.models._shared.codes import BECKMANN, GAUSSIAN, GGX
from brdftab.models._shared.fresnel.interface import grazing_scale, transmission
from brdftab.models.ilm.single_bounce.kink_lines import (
    MOST_LINES,
    MOST_RADII,
    SOFT_TOP,
    axis_lines,
    crossing,
    crossings,
    hard_lines,
    soft_lines,
    sort,
)

PI = math.pi
# panels whose ends differ by more than RATIO are cut into equal steps of the logarithm
RATIO, LOG_STEP = 8.0, math.log(6.0)


@kernel
def integrand(x, y, n, ix, iy, iz, ox, oy, oz, cavity):
    """Return m_z T(i.m) T(o.m) g(a, b) at an unstretched slope (x, y); (ix, iy), (ox, oy) are t_i, t_o."""
    a = 1.0 + (ix * x + iy * y)
    b = 1.0 + (ox * x + oy * y)
    if a <= 0.0 or b <= 0.0:
        return 0.0
    mz = 1.0 / math.sqrt(1.0 + (x * x + y * y))
    g = a * b
    if cavity:
        g = min(g, 2.0 * min(a, b))
    g *= mz
    if n > 1.0:
        g *= transmission(n, min(1.0, iz * a * mz)) * transmission(n, min(1.0, oz * b * mz))
    return g


@kernel
def _arcs(r, kx, ky, lines, count, cuts):
    """Fill cuts with the sorted azimuths in [0, 2 pi) at which a circle of radius r crosses lines; returns how many."""
    found = 0
    for k in range(count):
        for side in range(2):
            angle = crossing(lines[k], r, kx, ky, 1.0 - 2.0 * side)
            if not math.isnan(angle):
                cuts[found] = angle - 2.0 * PI * math.floor(angle / (2.0 * PI))
                found += 1
    if found == 0:
        cuts[0] = 0.0
        found = 1
    sort(cuts, found)
    return found


@kernel
def ring(r, kx, ky, n, ix, iy, iz, ox, oy, oz, cavity, lines, count, gauss, cuts):
    """Integrate the integrand over the azimuth at stretched radius r (slopes kx r cos, ky r sin), arc by arc."""
    found = _arcs(r, kx, ky, lines, count, cuts)
    x, y = kx * r, ky * r
    total = 0.0
    for k in range(found):
        start = cuts[k]
        span = (cuts[k + 1] if k + 1 < found else cuts[0] + 2.0 * PI) - start
        if span < 1e-15:
            continue
        middle = start + 0.5 * span
        u, v = x * math.cos(middle), y * math.sin(middle)
        if ix * u + iy * v <= -1.0 or ox * u + oy * v <= -1.0:
            continue
        pieces = math.ceil(span / (0.34 * PI))
        step = span / pieces
        part = 0.0
        for p in range(pieces):
            for j in range(gauss.shape[1]):
                angle = start + step * (p + gauss[0, j])
                u, v = x * math.cos(angle), y * math.sin(angle)
                part += gauss[1, j] * integrand(u, v, n, ix, iy, iz, ox, oy, oz, cavity)
        total += step * part
    return total


@kernel
def _scaled(ndf, r):
    """Return the radial variable of a stretched radius: r (Beckmann), else atan r."""
    return r if ndf == BECKMANN else math.atan(r)


@kernel
def _marks(ndf, sx, sy, n, high, steep, tolerance, z, count):
    """Append the radii at which density and m_z change their scale; returns the new count."""
    wide = max(sx, sy)
    if ndf != BECKMANN:
        # slopes are the tangents of the radial variable
        z[count] = 0.25 * PI
        count += 1
    if ndf == GAUSSIAN:
        z[count] = math.atan(3.0)
        count += 1
    if ndf != GGX:
        unit = 1.0 if ndf == BECKMANN else math.sqrt(2.0) * sx
        for k in range(3):
            z[count + k] = unit * (1.3 if k == 0 else (2.6 if k == 1 else 4.2))
        count += 3
    # m_z = (1 + (sigma r)^2)^(-1/2)
    if ndf != GAUSSIAN and max(wide, steep) ** 2 > 0.01 * tolerance:
        for k in range(4):
            r = 0.4 * 2.5**k / wide
            if ndf == GGX or r < high:
                z[count] = _scaled(ndf, r)
                count += 1
    # facets so steep that they are seen at grazing angles from everywhere
    level = grazing_scale(n)
    while level < SOFT_TOP:
        r = 1.0 / (level * (1.0 if ndf == GAUSSIAN else wide))
        if ndf != BECKMANN or r < high:
            z[count] = _scaled(ndf, r)
            count += 1
        level *= 4.0
    return count


@kernel
def _graded(ndf, high, z, count):
    """Insert radii between sorted neighbours (the last is `high`) of very different scale; returns the new count."""
    for k in range(count - 1):
        low, top = z[k], z[k + 1]
        if low > 0.0 and top > RATIO * low and low < high:
            steps = int(math.log(min(top, high) / low) / LOG_STEP)
            for j in range(1, steps + 1):
                if count < z.size:
                    z[count] = low * math.exp(j * math.log(min(top, high) / low) / (steps + 1))
                    count += 1
        # towards slopes that grow without bound
        low, top = 0.5 * PI - top, 0.5 * PI - low
        if ndf != BECKMANN and low > 1e-12 and top > RATIO * low:
            steps = int(math.log(top / low) / LOG_STEP)
            for j in range(1, steps + 1):
                if count < z.size:
                    z[count] = 0.5 * PI - low * math.exp(j * math.log(top / low) / (steps + 1))
                    count += 1
    sort(z, count)
    return count


@kernel
def _density(ndf, sx, z):
    """Return the density of the radial variable z, int dz over all of it and 2 pi = 1 (Gaussian: up to sin(z)/z)."""
    if ndf == BECKMANN:
        return z * math.exp(-z * z) / PI
    if ndf == GGX:
        return math.sin(z) * math.cos(z) / PI
    v = z / sx
    return v * math.exp(-0.5 * v * v) / (2.0 * PI * sx)


@kernel
def _share(ndf, sx, low, top):
    """Return the integral of `_density` over [low, top], without cancellation."""
    if ndf == GGX:
        return math.sin(top - low) * math.sin(top + low) / (2.0 * PI)
    scale = 1.0 if ndf == BECKMANN else math.sqrt(0.5) / sx
    low, top = scale * low, scale * top
    return -math.exp(-low * low) * math.expm1((low - top) * (low + top)) / (2.0 * PI)


@kernel
def split_integral(ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, gauss, tolerance):
    """Return I (1/sr), unmasked with Smith, by Gauss panels between all kinks.

    Parameters
    ----------
    ndf : int
        0 Beckmann, 1 GGX, 3 Gaussian in the tilt.
    cavity : bool
        V-cavity masking inside the integral.
    sx, sy : float
        Roughness, positive.
    norm : float
        `gaussian_norm`; unused otherwise.
    n : float
        Refractive index, >= 1.
    ix, iy, iz, ox, oy, oz : float
        Tangent-plane slopes and cosines of both directions.
    gauss : ndarray (2, m)
        Gauss-Legendre nodes and weights on (0, 1), used along every piece of radius and azimuth.
    tolerance : float
        Relative error asked: facets that cannot matter to it are left out.
    """
    kx, ky = (1.0, 1.0) if ndf == GAUSSIAN else (sx, sy)
    lines, cuts = np.empty((MOST_LINES, 4)), np.empty(2 * MOST_LINES + 1)
    z = np.empty(MOST_RADII)
    hard = hard_lines(kx * ix, ky * iy, kx * ox, ky * oy, cavity, lines)
    count = soft_lines(n, kx * ix, ky * iy, iz, kx * ox, ky * oy, oz, lines, hard)
    if sx != sy:
        count = axis_lines(ndf, sx, sy, lines, count)
    found = crossings(lines, hard, z, 0)
    for k in range(count):
        z[found] = lines[k, 1]
        found += 1
    # GGX: facets beyond the last radius that matters are a share that the last panel knows
    steep = max(math.hypot(kx * ix, ky * iy), math.hypot(kx * ox, ky * oy))
    last = 10.0 / math.sqrt(tolerance) if steep * steep < 0.01 * tolerance else 1e300
    kept = 0
    for k in range(found):
        if z[k] < last:
            z[kept] = _scaled(ndf, z[k])
            kept += 1
    far = math.sqrt(-math.log(min(1e-3 * tolerance, 1e-4)))
    high = far if ndf == BECKMANN else (0.5 * PI if ndf == GGX else min(0.5 * PI, math.sqrt(2.0) * far * sx))
    found = _marks(ndf, sx, sy, n, high, steep, tolerance, z, kept)
    z[found], z[found + 1] = 0.0, high
    found += 2
    sort(z, found)
    found = _graded(ndf, high, z, found)
    total = 0.0
    for k in range(found - 1):
        low, top = z[k], min(z[k + 1], high)
        width = top - low
        if width <= 1e-14 * high:
            continue
        part, mass = 0.0, 0.0
        for j in range(gauss.shape[1]):
            t = gauss[0, j]
            # (r - distance)^(1/2 + k) at both ends of a panel becomes smooth
            at = low + width * t * t * (3.0 - 2.0 * t)
            weight = gauss[1, j] * width * 6.0 * t * (1.0 - t) * _density(ndf, sx, at)
            mass += weight
            r = at
            if ndf != BECKMANN:
                r = math.tan(at)
            if ndf == GAUSSIAN:
                weight *= norm * math.sin(at) / at
            part += weight * ring(r, kx, ky, n, ix, iy, iz, ox, oy, oz, cavity, lines, count, gauss, cuts)
        # the share of facets in a panel is known: few nodes need not find it
        if mass > 0.0:
            total += part * (_share(ndf, sx, low, top) / mass)
    return total / PI


@kernel
def plain_integral(ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, laguerre, steps):
    """Return I (1/sr), unmasked with Smith, by Laguerre nodes (2, K) in the squared radius and `steps` azimuths.

    For Beckmann and Gaussian facets whose kinks lie far out; arguments as in `split_integral`.
    """
    total = 0.0
    for k in range(laguerre.shape[1]):
        r = math.sqrt(laguerre[0, k])
        weight = laguerre[1, k] / steps
        x, y = sx * r, sy * r
        if ndf == GAUSSIAN:
            t = math.sqrt(2.0) * sx * r
            if t >= 0.5 * PI:
                continue
            weight *= norm * math.sin(t) / t
            x = y = math.tan(t)
        for j in range(steps):
            angle = 2.0 * PI * (j + 0.5 * (k % 2)) / steps
            u, v = x * math.cos(angle), y * math.sin(angle)
            total += weight * integrand(u, v, n, ix, iy, iz, ox, oy, oz, cavity)
    return total / PI
