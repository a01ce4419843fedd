"""Gauss panels in the elevation, aligned with the table's angles, and the rule inside a panel.

The kernel jumps to 0 where d_z does not increase, so panels end at every angle of the table. A node's own panel is
integrated from the node upwards on auxiliary Gauss nodes, the unknown being the polynomial through the panel's nodes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from brdftab.models._shared.codes import BECKMANN
from brdftab.models.smith_multi.volterra.settings import MOST_NODES, Settings
from brdftab.quadrature import gauss, lagrange

Weight = Callable[[np.ndarray], np.ndarray]
# error of a table in units of rho^(-2 nodes), measured, for one node, two and more
FRONT = (0.2, 0.05)


@dataclass(frozen=True)
class Mesh:
    """Nodes of the unknown on the elevations below the highest source.

    Attributes
    ----------
    source : ndarray (T,)
        Elevations of the table, increasing, radians.
    beta, weight : ndarray (N,)
        Nodes, increasing, and their weights of the measure 2 pi cos(beta) dbeta/(|d_z| (1 + Lambda)).
    first : int64 (P + 1,)
        Where each panel's nodes begin.
    active : int64 (P,)
        The first source above each panel.
    inner_from, inner_to : ndarray (R,)
        Auxiliary pairs of a node and a point above it in its panel, node by node.
    inner : int64 (N + 1,)
        Where each node's pairs begin.
    share : ndarray (R, Q)
        Weight of an auxiliary pair times the panel's cardinal polynomials there.
    """

    source: np.ndarray
    beta: np.ndarray
    weight: np.ndarray
    first: np.ndarray
    active: np.ndarray
    inner_from: np.ndarray
    inner_to: np.ndarray
    inner: np.ndarray
    share: np.ndarray


@lru_cache
def _inner_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return auxiliary points on (x_i, 1), (Q, A), and weight times cardinal polynomials there, (Q, A, Q)."""
    x, _ = gauss(count)
    y, v = gauss(count + 2)
    points = x[:, None] + 0.5 * (1.0 - x[:, None]) * (1.0 + y)
    return points, lagrange(x, points) * (0.5 * (1.0 - x[:, None]) * v)[:, :, None]


def _nodes(ratio: float, setting: Settings) -> int:
    """Return how many Gauss nodes serve a panel whose nearest singularity is `ratio` half widths away."""
    decay = (ratio + math.hypot(ratio, 1.0)) ** -2
    nodes = setting.nodes
    while nodes <= MOST_NODES and FRONT[min(nodes, len(FRONT)) - 1] * decay**nodes > setting.panel:
        nodes += 1
    return nodes


def split(low: float, high: float, distance: float, setting: Settings) -> tuple[int, int]:
    """Return into how many equal parts to split a panel, and the nodes of each, for the fewest nodes in all."""
    half = 0.5 * (high - low)
    best = (1, 0)
    parts = 1
    while True:
        nodes = _nodes(distance * parts / half, setting)
        if nodes <= MOST_NODES and (best[1] == 0 or parts * nodes < best[0] * best[1]):
            best = (parts, nodes)
        if best[1] and parts * setting.nodes >= best[0] * best[1]:
            return best
        parts = parts + 1 if parts < 8 else math.ceil(1.2 * parts)


def smoothness(ndf: int, alpha: float) -> float:
    """Return the distance in radians of the singularities that set the width of panels.

    The kernel has a ridge of width alpha where the elevation equals the depression. Rough surfaces bend towards the
    normal, where Beckmann's D vanishes like exp(-1/(alpha tilt)^2).
    """
    return min(alpha, 0.35 / alpha if ndf == BECKMANN else 0.9 / max(alpha, 1.3))


def rule(edges: np.ndarray, distance: float, setting: Settings, weight: Weight) -> tuple[np.ndarray, ...]:
    """Return nodes, weights, first node of each panel, ends of panels, and the auxiliary pairs (see `Mesh`).

    Parameters
    ----------
    edges : ndarray (E,)
        Increasing, radians; panels between them are split where the tolerance asks.
    distance : float
        From `smoothness`.
    setting : Settings
        Sizes.
    weight : callable
        1/(|d_z| (1 + Lambda)) of an array of elevations.
    """
    beta, size, first, ends, start, stop, share = [], [], [0], [edges[0]], [], [], []
    for low, high in itertools.pairwise(edges):
        parts, count = split(low, high, distance, setting)
        x, w = gauss(count)
        points, inner = _inner_rule(count)
        half = 0.5 * (high - low) / parts
        for part in range(parts):
            middle = low + (2 * part + 1) * half
            beta.append(middle + half * x)
            size.append(half * w)
            first.append(first[-1] + count)
            ends.append(middle + half)
            start.append(np.repeat(beta[-1], points.shape[1]))
            stop.append((middle + half * points).reshape(-1))
            share.append(half * inner.reshape(-1, count))
    nodes, inner_to = np.concatenate(beta), np.concatenate(stop)
    widest = max(s.shape[1] for s in share)
    wide = np.concatenate([np.pad(s, ((0, 0), (0, widest - s.shape[1]))) for s in share])
    wide *= (2.0 * math.pi * weight(inner_to) * np.cos(inner_to))[:, None]
    measure = np.concatenate(size) * 2.0 * math.pi * weight(nodes) * np.cos(nodes)
    return nodes, measure, np.array(first), np.array(ends), np.concatenate(start), inner_to, wide


def mesh(source: np.ndarray, ndf: int, alpha: float, setting: Settings, weight: Weight) -> Mesh:
    """Return the nodes for a table whose elevations are `source` (increasing, in (0, pi/2], radians)."""
    edges = np.concatenate([[0.0], source])
    fine = []
    for low, high in itertools.pairwise(edges):
        parts = math.ceil(0.5 * (high - low) / (setting.share * high) - 1e-9)
        fine.append(low + (high - low) * np.arange(parts) / parts)
    fine.append(edges[-1:])
    nodes, measure, first, _, start, stop, share = rule(np.concatenate(fine), smoothness(ndf, alpha), setting, weight)
    active = np.searchsorted(source, nodes[first[:-1]])
    inner = np.searchsorted(start, nodes)
    return Mesh(source, nodes, measure, first, active, start, stop, np.append(inner, start.size), share)
