"""Oren-Nayar 1994: the full functional fit with its interreflection term, and the qualitative form."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models.resolve import Setup

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


@parallel_kernel
def _points(theta_i, theta_o, phi, kd, sigma, is_full, out):
    for n in numba.prange(theta_i.size):
        above = min(math.cos(theta_i[n]), math.cos(theta_o[n])) > HORIZON
        for c in range(kd.size):
            direct, inter = 0.0, 0.0
            if above and is_full:
                direct, inter = full(kd[c], sigma, theta_i[n], theta_o[n], phi[n])
            elif above:
                direct = qualitative(kd[c], sigma, theta_i[n], theta_o[n], phi[n])
            if out.shape[1] == 1:
                out[n, 0, c] = direct + inter
            else:
                out[n, 0, c] = direct
                out[n, 1, c] = inter


def points(
    setup: Setup,
    theta_i: np.ndarray,
    theta_o: np.ndarray,
    phi: np.ndarray,
    phi_i: np.ndarray,
    *,
    orders: int,
    tolerance: float,
) -> np.ndarray:
    """Evaluate at N pairs of directions (radians); returns (N, 1 or 2, C) in 1/sr.

    With orders > 0 the layers are the direct part and the interreflection. `tolerance` is unused: the fit is closed.
    """
    out = np.empty((theta_i.size, 2 if orders else 1, len(setup.channels)))
    is_full = setup.values["variant"] == "full"
    _points(theta_i, theta_o, phi, setup.values["kd"], setup.values["sigma"], is_full, out)
    return out
