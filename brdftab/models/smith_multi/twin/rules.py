"""How finely the twin of smith-multi solves at a tolerance: polar nodes, azimuth modes, poles of the reflectance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from brdftab.typing import Array

# modes solved at whole orders; the others are sampled at real orders, spread in log(m + SHIFT)
WHOLE = 8
SHIFT = 3.0
POLE_SAMPLES = 400
# beyond this many terms a truncated sum of bounces is the whole one: a bounce keeps less than 0.7 of the light
LAST_TERM = 64


@dataclass(frozen=True)
class Level:
    """Numbers of nodes.

    Attributes
    ----------
    tolerance : float
        Relative error asked; the level serves this and coarser ones.
    polar : int
        Polar angles at which the light between facets is solved where the data have more.
    gauss : int
        Gauss nodes a panel of elevations.
    few_gauss : int
        The same where the data's own polar angles are solved, whose panels are narrow.
    sampled : int
        Azimuth modes sampled at real orders.
    folds, alpha : float
        The highest mode is that which has decayed by exp(-folds) at this roughness and the lowest elevation.
    poles : tuple of (int, float, float)
        How many, and the decades that they span in X = 4 cos^2.
    fine : int
        Polar angles of the grid on which local interpolation works.
    azimuths : int
        Azimuths of that grid.
    widest : float
        Widest panel of elevations, radians.
    """

    tolerance: float
    polar: int
    gauss: int
    few_gauss: int
    sampled: int
    folds: float
    alpha: float
    poles: tuple[int, float, float]
    fine: int
    azimuths: int
    widest: float


# relative error (rms, largest) at 300 random pairs up to 75 degrees, alpha 0.6 and eta + ik = 3 + 0.5i, against the
# compiled solver: 1.7e-6, 5e-6 of the coarsest, from 1e-4 on 4e-7, 2e-6, where the pole fits differ; at alpha 0.2 3e-5,
# 2e-4 and 2e-7, 1e-6, at alpha 0.1 2e-4, 1e-3 and 1e-5, 6e-5
LEVELS = (
    Level(1e-2, 10, 3, 2, 14, 9.0, 0.2, (8, -3.0, 1.0), 36, 48, 0.4),
    Level(1e-3, 12, 3, 2, 18, 11.0, 0.1, (10, -3.5, 1.5), 36, 48, 0.4),
    Level(1e-4, 16, 3, 3, 22, 13.0, 0.1, (12, -4.0, 2.0), 48, 64, 0.3),
    Level(1e-6, 24, 3, 3, 28, 16.0, 0.05, (12, -4.0, 2.0), 64, 96, 0.2),
    Level(0.0, 32, 4, 4, 40, 20.0, 0.05, (16, -5.0, 2.0), 96, 160, 0.2),
)


def level(tolerance: float) -> Level:
    """Return the coarsest level that serves a tolerance."""
    return next(found for found in LEVELS if tolerance >= found.tolerance)


def chebyshev(count: int) -> tuple[Array, Array]:
    """Return Chebyshev's points of the first kind on (-1, 1), ascending, and their barycentric weights, (count,)."""
    angle = (2.0 * np.arange(count) + 1.0) * (0.5 * math.pi / count)
    return np.cos(angle)[::-1], ((-1.0) ** np.arange(count) * np.sin(angle))[::-1]


def mode_orders(sampled: int, highest: float) -> tuple[Array, Array, Array]:
    """Return the real orders of the modes that are solved, and abscissas and weights of the sampled ones.

    A mode is analytic in its order (exp(-m eta) times polynomials), so that few orders give all up to `highest`.
    """
    x, w = chebyshev(sampled)
    low, high = math.log(WHOLE - 0.5 + SHIFT), math.log(highest + SHIFT)
    u = 0.5 * (low + high) + 0.5 * (high - low) * x
    return np.concatenate([np.arange(WHOLE, dtype=np.float64), np.exp(u) - SHIFT]), u, w


def synthesis(sampled: int, highest: float, azimuth: Array) -> Array:
    """Return the matrix (modes, F) from solved modes to values at azimuths from the mirror direction (F,), radians.

    It holds the interpolation between orders and the cosine series, whose far end is filtered: where the roughness is
    so small that higher modes count, the series would ring.
    """
    _, u, w = mode_orders(sampled, highest)
    whole = np.arange(WHOLE)
    made = np.zeros((WHOLE + sampled, azimuth.size))
    made[:WHOLE] = np.where(whole == 0, 1.0, 2.0)[:, None] * np.cos(whole[:, None] * azimuth)
    last = math.floor(highest)
    for at in range(WHOLE, last + 1, 4096):
        m = np.arange(at, min(at + 4096, last + 1))
        apart = np.log(m + SHIFT)[:, None] - u
        apart[apart == 0.0] = 1e-300
        share = w / apart
        share *= (2.0 * np.exp(-36.0 * (m / highest) ** 8) / share.sum(axis=1))[:, None]
        made[WHOLE:] += share.T @ np.cos(m[:, None] * azimuth)
    return made


@lru_cache
def pole_fit(poles: tuple[int, float, float]) -> tuple[Array, Array, Array]:
    """Return poles x_j (J,), cosines (S,), and the matrix (1 + J, S) from F there to c_0 and c_j.

    F(X) = c_0 + sum_j c_j/(X + x_j) in X = 4 cos^2 keeps the azimuth integral of the kernel closed. F has a root in X
    at grazing incidence, which poles in geometric sequence follow; what is left there carries no light (weight X).
    """
    count, low, high = poles
    x = 10.0 ** np.linspace(low, high, count)
    squares = np.concatenate([[0.0], 10.0 ** np.linspace(-10.0, math.log10(4.0), POLE_SAMPLES - 1)])
    basis = np.concatenate([np.ones((POLE_SAMPLES, 1)), 1.0 / (squares[:, None] + x)], axis=1)
    scale = np.abs(basis).max(axis=0)
    weight = np.sqrt(squares + 1e-9)[:, None]
    fit = np.linalg.pinv(basis / scale * weight, rcond=1e-12) / scale[:, None] * weight.T
    return x, np.minimum(0.5 * np.sqrt(squares), 1.0), fit


def polar_nodes(count: int, top: float) -> Array:
    """Return `count` angles in (0, top], ascending: Chebyshev's points (Radau) of the interval.

    Nodes of functions even in theta would stand too far apart at 0: a reflectance that has a slope at grazing incidence
    leaves a term of theta^3 in the light of two bounces.
    """
    return np.asarray(0.5 * top * (1.0 + np.cos(2.0 * math.pi * np.arange(count) / (2 * count - 1))))[::-1]


def refinement(nodes: Array, targets: Array) -> Array:
    """Return the matrix (T, n) that interpolates a function of theta from `nodes`."""
    made = np.ones((targets.size, nodes.size))
    for k in range(nodes.size):
        for j in range(nodes.size):
            if j != k:
                made[:, k] *= (targets - nodes[j]) / (nodes[k] - nodes[j])
    return made


def panel_edges(elevations: Array, widest: float) -> Array:
    """Return the ends of panels in elevation, symmetric about 0, radians.

    The kernel jumps where the elevation is that of the light or the view, so that every one of them is an end; towards
    0, where 1/(1 + Lambda) bends, panels become small.
    """
    low = elevations[elevations > 0.0].min()
    graded = []
    while low > 0.03:
        low /= 3.0
        graded.append(low)
    ends = np.unique(np.round(np.concatenate([elevations, graded]), 13))
    positive = [0.0]
    for a, b in zip(np.concatenate([[0.0], ends[:-1]]), ends, strict=True):
        # Lambda and the modes vary within a panel, too
        pieces = math.ceil((b - a) / widest - 1e-9)
        positive += list(a + (b - a) * np.arange(1, pieces + 1) / pieces)
    right = np.array(positive)
    return np.concatenate([-right[:0:-1], right])
