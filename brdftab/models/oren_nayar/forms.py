"""The full and the qualitative form."""

from __future__ import annotations

import math

from brdftab.jit import kernel

PI = math.pi


@kernel
def full(kd, sigma, theta_i, theta_o, phi):
    """Return the direct part and the interreflection (1/sr) of the full fit (Oren and Nayar 1994, Eqs. 27-29)."""
    s2 = sigma * sigma
    alpha = max(theta_i, theta_o)
    beta = min(theta_i, theta_o)
    cos_phi = math.cos(phi)
    share = 2.0 * beta / PI
    c1 = 1.0 - 0.5 * s2 / (s2 + 0.33)
    angular = math.sin(alpha)
    if cos_phi < 0.0:
        angular -= share * share * share
    c2 = 0.45 * s2 / (s2 + 0.09) * angular
    both = 4.0 * alpha * beta / (PI * PI)
    c3 = 0.125 * s2 / (s2 + 0.09) * both * both
    direct = c1 + cos_phi * c2 * math.tan(beta) + (1.0 - abs(cos_phi)) * c3 * math.tan(0.5 * (alpha + beta))
    inter = 0.17 * kd * kd / PI * s2 / (s2 + 0.13) * (1.0 - cos_phi * share * share)
    # the fit leaves its range at grazing mirror directions of very rough surfaces
    return max(kd / PI * direct, 0.0), max(inter, 0.0)


@kernel
def qualitative(kd, sigma, theta_i, theta_o, phi):
    """Return the qualitative form (1/sr; Oren and Nayar 1994, Eq. 30)."""
    s2 = sigma * sigma
    alpha = max(theta_i, theta_o)
    beta = min(theta_i, theta_o)
    a = 1.0 - 0.5 * s2 / (s2 + 0.33)
    b = 0.45 * s2 / (s2 + 0.09)
    return kd / PI * (a + b * max(math.cos(phi), 0.0) * math.sin(alpha) * math.tan(beta))
