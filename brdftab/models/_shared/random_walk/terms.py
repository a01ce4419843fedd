"""What a path between Smith microfacets is made of: segments, facets, and when it leaves (Wang et al. 2022, Sec. 3).

Directions are unit vectors with z along the surface normal. Lambda is evaluated at |z|, so that Lambda(-w) = -1 -
Lambda(w) need not be formed; every term is finite for horizontal directions.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import GGX

_ROOT_PI = math.sqrt(math.pi)


@kernel
def beckmann_lambda(v):
    """Return Lambda of Beckmann facets at v = |z|/sqrt(alpha_x^2 x^2 + alpha_y^2 y^2), to full relative accuracy.

    exp(-v^2)/(2 v sqrt(pi)) - erfc(v)/2 loses digits as v grows; the asymptotic series takes over where it has them.
    """
    if v > 26.0:
        return 0.0
    if v < 4.5:
        return 0.5 * (math.exp(-v * v) / (v * _ROOT_PI) - math.erfc(v))
    x = 0.5 / (v * v)
    term, total = x, x
    for n in range(3, 41, 2):
        if n * x >= 1.0:
            break
        term *= -n * x
        total += term
    return 0.5 * math.exp(-v * v) / (v * _ROOT_PI) * total


@kernel
def segment(ndf, alpha_x, alpha_y, x, y, z):
    """Return 1/(|z| (1 + Lambda)) and Lambda/(1 + Lambda), the chance to meet a facet on the way up.

    Both are the same for a direction and its opposite; on the way down a facet is met with certainty.
    """
    t = (alpha_x * x) ** 2 + (alpha_y * y) ** 2
    c = abs(z)
    if ndf == GGX:
        r = c + math.sqrt(c * c + t)
        return 2.0 / r, t / (r * r)
    s = math.sqrt(t)
    if c >= 26.0 * s:
        return 1.0 / c, 0.0
    v = c / s
    if v < 4.5:
        # |z| (1 + Lambda) without a division by z
        steep, tail = math.exp(-v * v) / _ROOT_PI, math.erfc(v)
        whole = 0.5 * s * (steep + v * (2.0 - tail))
        return 1.0 / whole, 0.5 * s * (steep - v * tail) / whole
    big = beckmann_lambda(v)
    return 1.0 / (c * (1.0 + big)), big / (1.0 + big)


@kernel
def facet(ndf, alpha_x, alpha_y, x, y, z):
    """Return D/4 (1/sr) of the normal along (x, y, z), the sum of two unit directions; 0 unless z > 0."""
    if z <= 0.0:
        return 0.0
    u, v = x / alpha_x, y / alpha_y
    length2 = x * x + y * y + z * z
    if ndf == GGX:
        q = length2 / (u * u + v * v + z * z)
        return 0.25 / (math.pi * alpha_x * alpha_y) * q * q
    z2 = z * z
    e = (u * u + v * v) / z2
    if e > 700.0:
        return 0.0
    q = length2 / z2
    return 0.25 / (math.pi * alpha_x * alpha_y) * q * q * math.exp(-e)
