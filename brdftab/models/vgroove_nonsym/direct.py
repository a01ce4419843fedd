"""Nonsymmetric V-grooves at listed pairs of directions: closed first order, all further orders by quadrature."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from brdftab.directions import HORIZON, MIRROR_SINE
from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.codes import BECKMANN, PHONG
from brdftab.models._shared.facets.frame import groove_plane, pair
from brdftab.models._shared.facets.ndf import density, shape_at
from brdftab.models._shared.facets.rough import rough_class
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.logfresnel import fit
from brdftab.models._shared.fresnel.project import arguments, project
from brdftab.models.resolve import Setup, component_names
from brdftab.models.vgroove_nonsym.bounces import NODES, add_bounces
from brdftab.models.vgroove_nonsym.first_order import mean_masking
from brdftab.models.vgroove_nonsym.panels import BROAD, CUTS
from brdftab.models.vgroove_nonsym.rules import rule, steep_orders
from brdftab.quadrature import unit_gauss, unit_jacobi

NO_CAP = 2_000_000_000


# orders whose peak lies this many e-folds below the first order's cannot change a float64 sum
DEPTH = 45.0

SERIES_REACH = 1e-5

# from this order on two tilts stand for all, which costs up to 3e-4 where a metal absorbs (order 4: 2.4e-3)
PAIRED, PAIRED_REACH = 7.0, 5e-4


@kernel
def first_order(ndf, shape, amp, plane, ci, co, gauss):
    """Return D Gbar/(4 i_z o_z) and the in-plane angles and their sines and cosines, larger first."""
    sin_h, cos_h, i_h, big_l, st, ct, su, cu = plane
    t, u = math.atan2(st, ct), math.atan2(su, cu)
    if u > t:
        t, u, st, ct = u, t, su, cu
    g = mean_masking(ndf, shape, sin_h, i_h / big_l, st, ct, gauss)
    return amp * density(ndf, shape, cos_h, sin_h) * g / (4.0 * ci * co), t, u


@kernel
def evaluate(theta_i, theta_o, phi, phi_i, ndf, alpha_x, alpha_y, fresnel, series, sums, work, acc):
    """Fill acc with the BRDF (1/sr) by order and wavelength at one pair of directions and return it as (P, W).

    acc is (P, 1, W), or (P, W, 1) when the products of reflectances come from the series of log F.
    """
    acc[:] = 0.0
    size = work[2].shape[1]
    flat_acc = acc.reshape((acc.shape[0], size))
    si, ci, so, co, hx, hy, ox = pair(theta_i, theta_o, phi)
    if min(ci, co) <= HORIZON:
        return flat_acc
    plane = groove_plane(si, ci, so, co, hx, hy, ox)
    sin_h, cos_h, i_h, big_l = plane[0], plane[1], plane[2], plane[3]
    flat = math.hypot(hx, hy)
    cos_a, sin_a = 1.0, 0.0
    if alpha_x != alpha_y and flat > 0.0:
        cp, sp = math.cos(phi_i), math.sin(phi_i)
        cos_a, sin_a = (hx * cp - hy * sp) / flat, (hx * sp + hy * cp) / flat
    shape, amp = shape_at(ndf, alpha_x, alpha_y, cos_a, sin_a)
    k_exact, k_single, k_cap, tail, gauss, wall_gauss, fine, masking_gauss, pair_from = sums
    value, big_m, small_m = first_order(ndf, shape, amp, plane, ci, co, masking_gauss)
    kind, a, b, table = fresnel
    if k_cap >= 2 and sin_h >= MIRROR_SINE:
        depth = DEPTH
        if ndf == BECKMANN:
            tangent = sin_h / (cos_h * shape)
            depth += tangent * tangent
        elif ndf == PHONG:
            depth -= shape * math.log(cos_h)
        rule = (gauss, wall_gauss, fine, depth, pair_from)
        k_explicit = (k_exact, k_single)
        powers = series[1]
        power = 1.0
        for p in range(powers.shape[0]):
            power *= big_l
            powers[p, 0] = power
        add_bounces(big_m, small_m, ndf, shape, 0.0, k_explicit, k_cap, tail, rule, fresnel, big_l, series, work, acc)
        front = amp * big_l / (4.0 * i_h * ci * co * sin_h)
        for p in range(acc.shape[0]):
            for w in range(size):
                flat_acc[p, w] *= front
    first = work[2][0]
    for w in range(first.size):
        first[w] = value
    multiply(kind, a, b, table, i_h, first)
    for w in range(first.size):
        flat_acc[0, w] += first[w]
    return flat_acc


@parallel_kernel
def _points(theta_i, theta_o, phi, phi_i, ndf, alpha_x, alpha_y, fresnel, weights, coefficients, sums, out):
    for n in numba.prange(theta_i.size):
        size = weights.shape[0]
        degree = coefficients.shape[1]
        acc = np.empty((out.shape[1], size, 1) if degree else (out.shape[1], 1, size))
        work = (np.empty(CUTS), np.empty(CUTS), np.empty((2, size)), np.empty((NODES if degree else 1, 2)))
        series = (coefficients, np.empty((degree, 1)), np.empty(degree), np.empty((size, 1)))
        by_order = evaluate(
            theta_i[n], theta_o[n], phi[n], phi_i[n], ndf, alpha_x, alpha_y, fresnel, series, sums, work, acc
        )
        project(by_order, weights, out[n])


def arrays(setup: Setup, tolerance: float) -> tuple[Any, ...]:
    """Return the kernel arguments that follow from the setup and the tolerance alone."""
    assert setup.fresnel is not None
    k_explicit, tail, nodes, fine = rule(tolerance, rough_class(setup))
    k_cap = NO_CAP if setup.max_bounces is None else setup.max_bounces
    singles = k_explicit
    if setup.ndf == PHONG and setup.alpha_x > 1.0:
        singles = max(k_explicit, steep_orders(phong_exponent(setup), tolerance))
    sums = (
        k_explicit,
        singles,
        k_cap,
        unit_gauss(tail),
        unit_gauss(nodes),
        wall_gauss(setup, nodes),
        fine,
        unit_gauss(20),
        PAIRED if tolerance >= PAIRED_REACH else math.inf,
    )
    weights = np.ascontiguousarray(setup.fresnel.weights)
    coefficients = None
    if setup.fresnel.kind != MIRROR and tolerance >= 0.999 * SERIES_REACH:
        coefficients = fit(setup.fresnel, 0.02 * tolerance)
    if coefficients is None:
        coefficients = np.empty((weights.shape[0], 0))
    return setup.ndf, setup.alpha_x, setup.alpha_y, arguments(setup.fresnel, tolerance), weights, coefficients, sums


def wall_gauss(setup: Setup, nodes: int) -> np.ndarray:
    """Return nodes and weights (2, nodes) of panels that end at a vertical facet, where Phong's D ~ cos^n."""
    if setup.ndf != PHONG:
        return unit_gauss(nodes)
    return unit_jacobi(nodes, min(phong_exponent(setup), BROAD))


def phong_exponent(setup: Setup) -> float:
    """Return the exponent n of D ~ cos^n."""
    return 2.0 / (setup.alpha_x * setup.alpha_x) - 2.0


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
    """Evaluate at N pairs of directions by direct quadrature.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    theta_i, theta_o, phi, phi_i : ndarray (N,)
        Radians.
    orders : int
        0 for the total, else that many bounce orders and one layer for the rest.
    tolerance : float
        Relative error asked; it chooses nodes a panel, explicit orders and cuts.

    Returns
    -------
    ndarray (N, P, C)
        BRDF in 1/sr.
    """
    layers = len(component_names(setup, orders)) if orders else 1
    out = np.empty((theta_i.size, layers, len(setup.channels)))
    _points(theta_i, theta_o, phi, phi_i, *arrays(setup, tolerance), out)
    return out
