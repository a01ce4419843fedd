"""Where the twin of smith-multi solves for given data, and all geometry that no parameter enters (NumPy).

What the data's distinct angles allow is chosen here: few polar angles are solved themselves, more are interpolated from
nodes in (0, largest angle], and values at many different angles come from a fine grid by local interpolation.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.models.smith_multi.twin_rules import (
    Level,
    level,
    mode_orders,
    panel_edges,
    polar_nodes,
    pole_fit,
    refinement,
    synthesis,
)

Array = NDArray[np.float64]
HORIZON = 1e-15
# distinct angles of data up to which each has a place of its own on the grid
OWN_POLAR, OWN_AZIMUTHS = 48, 256
# polar angles that are solved themselves whatever the tolerance
FEW = 20
# azimuth from the mirror direction, radians, below which the fine grid is even
CORE = 0.1


def nodes(
    fresnel: int, max_bounces: int | None, tolerance: float, theta_i: Array, theta_o: Array, phi: Array
) -> dict[str, Any]:
    """Return the arrays that the solve and the values at the data's points need.

    Parameters
    ----------
    fresnel, max_bounces
        As in `Static`.
    tolerance : float
        Relative error asked.
    theta_i, theta_o, phi : ndarray (N,)
        The data's angles, radians; those at and below the horizon are left out.

    Returns
    -------
    dict of str to ndarray
        Its keys tell which of the roads is taken; see `_axes`, `_pairs` and `_reflectance`.
    """
    if max_bounces == 1:
        return {}
    rule = level(tolerance)
    above = np.minimum(np.cos(theta_i), np.cos(theta_o)) > HORIZON
    both = np.concatenate([theta_i[above], theta_o[above], [] if above.any() else [0.5]])
    theta: Array = np.unique(np.round(both.astype(np.float64), 12))
    azimuth: Array = np.unique(np.round(np.abs(math.pi - np.mod(phi, 2.0 * math.pi)), 12))
    few = theta.size <= max(rule.polar, FEW)
    solved = theta if few else polar_nodes(rule.polar, float(theta[-1]))
    low = max(0.5 * math.pi - float(theta[-1]), 1e-12)
    highest = max(rule.folds / (2.0 * math.asinh(rule.alpha * math.tan(low))), 16.0)
    made = _axes(rule, theta, solved, few, azimuth)
    made["synthesis"] = synthesis(rule.sampled, min(highest, 1e5), made.pop("synthesis_azimuths"))
    orders = mode_orders(rule.sampled, min(highest, 1e5))[0]
    made |= _pairs(rule, rule.few_gauss if few else rule.gauss, 0.5 * math.pi - solved, orders, fresnel)
    return made


def _axes(rule: Level, theta: Array, solved: Array, few: bool, azimuth: Array) -> dict[str, Any]:
    """Return the axes of the grid of values: own_* are the data's angles, span_* the reach of a fine grid.

    refined: matrix from solved polar angles to those of the grid (absent where they are equal).
    """
    made: dict[str, Any] = {}
    if few or theta.size <= OWN_POLAR:
        made["own_theta"] = grid = theta
    else:
        top = float(theta[-1])
        made["span_theta"] = np.array(top)
        grid = top * np.sin(0.5 * math.pi * np.arange(rule.fine) / (rule.fine - 1))
    if not few:
        made["refined"] = refinement(solved, grid)
    if azimuth.size <= OWN_AZIMUTHS:
        made["own_azimuth"] = made["synthesis_azimuths"] = azimuth
    else:
        rate = math.asinh(math.pi / CORE)
        made["span_azimuth"] = np.array(rate)
        made["synthesis_azimuths"] = CORE * np.sinh(rate * np.arange(rule.azimuths) / (rule.azimuths - 1))
    return made


def _pairs(rule: Level, p: int, elevations: Array, orders: Array, fresnel: int) -> dict[str, Any]:
    """Return the geometry of all pairs of elevations, in one flat list of L, and how to place them.

    The list holds inner nodes x inner nodes (N, N), outer x inner (n, N) and, for each inner node, nodes between it and
    the upper end of its panel (N, q): there the kernel jumps, and the light found at the panel's nodes is interpolated.

    Returns
    -------
    dict
        ds2, dz2, ss, alive (L,): squared differences of sines and cosines of elevation, product of the cosines, and
        whether the second lies above the first; decay (J, M, L): exp(-m eta_j)/S_j; orders (M,); beta, weight (N,);
        near_beta, near_weight (N, q), near_basis (q-per-node interpolation) (p, q, p); outer (n,).
    """
    x, w = np.polynomial.legendre.leggauss(p)
    ends = panel_edges(elevations, rule.widest)
    half, middle = 0.5 * np.diff(ends), 0.5 * (ends[1:] + ends[:-1])
    beta, weight = (middle[:, None] + half[:, None] * x).ravel(), (half[:, None] * w).ravel()
    span = 0.5 * (1.0 - x)
    place = x[:, None] + span[:, None] * (1.0 + x)
    near = (middle[:, None, None] + half[:, None, None] * place).reshape(-1, p)
    near_weight = (half[:, None, None] * span[:, None] * w).reshape(-1, p)
    basis = np.ones((p, p, p))
    for j in range(p):
        for k in range(p):
            if k != j:
                basis[:, :, j] *= (place - x[k]) / (x[j] - x[k])
    firsts = (beta[:, None] + 0.0 * beta, -elevations[:, None] + 0.0 * beta, beta[:, None] + 0.0 * near)
    seconds = (beta + 0.0 * beta[:, None], beta + 0.0 * elevations[:, None], near)
    a, b = (np.concatenate([part.ravel() for part in parts]) for parts in (firsts, seconds))
    up, mean = 0.5 * (b - a), 0.5 * (b + a)
    rise = np.sin(up)
    alive = rise > 0.0
    # where the second lies below the first any harmless pair will do
    dz = np.where(alive, 2.0 * rise * np.cos(mean), 1.0)
    ds = np.where(alive, 2.0 * rise * np.sin(mean), 0.0)
    ss = np.where(alive, np.cos(a) * np.cos(b), 1.0)
    made: dict[str, Any] = {
        "orders": orders,
        "outer": elevations,
        "beta": beta,
        "weight": weight,
        "near_beta": near,
        "near_weight": near_weight,
        "near_basis": basis,
        "dz2": dz * dz,
        "ds2": ds * ds,
        "ss": ss,
        "alive": alive.astype(np.float64),
    }
    if fresnel > 0:
        poles, cosines, fit = pole_fit(rule.poles)
        c = np.where(alive, 4.0 * rise * rise, 1.0) + poles[:, None]
        eta = 2.0 * np.arcsinh(0.5 * np.sqrt(c / ss))
        shut = alive / np.sqrt(c * (c + 4.0 * ss))
        made["decay"] = np.exp(-orders[:, None] * eta[:, None]) * shut[:, None]
        made |= {"poles": poles, "fit_cosines": cosines, "fit": fit}
    return made
