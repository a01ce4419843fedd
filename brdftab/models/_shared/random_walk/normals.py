"""Drawing the normals that a direction sees, from above or below: D (w.m)+ over their projected area.

GGX: the spherical caps of Dupuy and Benyoub (2023) hold on the full sphere. Beckmann: in slopes (Heitz, d'Eon 2014),
the one across is Gaussian, the one along follows from its distribution function.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import GGX
from brdftab.models._shared.sampling.sampling import visible_slope

_ROOT_PI = math.sqrt(math.pi)
# a direction this steep from below meets no facet: exp(-400)
_STEEPEST = 20.0


@kernel
def slope_from_below(a, uniform):
    """Return u >= a drawn with the density (u - a) exp(-u^2), up to its norm; a in [0, 20], `uniform` in (0, 1).

    The share above u is S(u) = exp(-u^2)/2 - a sqrt(pi)/2 erfc(u); solved for u by Newton's method inside a bracket.
    """
    half = 0.5 * a * _ROOT_PI
    target = uniform * (0.5 * math.exp(-a * a) - half * math.erfc(a))
    low, high = a, a + 6.5
    u = a + 0.7 / (1.0 + a)
    for _ in range(60):
        e = math.exp(-u * u)
        gap = 0.5 * e - half * math.erfc(u) - target
        if gap > 0.0:
            low = u
        else:
            high = u
        slope = (u - a) * e
        step = u + gap / slope if slope > 0.0 else high
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - u) <= 1e-9 * (1.0 + u):
            return step
        u = step
    return u


@kernel
def turn(u):
    """Return cosine and sine of 2 pi u for u in [0, 1], to some 1e-15: Taylor series within an eighth of a turn."""
    quarter = math.floor(4.0 * u + 0.5)
    r = 0.5 * math.pi * (4.0 * u - quarter)
    x = r * r
    s = r * (1 - x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110 * (1 - x / 156 * (1 - x / 210)))))))
    c = 1 - x / 2 * (1 - x / 12 * (1 - x / 30 * (1 - x / 56 * (1 - x / 90 * (1 - x / 132 * (1 - x / 182))))))
    if quarter == 1.0:
        return -s, c
    if quarter == 2.0:
        return -c, -s
    if quarter == 3.0:
        return s, -c
    return c, s


@kernel
def visible_normal(ndf, alpha_x, alpha_y, x, y, z, a, b, c):
    """Return a unit normal drawn as the direction (x, y, z) sees them.

    Parameters
    ----------
    ndf : int
        0 Beckmann, 1 GGX.
    alpha_x, alpha_y : float
        Roughness.
    x, y, z : float
        Unit vector away from the facet, z of either sign.
    a, b, c : float
        Uniforms in (0, 1); GGX takes the first two.
    """
    sx, sy = alpha_x * x, alpha_y * y
    flat2 = sx * sx + sy * sy
    if ndf == GGX:
        n = 1.0 / math.sqrt(flat2 + z * z)
        sx, sy, sz = sx * n, sy * n, z * n
        # 1 + sz without cancellation
        cap = 1.0 + sz if sz >= 0.0 else flat2 * n * n / (1.0 - sz)
        up = a * cap
        cz = up - sz
        st = math.sqrt(max(0.0, (1.0 - cz) * (1.0 + cz)))
        cb, sb = turn(b)
        mx, my, mz = alpha_x * (st * cb + sx), alpha_y * (st * sb + sy), up
    else:
        flat = math.sqrt(flat2)
        across = math.sqrt(-math.log(b)) * turn(c)[0]
        cx, cy = (sx / flat, sy / flat) if flat > 0.0 else (1.0, 0.0)
        if z >= 0.0:
            along = visible_slope(z / flat if flat > 0.0 else math.inf, a)
        else:
            along = slope_from_below(min(-z / max(flat, 1e-300), _STEEPEST), a)
        mx, my, mz = alpha_x * (cx * along - cy * across), alpha_y * (cy * along + cx * across), 1.0
    n = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
    return mx * n, my * n, mz * n
