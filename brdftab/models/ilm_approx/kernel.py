"""Interfaced Lambertian microfacets with the approximate body, at listed pairs of directions."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import parallel_kernel
from brdftab.models._shared.codes import V_CAVITY
from brdftab.models._shared.facets.flat import mirror_reflectance
from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models._shared.fresnel.interface import body_factor
from brdftab.models._shared.single_bounce.single import geometry
from brdftab.models.ilm_approx.approximation import body
from brdftab.models.resolve import Setup

__all__ = ["mirror_reflectance", "points"]


@parallel_kernel
def _points(theta_i, theta_o, phi, sigma, indices, out):
    """Fill out (2, N, K) for K distinct indices of refraction: specular part and body integral."""
    for k in numba.prange(theta_i.size):
        ti, to, dp = theta_i[k], theta_o[k], phi[k]
        si, ci, so, co = math.sin(ti), math.cos(ti), math.sin(to), math.cos(to)
        for m in range(indices.size):
            out[0, k, m], out[1, k, m] = 0.0, 0.0
        if min(ci, co) <= HORIZON:
            continue
        value, i_h = 0.0, 0.0
        if sigma > 0.0:
            value, i_h = geometry(V_CAVITY, 0, sigma, sigma, ti, to, dp, 0.0)
        for m in range(indices.size):
            if value > 0.0:
                out[0, k, m] = value * reflectance(2, indices[m], 0.0, i_h)
            out[1, k, m] = body(sigma, indices[m], si, ci, so, co, math.cos(dp))


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
        0 for the total, else the components specular and body.
    tolerance : float
        Has no influence: the specular part is exact (that of a flat surface has no value: `mirror_reflectance`
        tells it), and the body has the approximation's own error
        (docs/ilm-approx.md), which no error estimate of a table counts. For a given error take the model ilm.

    Returns
    -------
    ndarray (N, P, C)
        BRDF in 1/sr.
    """
    assert setup.fresnel is not None
    indices, at = np.unique(setup.fresnel.a, return_inverse=True)
    out = np.empty((2, theta_i.size, indices.size))
    _points(theta_i, theta_o, phi, setup.alpha_x, indices, out)
    channels = len(setup.channels)
    column, kd = np.broadcast_to(at, channels), np.broadcast_to(setup.values["kd"], channels)
    kappa = np.array([body_factor(k, indices[c]) for k, c in zip(kd, column, strict=True)])
    layers = np.stack([out[0][:, column], kappa * out[1][:, column]], axis=1)
    return layers if orders else layers.sum(axis=1, keepdims=True)
