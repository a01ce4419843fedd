"""Single-bounce microfacet models, F D G/(4 i_z o_z), at listed pairs of directions."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import V_CAVITY, WALTER
from brdftab.models._shared.facets.frame import pair
from brdftab.models._shared.facets.masking import projected_alpha, smith_g2, smith_lambda, v_cavity
from brdftab.models._shared.facets.ndf import density, shape_at
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.project import arguments, project
from brdftab.models.resolve import Setup


@kernel
def geometry(masking, ndf, alpha_x, alpha_y, theta_i, theta_o, phi, phi_i):
    """Return D G/(4 i_z o_z) in 1/sr and i.h, zero below the horizon; `masking` is a Smith code or V_CAVITY."""
    si, ci, so, co, hx, hy, _ = pair(theta_i, theta_o, phi)
    if min(ci, co) <= HORIZON:
        return 0.0, 0.0
    up = ci + co
    flat = math.hypot(hx, hy)
    full = math.hypot(flat, up)
    i_h = 0.5 * full
    cos_a, sin_a = 1.0, 0.0
    isotropic = alpha_x == alpha_y
    if not isotropic and flat > 0.0:
        cp, sp = math.cos(phi_i), math.sin(phi_i)
        cos_a = (hx * cp - hy * sp) / flat
        sin_a = (hx * sp + hy * cp) / flat
    shape, amp = shape_at(ndf, alpha_x, alpha_y, cos_a, sin_a)
    d = amp * density(ndf, shape, up / full, flat / full)
    if masking == V_CAVITY:
        g = v_cavity(up / full, ci, co, i_h)
    else:
        alpha_i = projected_alpha(ndf, alpha_x, alpha_y, math.cos(phi_i), math.sin(phi_i))
        alpha_o = projected_alpha(ndf, alpha_x, alpha_y, math.cos(phi_i + phi), math.sin(phi_i + phi))
        walter = masking == WALTER
        g = smith_g2(masking, smith_lambda(ndf, alpha_i, si / ci, walter), smith_lambda(ndf, alpha_o, so / co, walter))
    return d * g / (4.0 * ci * co), i_h


@parallel_kernel
def _points(theta_i, theta_o, phi, phi_i, masking, ndf, alpha_x, alpha_y, kind, a, b, table, weights, out):
    for n in numba.prange(theta_i.size):
        value, i_h = geometry(masking, ndf, alpha_x, alpha_y, theta_i[n], theta_o[n], phi[n], phi_i[n])
        row = np.full((1, a.size), value)
        if value > 0.0:
            multiply(kind, a, b, table, i_h, row[0])
        project(row, weights, out[n])


def evaluate_points(
    setup: Setup, masking: int, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray
) -> np.ndarray:
    """Evaluate a single-bounce model at N pairs of directions (radians); returns (N, 1, C) in 1/sr, exact."""
    assert setup.fresnel is not None
    fresnel = arguments(setup.fresnel, 0.0)
    out = np.empty((theta_i.size, 1, len(setup.channels)))
    ndf, ax, ay = setup.ndf, setup.alpha_x, setup.alpha_y
    _points(theta_i, theta_o, phi, phi_i, masking, ndf, ax, ay, *fresnel, setup.fresnel.weights, out)
    return out
