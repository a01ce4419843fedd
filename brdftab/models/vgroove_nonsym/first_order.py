"""First order of the nonsymmetric groove in closed form: the mean masking by an independent opposite facet."""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import BECKMANN, GGX
from brdftab.models._shared.facets.ndf import opposite_norm

PI = math.pi
ROOT_PI = math.sqrt(PI)


@kernel
def masked_share(ndf, shape, sin_m, cos_m, gauss):
    """Return E = int P(r) max(0, sin M - cos M cot r) dr, the hidden share of a unit facet at the in-plane angle M.

    Closed for Beckmann and GGX. Phong: with sin x = sin M exp(-u/(n+1)) it is an exponential integral of a smooth
    function, done by Gauss panels whose first is as short as the layer u ~ n + 1.
    """
    if sin_m <= 0.0:
        return 0.0
    t = cos_m / sin_m
    x = t / shape
    if ndf == BECKMANN:
        if x > 27.0:
            return 0.0
        g = math.exp(-x * x)
        return sin_m * (math.erfc(x) + 2.0 * x * g / ROOT_PI) - cos_m * 2.0 * g / (ROOT_PI * shape)
    if ndf == GGX:
        # the angle left of pi/2 keeps its digits for large x
        rest = math.atan2(shape, t)
        sc = x / (1.0 + x * x)
        return sin_m * (2.0 / PI) * (rest + sc) - cos_m * 2.0 * shape / (PI * (shape * shape + t * t))
    n1 = shape + 1.0
    front = opposite_norm(2, shape) * (shape + 2.0) / (2.0 * PI) * math.exp(n1 * math.log(sin_m)) / n1
    # u = v^2 takes away the square root of cos x at M -> pi/2
    gap = cos_m * cos_m / (1.0 + sin_m)
    left, width, total = 0.0, min(0.5, math.sqrt(n1)), 0.0
    while left < 6.8:
        for q in range(gauss.shape[1]):
            v = left + width * gauss[0, q]
            u = v * v
            below = gap - sin_m * math.expm1(-u / n1)
            sx = 1.0 - below
            cx = math.sqrt(below * (1.0 + sx))
            total += width * gauss[1, q] * 2.0 * v * math.exp(-u) * (sin_m * cx - cos_m * sx)
        left += width
        width = min(2.0 * width, 1.0)
    return front * total


@kernel
def mean_masking(ndf, shape, sin_h, cos_d, sin_m, cos_m, gauss):
    """Return Gbar of the first order; M is the larger in-plane angle, cos_d = cos((theta_i - theta_o)/2)."""
    return max(1.0 - sin_h / cos_d * masked_share(ndf, shape, sin_m, cos_m, gauss), 0.0)
