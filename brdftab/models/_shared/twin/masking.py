"""Masking and shadowing in JAX: V-cavity, Smith's Lambda for each NDF, Walter's rational fit."""

from __future__ import annotations

import math

import jax.numpy as jnp
from jax.scipy.special import erfc

from brdftab.models._shared.codes import GGX

SEPARABLE, CORRELATED, WALTER = 0, 1, 2
MASKINGS = {"separable": SEPARABLE, "height-correlated": CORRELATED, "smith-walter": WALTER}
# 1/x beyond which Lambda is 0: of Walter's fit, and where the exact one is below float64
FIT_END, EXACT_END = 1.6, 26.0


def v_cavity(cos_h, i_z, o_z, i_h):
    """Return G of the symmetric V-cavity (Cook and Torrance 1982; Lee 2018, Eqs. 2-3)."""
    return jnp.minimum(1.0, 2.0 * cos_h * jnp.minimum(i_z, o_z) / i_h)


def smith_lambda(ndf, alpha, tangent, walter):
    """Return Smith's Lambda at a direction with that tangent of theta (Heitz 2014, Eqs. 66 and 72).

    Parameters
    ----------
    ndf : int
        Static code; Phong takes Beckmann's form with the same alpha (Walter et al. 2007, Sec. 5.2).
    alpha : Array
        Roughness along the direction's azimuth, > 0.
    tangent : Array (N,)
        0 at normal incidence, where Lambda and all its derivatives are 0.
    walter : bool
        Static; take the rational fit instead of the exact form (not for GGX).
    """
    x = alpha * jnp.abs(tangent)
    if ndf == GGX:
        x2 = x * x
        return 0.5 * x2 / (1.0 + jnp.sqrt(1.0 + x2))
    end = FIT_END if walter else EXACT_END
    # a hair above 0 keeps 1/x finite
    live = x * end > 1.0 if walter else x * end >= 1.0
    v = 1.0 / jnp.where(live, x, 1.0)
    if walter:
        return jnp.where(live, (1.0 - 1.259 * v + 0.396 * v * v) / (3.535 * v + 2.181 * v * v), 0.0)
    tail = jnp.exp(-v * v) / (2.0 * v * math.sqrt(math.pi)) - 0.5 * erfc(v)
    return jnp.where(live & (tail > 0.0), tail, 0.0)


def projected_alpha(isotropic, alpha_x, alpha_y, cos_phi, sin_phi):
    """Return the roughness seen along an azimuth: sqrt(alpha_x^2 cos^2 + alpha_y^2 sin^2); `isotropic` is static."""
    if isotropic:
        return alpha_x
    x, y = alpha_x * cos_phi, alpha_y * sin_phi
    return jnp.sqrt(x * x + y * y)


def smith_g2(masking, lambda_i, lambda_o):
    """Return Smith masking-shadowing of both directions, separable or height-correlated (Heitz 2014, Eqs. 98, 99)."""
    if masking == CORRELATED:
        return 1.0 / (1.0 + lambda_i + lambda_o)
    return 1.0 / ((1.0 + lambda_i) * (1.0 + lambda_o))
