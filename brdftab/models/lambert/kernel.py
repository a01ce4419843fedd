"""Lambert: f = kd/pi above the horizon."""

from __future__ import annotations

import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel
from brdftab.models.resolve import Setup


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
    """Evaluate at N pairs of directions.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    theta_i, theta_o, phi, phi_i : ndarray (N,)
        Radians.
    orders : int
        0 for the total, else the components.
    tolerance : float
        Unused: the formula is exact.

    Returns
    -------
    ndarray (N, 1, C)
        BRDF in 1/sr.
    """
    out = np.empty((theta_i.size, 1, len(setup.channels)))
    _points(theta_i, theta_o, setup.values["kd"], out)
    return out


@kernel
def _points(theta_i, theta_o, kd, out):
    for n in range(theta_i.size):
        up = min(np.cos(theta_i[n]), np.cos(theta_o[n]))
        for c in range(kd.size):
            out[n, 0, c] = kd[c] / np.pi if up > HORIZON else 0.0
