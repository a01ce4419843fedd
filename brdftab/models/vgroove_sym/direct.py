"""Symmetric V-grooves at listed pairs of directions: first order as Cook-Torrance, further ones from `bounces`."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from brdftab.directions import HORIZON, MIRROR_SINE
from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.facets.frame import groove_plane, pair
from brdftab.models._shared.facets.masking import v_cavity
from brdftab.models._shared.facets.ndf import density, shape_at
from brdftab.models._shared.facets.rough import rough_class
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.project import arguments, project
from brdftab.models.resolve import Setup, component_names
from brdftab.models.vgroove_sym.bounces import add_bounces, step_tables
from brdftab.models.vgroove_sym.rules import rule
from brdftab.quadrature import unit_gauss

NO_CAP = 2_000_000_000


@kernel
def evaluate(theta_i, theta_o, phi, phi_i, ndf, alpha_x, alpha_y, fresnel, steps, k_explicit, k_cap, gauss, row, acc):
    """Fill acc (P, W) with the BRDF (1/sr) by order and wavelength at one pair of directions."""
    acc[:] = 0.0
    si, ci, so, co, hx, hy, ox = pair(theta_i, theta_o, phi)
    if min(ci, co) <= HORIZON:
        return
    sin_h, cos_h, i_h, big_l, st, ct, su, cu = groove_plane(si, ci, so, co, hx, hy, ox)
    flat = math.hypot(hx, hy)
    cos_a, sin_a = 1.0, 0.0
    if alpha_x != alpha_y and flat > 0.0:
        cp, sp = math.cos(phi_i), math.sin(phi_i)
        cos_a, sin_a = (hx * cp - hy * sp) / flat, (hx * sp + hy * cp) / flat
    shape, amp = shape_at(ndf, alpha_x, alpha_y, cos_a, sin_a)
    kind, a, b, table = fresnel
    first = acc[0]
    value = amp * density(ndf, shape, cos_h, sin_h) * v_cavity(cos_h, ci, co, i_h) / (4.0 * ci * co)
    for w in range(first.size):
        first[w] = value
    multiply(kind, a, b, table, i_h, first)
    if k_cap < 2 or sin_h < MIRROR_SINE:
        return
    t, u = math.atan2(st, ct), math.atan2(su, cu)
    in_plane = (t, u, st, ct, su, cu) if t >= u else (u, t, su, cu, st, ct)
    prefactor = big_l / (4.0 * i_h * ci * co * sin_h)
    tangent = sin_h / (cos_h * shape)
    add_bounces(
        in_plane,
        big_l,
        ndf,
        shape,
        amp,
        tangent * tangent,
        fresnel,
        steps,
        k_explicit,
        k_cap,
        gauss,
        prefactor,
        row,
        acc,
    )


@parallel_kernel
def _points(
    theta_i, theta_o, phi, phi_i, ndf, alpha_x, alpha_y, fresnel, weights, steps, k_explicit, k_cap, gauss, out
):
    for n in numba.prange(theta_i.size):
        acc = np.empty((out.shape[1], weights.shape[0]))
        row = np.empty((2, weights.shape[0]))
        evaluate(
            theta_i[n],
            theta_o[n],
            phi[n],
            phi_i[n],
            ndf,
            alpha_x,
            alpha_y,
            fresnel,
            steps,
            k_explicit,
            k_cap,
            gauss,
            row,
            acc,
        )
        project(acc, weights, out[n])


def arrays(setup: Setup, tolerance: float) -> tuple[Any, ...]:
    """Return the kernel arguments that follow from the setup and the tolerance alone."""
    assert setup.fresnel is not None
    k_explicit, nodes = rule(tolerance, rough_class(setup))
    k_cap = NO_CAP if setup.max_bounces is None else setup.max_bounces
    return (
        setup.ndf,
        setup.alpha_x,
        setup.alpha_y,
        arguments(setup.fresnel, tolerance),
        np.ascontiguousarray(setup.fresnel.weights),
        step_tables(k_explicit),
        k_explicit,
        k_cap,
        unit_gauss(nodes),
    )


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
        0 for the total, else that many bounce orders and one layer for the rest.
    tolerance : float
        Relative error asked; below 1e-5 the sum is exact to about 1e-9, next to the mirror direction (k in the
        hundreds) to 5e-6 for GGX at alpha 1.

    Returns
    -------
    ndarray (N, P, C)
        BRDF in 1/sr.
    """
    layers = len(component_names(setup, orders)) if orders else 1
    out = np.empty((theta_i.size, layers, len(setup.channels)))
    _points(theta_i, theta_o, phi, phi_i, *arrays(setup, tolerance), out)
    return out
