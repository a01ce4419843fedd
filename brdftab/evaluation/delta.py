"""Mirror reflections that no value in 1/sr holds: f = finite part + R(theta_i) delta(omega_o - omega_m)/cos(theta_i).

A model tells R by a function ``mirror_reflectance`` of its kernel module; omega_m is the mirror direction. Albedos and
samples contain the delta, and so do cells that hold an average; points have the finite part alone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.models.protocols import HasDelta
from brdftab.models.resolve import Setup
from brdftab.quadrature import unit_gauss
from brdftab.tables.axis import TWO_PI
from brdftab.tables.grid import Grid
from brdftab.typing import Array

# Gauss nodes over the polar angles that two cells share, crowded towards the horizon, where R rises to 1: at an index
# of 1.0001 they leave 6e-9 in cells of 45 degrees, at 1.000001, where next to nothing is reflected, 5e-5
NODES = 32
# polar angles (radians) nearer than this are the same
SAME = 1e-9
# an angle at which every interface reflects
SOMEWHERE = 1.0


def reflectance(setup: Setup, theta_i: Array) -> Array:
    """Return R (N, C) at polar angles (N,) of the light, radians; 0 where the model has no delta."""
    module = models.kernel(setup.model.name)
    if not isinstance(module, HasDelta):
        return np.zeros((theta_i.size, len(setup.channels)))
    return module.mirror_reflectance(setup, theta_i)


def exists(setup: Setup) -> bool:
    """Tell whether a setup reflects part of the light as a delta."""
    return bool(reflectance(setup, np.array([SOMEWHERE])).any())


def mirrors(theta_i: float, theta_o: float, phi: float) -> bool:
    """Tell whether a pair of directions (radians) is the mirror direction."""
    turn = abs(math.remainder(phi - math.pi, TWO_PI))
    return theta_i < 0.5 * math.pi and abs(theta_i - theta_o) < SAME and math.sin(theta_i) * turn < SAME


def cell_averages(setup: Setup, grid: Grid, cells: NDArray[np.int64]) -> Array:
    """Return what the delta adds to the averages (K, C) over some cells, 1/sr; 0 in those that do not hold it.

    Averages are weighted by cos sin of both polar angles, so that over a cell of (theta_i, theta_o, phi)

        int R(t) cos t sin t dt over the polar angles that both share / (M_i M_o W),  M = int cos t sin t dt,

    W = 2 (width in phi): a cell of phi in [0, pi] stands for its mirror image, too, and both touch at pi. On grids of
    four axes 1/W is the length that the view's azimuths share with the light's turned by pi, over both widths.
    """
    out = np.zeros((len(cells), len(setup.channels)))
    if not len(cells) or not exists(setup):
        return out
    edges = grid.edges
    low_i, high_i = _ends(edges["theta_i"], cells[:, 0])
    low_o, high_o = _ends(edges["theta_o"], cells[:, 1 if grid.isotropic else 2])
    low, high = np.maximum(low_i, low_o), np.minimum(np.minimum(high_i, high_o), 0.5 * math.pi)
    share = _azimuths(grid, cells)
    held = np.flatnonzero((high > low) & (share > 0.0))
    if not held.size:
        return out
    spans, at = np.unique(np.stack([low[held], high[held]]), axis=1, return_inverse=True)
    x, w = unit_gauss(NODES)
    # elevations from the horizon, squared
    bottom, top = np.sqrt(0.5 * math.pi - spans[1]), np.sqrt(0.5 * math.pi - spans[0])
    root = bottom[:, None] + (top - bottom)[:, None] * x
    theta = 0.5 * math.pi - root * root
    weight = 2.0 * root * (top - bottom)[:, None] * w * np.cos(theta) * np.sin(theta)
    found = reflectance(setup, theta.reshape(-1)).reshape(*theta.shape, -1)
    energy = np.einsum("kn,knc->kc", weight, found)[at.reshape(-1)]
    mass = _mass(low_i, high_i) * _mass(low_o, high_o)
    out[held] = energy * (share[held] / mass[held])[:, None]
    return out


def _ends(edges: Array, index: NDArray[np.int64]) -> tuple[Array, Array]:
    return edges[index], edges[index + 1]


def _mass(low: Array, high: Array) -> Array:
    """Return int |cos t| sin t dt over ranges of the polar angle, also across the horizon."""
    across = (low < 0.5 * math.pi) & (high > 0.5 * math.pi)
    one, other = 0.5 * np.sin(low) ** 2, 0.5 * np.sin(high) ** 2
    mass: Array = np.where(across, 1.0 - one - other, np.abs(other - one))
    return mass


def _azimuths(grid: Grid, cells: NDArray[np.int64]) -> Array:
    """Return the share (K,), 1/rad, of the azimuths of a cell in which the view is opposite to the light."""
    if grid.isotropic:
        low, high = _ends(grid.edges["phi"], cells[:, 2])
        return np.where(high >= math.pi - SAME, 0.5 / (high - low), 0.0)
    low_i, high_i = _ends(grid.edges["phi_i"], cells[:, 1])
    low_o, high_o = _ends(grid.edges["phi_o"], cells[:, 3])
    shared = np.zeros(len(cells))
    for turn in (-3.0, -1.0, 1.0, 3.0):
        shift = turn * math.pi
        shared += np.maximum(np.minimum(high_i + shift, high_o) - np.maximum(low_i + shift, low_o), 0.0)
    return shared / ((high_i - low_i) * (high_o - low_o))


def described(setup: Setup, grid: Grid, theta_i_degrees: tuple[float, ...]) -> dict[str, Any] | None:
    """Return what a table says of the delta: R at some angles, and whether its cells hold it; None without one."""
    if not exists(setup):
        return None
    values = reflectance(setup, np.radians(theta_i_degrees))
    held = holds(grid)
    return {
        "direction": "mirror",
        "theta_i_degrees": list(theta_i_degrees),
        "reflectance": values.tolist(),
        "in_cells": held,
        "meaning": (
            "share of the light that is reflected into the mirror direction alone, beside f; "
            + ("averages over the cells that hold this direction contain it" if held else "no value contains it")
        ),
    }


def holds(grid: Grid) -> bool:
    """Tell whether cells of a grid contain the delta: averages do, points do not."""
    return grid.cell != "point" and len(grid.mirror_cells()) > 0
