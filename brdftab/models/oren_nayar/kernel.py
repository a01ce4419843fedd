"""Oren-Nayar 1994: the full functional fit with its interreflection term, and the qualitative form."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import parallel_kernel
from brdftab.models.oren_nayar.forms import full, qualitative
from brdftab.models.resolve import Setup


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
