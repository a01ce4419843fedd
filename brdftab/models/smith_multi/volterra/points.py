"""Values at listed pairs of directions, each pair of elevations solved on panels aligned with its own angles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from brdftab.directions import HORIZON
from brdftab.models._shared.codes import SEPARABLE
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models.resolve import Setup, component_names
from brdftab.models.smith_multi.volterra.orders import sum_pairs, to_series
from brdftab.models.smith_multi.volterra.settings import Settings
from brdftab.models.smith_multi.volterra.sources import distribution, fitted_fresnel, reached, solved_sources

# error asked of a panel of one pair over that of a table's
SINGLE = 0.1


def _groups(low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Return index lists of pairs with the same elevations: nothing else shapes their panels and modes."""
    _, place = np.unique(np.stack([low, high]), axis=1, return_inverse=True)
    order = np.argsort(place.reshape(-1), kind="stable")
    return np.split(order, np.cumsum(np.bincount(place.reshape(-1)))[:-1])


def evaluate(
    setup: Setup,
    theta_i: np.ndarray,
    theta_o: np.ndarray,
    phi: np.ndarray,
    phi_i: np.ndarray,
    orders: int,
    setting: Settings,
) -> np.ndarray:
    """Evaluate at N pairs of directions (radians).

    Parameters
    ----------
    setup : Setup
        An isotropic reflecting setup.
    theta_i, theta_o, phi, phi_i : ndarray (N,)
        Angles; at or below the horizon the BRDF is 0.
    orders : int
        0 for the total, else bounces are kept apart (`component_names`).
    setting : Settings
        Sizes of the rules.

    Returns
    -------
    ndarray (N, P, C)
        1/sr.
    """
    single = evaluate_points(setup, SEPARABLE, theta_i, theta_o, phi, phi_i)[:, 0]
    parts = len(component_names(setup, orders)) if orders else 1
    out = np.zeros((theta_i.size, parts, single.shape[1]))
    out[:, 0] = single
    above = np.flatnonzero(np.minimum(np.cos(theta_i), np.cos(theta_o)) > HORIZON)
    if setup.max_bounces == 1 or above.size == 0:
        return out
    elevation = 0.5 * math.pi - np.stack([theta_i[above], theta_o[above]])
    low, high = elevation.min(axis=0), elevation.max(axis=0)
    fitted, weights = fitted_fresnel(setup, setting)
    # the angles of a table cut its panels, one alone hardly does: 3e-3 of second bounces were left at 1e-3
    setting = replace(setting, panel=SINGLE * setting.panel)
    for group in _groups(low, high):
        source, place = np.unique(np.stack([low[group], high[group]]), return_inverse=True)
        a, b = place.reshape(2, -1)
        needed = reached(setup, setting, source)[a, b]
        listed = np.zeros((source.size, source.size))
        listed[b, a] = needed
        layers = max(0, orders - 1)
        solved, chosen = solved_sources(setup, setting, source, layers, listed, float(needed.max()), fitted)
        shape = solved.values.shape[:2]
        values = np.zeros((*shape, group.size, chosen.nodes.size))
        for s in range(chosen.nodes.size):
            size = int(solved.size[s])
            held = np.flatnonzero(b < size)
            values[:, :, held, s] = solved.values[:, :, solved.offset[s] + a[held] * size + b[held]]
        sums = np.empty((shape[0] * shape[1], group.size))
        flat = values.reshape(sums.shape[0], group.size, -1)
        azimuth = np.ascontiguousarray(phi[above[group]])
        sum_pairs(flat, to_series(chosen.chebyshev), chosen.dense, chosen.octaves, chosen.taper, needed, azimuth, sums)
        gain = distribution(setup).weight(source, setup.alpha_x)
        bounced = np.maximum(sums, 0.0).reshape(*shape, -1) * (gain[a] * gain[b])
        layer = np.einsum("lwn,wc->nlc", bounced, weights)
        if orders:
            out[above[group], 1:] = layer
        else:
            out[above[group]] += layer
    return out
