"""How wrong a table is: some of its cells are evaluated again with finer rules, without the fast path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.cells import axis_nodes, mirror_average
from brdftab.engine import Engine
from brdftab.grid import Grid
from brdftab.models.setup import Setup

Array = NDArray[np.float64]
SAMPLES = 256
MIRRORS = 2
# Gauss nodes along each coordinate of a mirror cell in the reference
MIRROR_FINE = 8
# values below this (1/sr) are compared absolutely: nothing reflects there
FLOOR = 1e-9
DEFINITION = (
    "largest channel difference over the cell's largest channel (at least 1e-9/sr), the maximum over a stratified "
    "subset of cells evaluated again by direct quadrature at a hundredth of the tolerance"
)


@dataclass(frozen=True)
class Estimate:
    """An error estimate over a subset of cells.

    Attributes
    ----------
    largest, p95, rms : float
        Relative errors over the subset.
    cells : int
        Cells compared, of which `mirror_cells` hold the mirror direction.
    mirror_cells : int
        Number of those.
    worst : tuple of int
        Index of the worst cell.
    """

    largest: float
    p95: float
    rms: float
    cells: int
    mirror_cells: int
    worst: tuple[int, ...]

    reason = "the rule for cells with kinks or the mirror direction leaves this much; ask for a looser tolerance"

    def to_json(self) -> dict[str, Any]:
        """Return the estimate as plain JSON."""
        return {
            "estimate": self.largest,
            "p95": self.p95,
            "rms": self.rms,
            "cells": self.cells,
            "mirror_cells": self.mirror_cells,
            "worst_cell": list(self.worst),
            "definition": DEFINITION,
        }


def stratified_cells(grid: Grid, count: int) -> NDArray[np.int64]:
    """Return about `count` cell indices: one at random in each block of the grid, edges included; seeded."""
    rng = np.random.default_rng(20180611)
    shape = np.array(grid.shape)
    steps = max(1, round(count ** (1.0 / len(shape))))
    strata = [np.minimum(np.arange(steps + 1) * n // steps, n) for n in shape]
    chosen = []
    for block in np.ndindex(*[steps] * len(shape)):
        low = [strata[a][b] for a, b in enumerate(block)]
        high = [max(strata[a][b + 1], strata[a][b] + 1) for a, b in enumerate(block)]
        chosen.append([min(int(rng.integers(x, y)), n - 1) for x, y, n in zip(low, high, shape, strict=True)])
    corners = np.stack(np.meshgrid(*[[0, n - 1] for n in shape], indexing="ij"), -1).reshape(-1, len(shape))
    return np.unique(np.concatenate([np.array(chosen), corners]), axis=0)


def cell_angles(grid: Grid, cells: NDArray[np.int64]) -> tuple[Array, Array, Array, Array]:
    """Return theta_i, theta_o, phi, phi_i (K,) at the positions of some cells."""
    at = {name: grid.axes[name][cells[:, k]] for k, name in enumerate(grid.axis_names)}
    if grid.isotropic:
        return at["theta_i"], at["theta_o"], at["phi"], np.zeros(len(cells))
    return at["theta_i"], at["theta_o"], at["phi_o"] - at["phi_i"], at["phi_i"]


def averages(engine: Engine, grid: Grid, cells: NDArray[np.int64], nodes: int) -> Array:
    """Return cell averages (K, P, C) of regular cells by Gauss nodes along every axis."""
    rules = [axis_nodes(grid.edges[name], nodes, name.startswith("theta")) for name in grid.axis_names]
    total = np.zeros(())
    for pick in np.ndindex(*[nodes] * len(rules)):
        at = [rule[0][p, cells[:, k]] for k, (rule, p) in enumerate(zip(rules, pick, strict=True))]
        weight = np.prod([rule[1][p, cells[:, k]] for k, (rule, p) in enumerate(zip(rules, pick, strict=True))], axis=0)
        if grid.isotropic:
            ti, to, phi, az = at[0], at[1], at[2], np.zeros(len(cells))
        else:
            ti, az, to, phi = at[0], at[1], at[2], at[3] - at[1]
        values = engine.points(*(np.ascontiguousarray(a) for a in (ti, to, phi, az)))
        total = total + values * weight[:, None, None]
    return total


def estimate(
    setup: Setup,
    grid: Grid,
    values: NDArray[np.floating],
    singular_cells: NDArray[np.int64],
    tolerance: float,
    nodes: int,
) -> Estimate:
    """Compare a table with a refined evaluation on a stratified subset of its cells.

    Parameters
    ----------
    setup : Setup
        The model.
    grid : Grid
        The grid.
    values : ndarray (..., C)
        The table.
    singular_cells : ndarray (K, axes)
        Cells that hold an average because the mirror direction lies in them.
    tolerance : float
        Relative error asked of the table.
    nodes : int
        Gauss nodes a coordinate that averaged cells were made with (0: point values).
    """
    fine = Engine(setup, max(0.01 * tolerance, 1e-13), fast=False)
    cells = stratified_cells(grid, SAMPLES)
    if len(singular_cells):
        is_singular = (cells[:, None, :] == singular_cells[None, :, :]).all(axis=2).any(axis=1)
        cells = cells[~is_singular]
    if grid.cell == "average":
        cells = cells[:: max(1, len(cells) // 64)]
        reference = averages(fine, grid, cells, 2 * nodes + 1)[:, 0]
    else:
        reference = fine.points(*(np.ascontiguousarray(a) for a in cell_angles(grid, cells)))[:, 0]
    compared = values[tuple(cells.T)]
    if len(singular_cells):
        pick = np.unique(np.linspace(len(singular_cells) // 3, len(singular_cells) - 1, MIRRORS).round().astype(int))
        some = singular_cells[pick]
        rough = Engine(setup, min(0.1 * tolerance, 1e-4), fast=False)
        reference = np.concatenate([reference, mirror_average(rough, grid, some, max(MIRROR_FINE, nodes + 1))[:, 0]])
        compared = np.concatenate([compared, values[tuple(some.T)]])
        cells = np.concatenate([cells, some])
    else:
        some = singular_cells
    scale = np.maximum(np.abs(reference).max(axis=1), FLOOR)
    error = np.abs(compared.astype(np.float64) - reference).max(axis=1) / scale
    worst = int(np.argmax(error))
    return Estimate(
        largest=float(error[worst]),
        p95=float(np.quantile(error, 0.95)),
        rms=float(math.sqrt(np.mean(error * error))),
        cells=len(cells),
        mirror_cells=len(some),
        worst=tuple(int(k) for k in cells[worst]),
    )
