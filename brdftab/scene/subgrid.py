"""Parts of a grid: the directions that lights and camera reach, the part that symmetry leaves, the positions kept."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import ParameterError
from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import Setup
from brdftab.scene.scene import Material
from brdftab.tables.grid import Grid
from brdftab.typing import Array

Kept = Mapping[str, NDArray[np.int64]]
# directions at which a symmetry is tried, and how closely values must repeat
TRIALS, SAME = 48, 1e-6


def part(grid: Grid, kept: Kept) -> Grid:
    """Return a grid of some positions of another; cells that stay neighbours keep their edge.

    Parameters
    ----------
    grid : Grid
        The whole.
    kept : mapping of str to ndarray of int64
        Increasing indices by axis; axes left out stay whole.
    """
    given: dict[str, Any] = {}
    for name, positions in grid.axes.items():
        if name not in kept or kept[name].size == positions.size:
            continue
        given[name] = positions[kept[name]]
        given[f"{name}_edges"] = _edges(grid, name, kept[name])
    return replace(grid, **given) if given else grid


def _edges(grid: Grid, name: str, index: NDArray[np.int64]) -> Array:
    """Return the edges of the cells of some positions of an axis."""
    own, edges = grid.axes[name][index], grid.edges[name]
    middle = np.where(np.diff(index) == 1, edges[index[1:]], 0.5 * (own[:-1] + own[1:]))
    return np.concatenate([[edges[index[0]]], middle, [edges[index[-1] + 1]]])


def kept_of(grid: Grid, some: Grid) -> dict[str, NDArray[np.int64]] | None:
    """Return what `part` makes one grid of another from, or None where it does not."""
    if grid.cell != some.cell or grid.axis_names != some.axis_names:
        return None
    found = {}
    for name, positions in some.axes.items():
        index = np.searchsorted(grid.axes[name], positions)
        if index[-1] >= grid.axes[name].size or not np.array_equal(grid.axes[name][index], positions):
            return None
        if not np.array_equal(_edges(grid, name, index), some.edges[name]):
            return None
        if index.size < grid.axes[name].size:
            found[name] = index
    return found


def reached(grid: Grid, material: Material) -> Grid:
    """Return the part of a grid that lights and camera reach, with one position beyond each end of their ranges.

    Raises
    ------
    ParameterError
        If a range lies outside the grid.
    """
    kept = {}
    for name in ("theta_i", "theta_o"):
        positions, edges = grid.axes[name], grid.edges[name]
        low, high = getattr(material, name)
        if low >= edges[-1] or high <= edges[0]:
            ends = f"[{math.degrees(edges[0]):g}, {math.degrees(edges[-1]):g}]"
            raise ParameterError(
                f"{material.name}: {name} = [{math.degrees(low):g}, {math.degrees(high):g}] misses the grid's {ends} "
                "degrees; mend the range or the grid"
            )
        first = max(0, int(np.searchsorted(positions, low, side="right")) - 1)
        last = min(positions.size - 1, int(np.searchsorted(positions, high, side="left")))
        kept[name] = np.arange(first, last + 1)
    return part(grid, kept)


def _closed(positions: Array, images: Array) -> bool:
    """Tell whether azimuths come back among the positions."""
    gap = np.abs(np.mod(images[:, None] - positions[None, :] + math.pi, 2.0 * math.pi) - math.pi)
    return bool((gap.min(axis=1) < 1e-9).all())


def quarter(setup: Setup, grid: Grid, rules: float) -> Grid | None:
    """Return the part of a grid of four axes whose lights stand for all others, or None.

    Surfaces that look the same after a reflection about either axis give the other three quarters. Both reflections are
    tried on the model itself, and must lead from positions of the grid to others.
    """
    if grid.isotropic or grid.phi_i is None or grid.phi_o is None:
        return None
    for positions in (grid.phi_i, grid.phi_o):
        if not (_closed(positions, -positions) and _closed(positions, math.pi - positions)):
            return None
    rng = np.random.default_rng(4)
    ti, to = rng.uniform(0.05, 1.4, (2, TRIALS))
    pi_, po = rng.uniform(0.0, 2.0 * math.pi, (2, TRIALS))
    engine = Engine(setup, rules, fast=False)
    value = engine.points(ti, to, po - pi_, pi_)
    for turned in (
        engine.points(ti, to, pi_ - po, np.ascontiguousarray(-pi_)),
        engine.points(ti, to, pi_ - po, np.ascontiguousarray(math.pi - pi_)),
    ):
        if np.abs(turned - value).max() > max(SAME, rules) * np.abs(value).max():
            return None
    fourth = first_quarter(grid)
    return fourth if fourth.size < grid.size else None


def first_quarter(grid: Grid) -> Grid:
    """Return the part of a grid of four axes whose lights have azimuths up to 90 degrees; the whole without any."""
    assert grid.phi_i is not None
    first = np.flatnonzero(grid.phi_i <= 0.5 * math.pi + 1e-9)
    return part(grid, {"phi_i": first}) if first.size else grid
