"""Normal distribution functions D, and the distribution P of the opposite facet of a nonsymmetric groove.

A distribution is an integer code (Beckmann 0, GGX 1, Phong 2) with one shape number at an azimuth: alpha_phi for
Beckmann and GGX, the exponent n = 2/alpha^2 - 2 for Phong.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import BECKMANN, GGX, PHONG

PI = math.pi


@kernel
def shape_at(ndf, alpha_x, alpha_y, cos_phi, sin_phi):
    """Return the shape number at an azimuth and the factor alpha_phi^2/(alpha_x alpha_y) of D there."""
    if ndf == PHONG:
        return 2.0 / (alpha_x * alpha_x) - 2.0, 1.0
    if alpha_x == alpha_y:
        return alpha_x, 1.0
    c = cos_phi / alpha_x
    s = sin_phi / alpha_y
    a2 = 1.0 / (c * c + s * s)
    return math.sqrt(a2), a2 / (alpha_x * alpha_y)


@kernel
def density(ndf, shape, c, s):
    """D (1/sr) of a facet with tilt cosine c and sine s, up to the factor of `shape_at`; int D c domega = 1."""
    if c <= 0.0:
        return 0.0
    if ndf == BECKMANN:
        t = s / (c * shape)
        e = t * t
        if e > 700.0:
            return 0.0
        c2 = c * c
        return math.exp(-e) / (PI * shape * shape * c2 * c2)
    if ndf == GGX:
        a2 = shape * shape
        d = a2 * c * c + s * s
        return a2 / (PI * d * d)
    if s < 0.5:
        return (shape + 2.0) / (2.0 * PI) * math.exp(0.5 * shape * math.log1p(-s * s))
    return (shape + 2.0) / (2.0 * PI) * math.exp(shape * math.log(c))


@kernel
def opposite_norm(ndf, shape):
    """Return the constant N of P(r) = N D(r) sin^2 r, which integrates to 1 on [0, pi/2] (Lee 2018, Eq. 20).

    The constants printed in App. C are wrong.
    """
    if ndf == BECKMANN:
        return 4.0 * math.sqrt(PI) / shape
    if ndf == GGX:
        return 4.0 / shape
    x = 0.5 * shape + 0.5
    if x > 5e3:
        # Gamma(x + 3/2)/Gamma(x) for large x, where the difference of two lgamma would lose digits
        ratio = x * math.sqrt(x) * (1.0 + (0.375 - 7.0 / (128.0 * x)) / x)
    else:
        ratio = math.exp(math.lgamma(x + 1.5) - math.lgamma(x))
    return 8.0 * math.sqrt(PI) / (shape + 2.0) * ratio
