"""The anisotropic Phong lobe: half-vector density and values."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.facets.frame import pair
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.project import arguments
from brdftab.models.resolve import Setup

PI = math.pi


@kernel
def half_density(nu, nv, theta_i, theta_o, phi, phi_i):
    """Return the density p(h) of the half vector in 1/sr, i.h, i_z and o_z; all 0 at and below the horizon.

    Eq. 4 without F, i.h and the cosines; p integrates to 1 over the hemisphere of h.
    """
    _, ci, _, co, hx, hy, _ = pair(theta_i, theta_o, phi)
    if min(ci, co) <= HORIZON:
        return 0.0, 0.0, 0.0, 0.0
    up = ci + co
    flat = math.hypot(hx, hy)
    full = math.hypot(flat, up)
    c, s = up / full, flat / full
    exponent = nu
    if flat > 0.0:
        cp, sp = math.cos(phi_i), math.sin(phi_i)
        along, across = (hx * cp - hy * sp) / flat, (hx * sp + hy * cp) / flat
        exponent = nu * along * along + nv * across * across
    # near the normal the sine keeps the digits that the cosine has lost
    log = 0.5 * math.log1p(-s * s) if s < 0.5 else math.log(c)
    return math.sqrt((nu + 1.0) * (nv + 1.0)) / (2.0 * PI) * math.exp(exponent * log), 0.5 * full, ci, co


@kernel
def base(ci, co):
    """Return the base (1/sr) for kd = 1 and F = 0 (Eq. 5): its albedo is 1 - (1 - i_z/2)^5."""
    return 28.0 / (23.0 * PI) * (1.0 - (1.0 - 0.5 * ci) ** 5) * (1.0 - (1.0 - 0.5 * co) ** 5)


@parallel_kernel
def _densities(theta_i, theta_o, phi, phi_i, nu, nv, out):
    for n in numba.prange(theta_i.size):
        p, i_h, _, _ = half_density(nu, nv, theta_i[n], theta_o[n], phi[n], phi_i[n])
        out[n] = p / (4.0 * i_h) if p > 0.0 else 0.0


def normal_reflectance(setup: Setup) -> np.ndarray:
    """Return F at normal incidence (C,)."""
    assert setup.fresnel is not None
    fresnel = arguments(setup.fresnel, 0.0)
    row = np.ones(setup.fresnel.a.size)
    multiply(*fresnel, 1.0, row)
    return np.broadcast_to(row @ setup.fresnel.weights, len(setup.channels))


def densities(setup: Setup, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
    """Return p(h)/(4 i.h) (N,), the density of mirrored directions in 1/sr; arguments as in `points`."""
    out = np.empty(theta_i.size)
    _densities(theta_i, theta_o, phi, phi_i, setup.values["nu"], setup.values["nv"], out)
    return out
