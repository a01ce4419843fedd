"""Gaussian distribution of the tilt: D = C exp(-t^2/(2 sigma^2))/cos t (Meneveaux et al. 2018, Eq. 14).

Its facets have no finite mean slope, D sin t ~ 1/cos t at t = pi/2: Smith's Lambda is infinite for every sigma, and
only the V-cavity can mask it.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.quadrature import gauss

_X, _W = (v.copy() for v in gauss(48))
# beyond this many sigma the density is below 1e-17 of its peak
FAR = 9.0


@kernel
def gaussian_norm(sigma):
    """Return 2 pi C sigma^2 with 1/C = 2 pi int_0^(pi/2) exp(-t^2/(2 sigma^2)) sin t dt; 1 as sigma goes to 0.

    sigma is in radians and positive. The tilt is taken in units of sigma and sin(t)/t kept as one factor, so that
    neither 1e-6 nor 10 loses digits; relative error below 1e-14.
    """
    high = min(FAR, 0.5 * math.pi / sigma)
    total = 0.0
    for k in range(_X.size):
        v = 0.5 * high * (1.0 + _X[k])
        t = sigma * v
        total += _W[k] * v * math.exp(-0.5 * v * v) * (math.sin(t) / t)
    return 2.0 / (high * total)


@kernel
def gaussian_density(sigma, norm, c, s):
    """Return D (1/sr) of a facet with tilt cosine c and sine s; `norm` is `gaussian_norm` of sigma (radians)."""
    if c <= 0.0:
        return 0.0
    v = math.atan2(s, c) / sigma
    return norm * math.exp(-0.5 * v * v) / (2.0 * math.pi * sigma * sigma * c)
