"""Masking and shadowing: V-cavity (Torrance-Sparrow), Smith's Lambda for each NDF, Walter's rational fit."""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import CORRELATED, GGX


@kernel
def v_cavity(cos_h, i_z, o_z, i_h):
    """Return G of the symmetric V-cavity (Cook and Torrance 1982; Lee 2018, Eqs. 2-3)."""
    return min(1.0, 2.0 * cos_h * min(i_z, o_z) / i_h)


@kernel
def smith_lambda(ndf, alpha, tangent, walter):
    """Return Smith's Lambda at a direction with that tangent of theta (Heitz 2014, Eqs. 66 and 72).

    Phong takes Beckmann's form with the same alpha (Walter et al. 2007, Sec. 5.2: alpha_b = sqrt(2/(n + 2))).
    """
    x = alpha * abs(tangent)
    if x == 0.0:
        return 0.0
    if ndf == GGX:
        x2 = x * x
        return 0.5 * x2 / (1.0 + math.sqrt(1.0 + x2))
    v = 1.0 / x
    if walter:
        if v >= 1.6:
            return 0.0
        return (1.0 - 1.259 * v + 0.396 * v * v) / (3.535 * v + 2.181 * v * v)
    if v > 26.0:
        return 0.0
    tail = math.exp(-v * v) / (2.0 * v * math.sqrt(math.pi)) - 0.5 * math.erfc(v)
    return max(tail, 0.0)


@kernel
def projected_alpha(ndf, alpha_x, alpha_y, cos_phi, sin_phi):
    """Return the roughness seen along an azimuth: sqrt(alpha_x^2 cos^2 + alpha_y^2 sin^2)."""
    if alpha_x == alpha_y:
        return alpha_x
    return math.hypot(alpha_x * cos_phi, alpha_y * sin_phi)


@kernel
def smith_g2(masking, lambda_i, lambda_o):
    """Return Smith masking-shadowing of both directions, separable or height-correlated (Heitz 2014, Eqs. 98, 99)."""
    if masking == CORRELATED:
        return 1.0 / (1.0 + lambda_i + lambda_o)
    return 1.0 / ((1.0 + lambda_i) * (1.0 + lambda_o))
