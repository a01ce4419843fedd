"""Where the twin of smith-multi solves for given data, and all geometry that no parameter enters (NumPy).

What the data's distinct angles allow is chosen here: few polar angles are solved themselves, more are interpolated from
nodes in (0, largest angle], and values at many different angles come from a fine grid by local interpolation.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from brdftab.directions import HORIZON
from brdftab.models.smith_multi.twin.rules import (
    Level,
    level,
    mode_orders,
    panel_edges,
    polar_nodes,
    pole_fit,
    refinement,
    synthesis,
)
from brdftab.quadrature import gauss
from brdftab.typing import Array

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
        Its keys tell which of the path samplers is taken; see `_axes`, `_pairs` and `_reflectance`.
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


def _panels(rule: Level, p: int, elevations: Array) -> dict[str, Array]:
    """Return Gauss nodes of panels, and nodes between each of them and the upper end of its panel.

    There the kernel jumps; the light found at the panel's nodes is interpolated to those between.

    Returns
    -------
    dict
        beta, weight (N,): elevations and weights; near_beta, near_weight (N, p); near_basis (p, p, p): from the nodes
        of a panel (last) to those between, for each node (first).
    """
    x, w = gauss(p)
    ends = panel_edges(elevations, rule.widest)
    half, middle = 0.5 * np.diff(ends), 0.5 * (ends[1:] + ends[:-1])
    span = 0.5 * (1.0 - x)
    place = x[:, None] + span[:, None] * (1.0 + x)
    basis = np.ones((p, p, p))
    for j in range(p):
        for k in range(p):
            if k != j:
                basis[:, :, j] *= (place - x[k]) / (x[j] - x[k])
    return {
        "beta": (middle[:, None] + half[:, None] * x).ravel(),
        "weight": (half[:, None] * w).ravel(),
        "near_beta": (middle[:, None, None] + half[:, None, None] * place).reshape(-1, p),
        "near_weight": (half[:, None, None] * span[:, None] * w).reshape(-1, p),
        "near_basis": basis,
    }


def _pairs(rule: Level, p: int, elevations: Array, orders: Array, fresnel: int) -> dict[str, Any]:
    """Return the geometry of all pairs of elevations of which the second is above the first, in one list of L.

    Returns
    -------
    dict
        Besides `_panels`: ds2, dz2, ss (L,): squared differences of sines and cosines of elevation, product of the
        cosines; decay (J, M, L): exp(-m eta_j)/S_j; orders (M,); inner_at (N, N), views_at (n, N): places in the list
        of pairs of nodes in different panels, and of a view's mirror image with the nodes; L where there is none. The
        pairs of near_beta end the list.
    """
    made: dict[str, Any] = {"orders": orders, **_panels(rule, p, elevations)}
    beta, near = made["beta"], made["near_beta"]
    panel = np.arange(beta.size) // p
    inner = panel[None] > panel[:, None]
    views = beta > -elevations[:, None]
    first, second = np.nonzero(inner)
    view, node = np.nonzero(views)
    a = np.concatenate([beta[first], -elevations[view], np.repeat(beta, p)])
    b = np.concatenate([beta[second], beta[node], near.ravel()])
    for name, mask, start in (("inner_at", inner, 0), ("views_at", views, first.size)):
        at = np.full(mask.shape, a.size)
        at[mask] = start + np.arange(mask.sum())
        made[name] = at
    rise, mean = np.sin(0.5 * (b - a)), 0.5 * (b + a)
    ss = np.cos(a) * np.cos(b)
    made |= {"dz2": (2.0 * rise * np.cos(mean)) ** 2, "ds2": (2.0 * rise * np.sin(mean)) ** 2, "ss": ss}
    if fresnel > 0:
        poles, cosines, fit = pole_fit(rule.poles)
        c = 4.0 * rise * rise + poles[:, None]
        eta = 2.0 * np.arcsinh(0.5 * np.sqrt(c / ss))
        made["decay"] = np.exp(-orders[:, None] * eta[:, None]) / np.sqrt(c * (c + 4.0 * ss))[:, None]
        made |= {"poles": poles, "fit_cosines": cosines, "fit": fit}
    return made
