"""Ashikhmin and Shirley's highlight and base at listed pairs of directions."""

from __future__ import annotations

import numba
import numpy as np

from brdftab.jit import parallel_kernel
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.project import arguments, project
from brdftab.models.ashikhmin_shirley.lobe import base, half_density, normal_reflectance
from brdftab.models.resolve import Setup


@parallel_kernel
def _points(theta_i, theta_o, phi, phi_i, nu, nv, kind, a, b, table, weights, matte, out):
    for n in numba.prange(theta_i.size):
        p, i_h, ci, co = half_density(nu, nv, theta_i[n], theta_o[n], phi[n], phi_i[n])
        value = 0.0
        if p > 0.0:
            value = p / (4.0 * i_h * max(ci, co))
        row = np.full((1, a.size), value)
        if value > 0.0:
            multiply(kind, a, b, table, i_h, row[0])
        project(row, weights, out[n, :1])
        matt = base(ci, co)
        for c in range(matte.size):
            out[n, 1, c] = matte[c] * matt


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

    With orders > 0 the layers are the highlight and the base. `tolerance` is unused: the formula is closed.
    """
    assert setup.fresnel is not None
    channels = len(setup.channels)
    # one reflectance may serve a base of three colours
    weights = np.ascontiguousarray(np.broadcast_to(setup.fresnel.weights, (setup.fresnel.a.size, channels)))
    matte = np.broadcast_to(setup.values["kd"], channels) * (1.0 - normal_reflectance(setup))
    out = np.empty((theta_i.size, 2, channels))
    exponents = setup.values["nu"], setup.values["nv"]
    _points(theta_i, theta_o, phi, phi_i, *exponents, *arguments(setup.fresnel, 0.0), weights, matte, out)
    return out if orders else out.sum(axis=1, keepdims=True)
