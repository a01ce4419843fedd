"""Single bounces of interfaced Lambertian microfacets: closed specular part plus body integral.

A pair is evaluated with the lower direction first, so that both orders of it give the same number. Which rule serves
the body integral, and what error it has: choice.py.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import GAUSSIAN, SEPARABLE, V_CAVITY
from brdftab.models._shared.facets.frame import pair
from brdftab.models._shared.facets.gaussian import gaussian_density, gaussian_norm
from brdftab.models._shared.facets.masking import projected_alpha, smith_lambda, v_cavity
from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models._shared.fresnel.interface import body_factor, transmission
from brdftab.models._shared.single_bounce.single import geometry
from brdftab.models.ilm.single_bounce.rule_choice import body_integral
from brdftab.models.resolve import Setup


@kernel
def masked(masking, ndf, ax, ay, si, ci, so, co, phi, phi_i):
    """Return Smith's G1 G1 of both directions, 1 with V-cavities."""
    if masking == V_CAVITY:
        return 1.0
    ai = projected_alpha(ndf, ax, ay, math.cos(phi_i), math.sin(phi_i))
    ao = projected_alpha(ndf, ax, ay, math.cos(phi_i + phi), math.sin(phi_i + phi))
    return 1.0 / ((1.0 + smith_lambda(ndf, ai, si / ci, False)) * (1.0 + smith_lambda(ndf, ao, so / co, False)))


@kernel
def front(masking, ndf, ax, ay, norm, theta_i, theta_o, phi, phi_i):
    """Return D G/(4 i_z o_z) in 1/sr and i.h of facets that are not flat."""
    if ndf != GAUSSIAN:
        return geometry(masking, ndf, ax, ay, theta_i, theta_o, phi, phi_i)
    _, ci, _, co, hx, hy, _ = pair(theta_i, theta_o, phi)
    up, flat = ci + co, math.hypot(hx, hy)
    full = math.hypot(flat, up)
    d = gaussian_density(ax, norm, up / full, flat / full)
    return d * v_cavity(up / full, ci, co, 0.5 * full) / (4.0 * ci * co), 0.5 * full


@parallel_kernel
def _specular(theta_i, theta_o, phi, phi_i, masking, ndf, ax, ay, indices, out):
    """Fill out (N, K) with the single-bounce specular part for K distinct indices of refraction."""
    norm = gaussian_norm(ax) if ndf == GAUSSIAN and ax > 0.0 else 1.0
    for k in numba.prange(theta_i.size):
        value, i_h = 0.0, 1.0
        if ax > 0.0 and min(math.cos(theta_i[k]), math.cos(theta_o[k])) > HORIZON:
            value, i_h = front(masking, ndf, ax, ay, norm, theta_i[k], theta_o[k], phi[k], phi_i[k])
        for m in range(indices.size):
            out[k, m] = value * reflectance(2, indices[m], 0.0, i_h)


def specular(setup: Setup, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
    """Return the single-bounce specular part alone (N, C) in 1/sr; angles (N,) in radians."""
    assert setup.fresnel is not None
    indices, at = np.unique(setup.fresnel.a, return_inverse=True)
    masking = V_CAVITY if setup.values["masking"] == "torrance-sparrow" else SEPARABLE
    out = np.empty((theta_i.size, indices.size))
    surface = (masking, setup.ndf, setup.alpha_x, setup.alpha_y, indices)
    _specular(theta_i, theta_o, phi, phi_i, *surface, out)
    return out[:, np.broadcast_to(at, len(setup.channels))]


@parallel_kernel
def _points(theta_i, theta_o, phi, phi_i, masking, ndf, ax, ay, indices, tolerance, out):
    """Fill out (3, N, K) for K distinct indices of refraction: specular part, body integral, its relative error."""
    norm = gaussian_norm(ax) if ndf == GAUSSIAN and ax > 0.0 else 1.0
    cavity = masking == V_CAVITY
    for k in numba.prange(theta_i.size):
        ti, to, dp, az = theta_i[k], theta_o[k], phi[k], phi_i[k]
        if to > ti:
            ti, to, dp, az = to, ti, -dp, az + dp
        for m in range(indices.size):
            for p in range(3):
                out[p, k, m] = 0.0
        si, ci, so, co = math.sin(ti), math.cos(ti), math.sin(to), math.cos(to)
        if min(ci, co) <= HORIZON:
            continue
        if ax == 0.0:
            for m in range(indices.size):
                out[1, k, m] = transmission(indices[m], ci) * transmission(indices[m], co) / math.pi
            continue
        ix, iy, ox, oy = si / ci, 0.0, so / co * math.cos(dp), so / co * abs(math.sin(dp))
        if ax != ay:
            ix, iy = si / ci * math.cos(az), si / ci * math.sin(az)
            ox, oy = so / co * math.cos(az + dp), so / co * math.sin(az + dp)
        value, i_h = front(masking, ndf, ax, ay, norm, ti, to, dp, az)
        g = masked(masking, ndf, ax, ay, si, ci, so, co, dp, az)
        for m in range(indices.size):
            n = indices[m]
            out[0, k, m] = value * reflectance(2, n, 0.0, i_h)
            body, error = body_integral(ndf, cavity, ax, ay, norm, n, ix, iy, ci, ox, oy, co, tolerance)
            out[1, k, m], out[2, k, m] = g * body, error


def parts(setup: Setup, angles: tuple[np.ndarray, ...], tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return specular part and body of single bounces, and the body's estimated relative error, (N, C) each."""
    assert setup.fresnel is not None
    indices, at = np.unique(setup.fresnel.a, return_inverse=True)
    masking = V_CAVITY if setup.values["masking"] == "torrance-sparrow" else SEPARABLE
    out = np.empty((3, angles[0].size, indices.size))
    _points(*angles, masking, setup.ndf, setup.alpha_x, setup.alpha_y, indices, tolerance, out)
    channels = len(setup.channels)
    column = np.broadcast_to(at, channels)
    kd = np.broadcast_to(setup.values["kd"], channels)
    kappa = np.array([body_factor(k, indices[c]) for k, c in zip(kd, column, strict=True)])
    return out[0][:, column], kappa * out[1][:, column], out[2][:, column]


def errors(
    setup: Setup, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray, tolerance: float
) -> np.ndarray:
    """Return the estimated relative error (N, C) of the body that `points` gives at a tolerance, rounding left out.

    A rule's measured bound, or what two successive levels differ by (choice.py); 0 for flat surfaces.
    """
    return parts(setup, (theta_i, theta_o, phi, phi_i), tolerance)[2]
