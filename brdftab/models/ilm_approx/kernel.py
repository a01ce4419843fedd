"""Interfaced Lambertian microfacets with an approximate body at listed pairs of directions."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import parallel_kernel
from brdftab.models.ilm_approx.approximation import body
from brdftab.models.microfacet.fresnel import reflectance
from brdftab.models.microfacet.interface import body_factor
from brdftab.models.microfacet.single import HORIZON, V_CAVITY, geometry
from brdftab.models.setup import Setup


@parallel_kernel
def _points(theta_i, theta_o, phi, masking, sigma, indices, kappa, out):
    """Fill out (N, 1 or 2, C): the total, or specular part and body."""
    for k in numba.prange(theta_i.size):
        # the lower direction first: both orders of a pair give the same number
        ti, to = max(theta_i[k], theta_o[k]), min(theta_i[k], theta_o[k])
        si, ci, so, co = math.sin(ti), math.cos(ti), math.sin(to), math.cos(to)
        above = min(ci, co) > HORIZON
        peak, i_h = 0.0, 1.0
        if above and sigma > 0.0:
            peak, i_h = geometry(masking, 0, sigma, sigma, ti, to, abs(phi[k]), 0.0)
        for c in range(indices.size):
            mirror, matte = 0.0, 0.0
            if above:
                mirror = peak * reflectance(2, indices[c], 0.0, i_h)
                matte = kappa[c] * body(sigma, indices[c], si, ci, so, co, math.cos(phi[k]))
            if out.shape[1] == 1:
                out[k, 0, c] = mirror + matte
            else:
                out[k, 0, c] = mirror
                out[k, 1, c] = matte


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

    With orders > 0 the layers are specular part and body. `tolerance` is unused: the approximation's own error, which
    docs/ilm-approx.md maps, is not a matter of nodes.
    """
    assert setup.fresnel is not None
    count = len(setup.channels)
    indices = np.ascontiguousarray(np.broadcast_to(setup.fresnel.a, count))
    kd = np.broadcast_to(setup.values["kd"], count)
    kappa = np.array([body_factor(float(k), float(n)) for k, n in zip(kd, indices, strict=True)])
    out = np.empty((theta_i.size, 2 if orders else 1, count))
    _points(theta_i, theta_o, phi, V_CAVITY, setup.alpha_x, indices, kappa, out)
    return out
