"""Directional albedo of all bounces from the mean over azimuth alone.

Let e(beta) be the share of the light in direction beta that leaves after one or more further bounces, times |d_z| (1 +
Lambda): e = K_0 w (mu + e), mu the positive part of d_z. The albedo at elevation b is w(-b) e(-b).
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.directions import HORIZON
from brdftab.models.resolve import Setup
from brdftab.models.smith_multi.volterra.panels import rule, smoothness
from brdftab.models.smith_multi.volterra.settings import settings
from brdftab.models.smith_multi.volterra.sources import LOWEST, distribution, fitted_fresnel
from brdftab.quadrature import gauss, lagrange

ZERO = np.zeros(1)
# terms of the Neumann series end here
MOST_BOUNCES = 2000


def albedo(setup: Setup, theta_i: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the directional albedo of all bounces (or of the first `max_bounces`).

    Parameters
    ----------
    setup : Setup
        An isotropic reflecting setup.
    theta_i : ndarray (N,)
        Polar angles, radians; 0 at and below the horizon.
    tolerance : float
        Relative error asked.

    Returns
    -------
    ndarray (N, C)
        int f cos(theta_o) domega_o in each channel.
    """
    setting = settings(setup.ndf, 0.01 * tolerance)
    ndf, alpha = distribution(setup), setup.alpha_x
    fitted, weights = fitted_fresnel(setup, setting)
    waves = fitted.constant.size

    def weight(beta: np.ndarray) -> np.ndarray:
        return np.asarray(ndf.weight(beta, alpha))

    edges = np.array([-0.5, 0.0, 0.5]) * math.pi
    beta, measure, first, ends, start, stop, share = rule(edges, smoothness(setup.ndf, alpha), setting, weight)
    kernel = np.empty((waves, 1, beta.size, beta.size))
    ndf.modes(beta, beta, ZERO, alpha, fitted, kernel)
    within = np.empty((waves, 1, start.size))
    ndf.pairs(start, stop, ZERO, alpha, fitted, within)
    inside = kernel[:, 0] * measure
    inner = np.append(np.searchsorted(start, beta), start.size)
    for p in range(first.size - 1):
        low, high = first[p], first[p + 1]
        for j in range(low, high):
            pairs = slice(inner[j], inner[j + 1])
            inside[:, j, low:high] = within[:, 0, pairs] @ share[pairs, : high - low]
    total = _emerging(inside, np.maximum(np.sin(beta), 0.0), setup.max_bounces or MOST_BOUNCES)
    out = np.zeros((theta_i.size, weights.shape[1]))
    above = np.flatnonzero(np.cos(theta_i) > HORIZON)
    source = -np.maximum(0.5 * math.pi - theta_i[above], LOWEST)
    place = np.clip(np.searchsorted(ends, source, side="right") - 1, 0, first.size - 2)
    direct = np.empty((waves, 1, source.size, beta.size))
    ndf.modes(source, beta, ZERO, alpha, fitted, direct)
    for n, (b, p) in enumerate(zip(source, place, strict=True)):
        low, high = first[p], first[p + 1]
        found = np.einsum("wk,wk->w", direct[:, 0, n, high:], measure[high:] * total[:, high:])
        # the rest of the source's own panel
        x, v = gauss(high - low + 2)
        half = 0.5 * (ends[p + 1] - b)
        points = b + half * (1.0 + x)
        near = np.empty((waves, 1, points.size))
        ndf.pairs(np.full(points.size, b), points, ZERO, alpha, fitted, near)
        size = half * v * 2.0 * math.pi * weight(points) * np.cos(points)
        found += np.einsum("wk,wk->w", near[:, 0] * size, total[:, low:high] @ lagrange(beta[low:high], points).T)
        out[above[n]] = (found * weight(source[n : n + 1])) @ weights
    return out


def _emerging(inside: np.ndarray, escape: np.ndarray, bounces: int) -> np.ndarray:
    """Return (W, N): what leaves from the nodes at once or after up to bounces - 1 more bounces."""
    term = np.broadcast_to(escape, inside.shape[:2])
    total = term
    for _ in range(bounces - 1):
        term = np.einsum("wjk,wk->wj", inside, term)
        total = total + term
        if np.abs(term).max() < 1e-17:
            break
    return total
