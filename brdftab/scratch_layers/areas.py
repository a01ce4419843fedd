"""Which share of a surface a threshold of Worley noise covers: density to area and back.

The noise has one feature a unit cell, evenly drawn inside it; a point is covered where the nearest feature is at most d
away. The share left free is the chance that no cell's feature falls into the disc around the point: a product over
cells of one minus the overlap of disc and cell, averaged over the point's place in its own cell. For small d it is
pi d^2; discs overlap from there on, so that d = .3 covers .270 and not .283, and d is no share of area.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from brdftab.quadrature import gauss
from brdftab.typing import Array

# beyond the diagonal of a cell nothing is left free
FARTHEST = math.sqrt(2.0)
NODES = 16
STEPS = 96


def _below(c: Array, d: float) -> Array:
    """Return the area of the disc of radius d on the side x <= c of a line, c in [-d, d]."""
    return c * np.sqrt(np.maximum(d * d - c * c, 0.0)) + d * d * (np.arcsin(c / d) + 0.5 * math.pi)


def _corner(x: Array, y: Array, d: float) -> Array:
    """Return the area of the disc of radius d around 0 that has its first coordinate <= x and its second <= y."""
    x, y = np.broadcast_arrays(np.clip(x, -d, d), np.clip(y, -d, d))
    one, two = _below(x, d), _below(y, d)
    inside = x * x + y * y <= d * d
    outside = np.where(x > 0.0, np.where(y > 0.0, one + two - math.pi * d * d, two), np.where(y > 0.0, one, 0.0))
    return np.where(inside, x * y + 0.5 * (one + two) - 0.25 * math.pi * d * d, outside)


def covered(density: float) -> float:
    """Return the expected share of area within `density` of a feature, in [0, 1].

    Parameters
    ----------
    density : float
        Threshold of the noise, not negative; 1 at the square root of 2 and beyond.
    """
    d = float(density)
    if d <= 0.0:
        return 0.0
    if d >= FARTHEST:
        return 1.0
    x, w = gauss(NODES)
    # the place in the cell, by symmetry in one quarter of it
    place, weight = 0.25 * (x + 1.0), 0.5 * w
    reach = math.ceil(d)
    free = np.ones((NODES, NODES))
    for i in range(-reach, reach + 1):
        left, right = i - place[:, None], i + 1.0 - place[:, None]
        for j in range(-reach, reach + 1):
            low, high = j - place[None, :], j + 1.0 - place[None, :]
            overlap = _corner(right, high, d) - _corner(left, high, d) - _corner(right, low, d) + _corner(left, low, d)
            free *= np.clip(1.0 - overlap, 0.0, 1.0)
    return float(1.0 - weight @ free @ weight)


@functools.cache
def table() -> tuple[Array, Array]:
    """Return densities (N,) from 0 to the square root of 2 and the areas that they cover."""
    d = np.linspace(0.0, FARTHEST, STEPS + 1)
    return d, np.array([covered(x) for x in d])


def density_of(area: float) -> float:
    """Return the threshold that covers a share of area in [0, 1]: the table of `covered`, inverted."""
    d, a = table()
    # the root of the area is almost linear in d where discs hardly overlap
    roots, keep = np.unique(np.sqrt(a), return_index=True)
    return float(np.interp(math.sqrt(min(max(area, 0.0), 1.0)), roots, d[keep]))
