"""How wrong a table is: some of its cells are evaluated again with finer rules, without the fast path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.evaluation.agreement import least_errors
from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import Setup, component_names
from brdftab.tables.grid import Grid
from brdftab.tabulation.adaptive_cells import NODES, box_nodes, cell_averages
from brdftab.tabulation.cell_averages import FLOOR, mirror_average
from brdftab.tabulation.narrow_lobes import unresolved
from brdftab.tabulation.row_energies import energies
from brdftab.typing import Array

SAMPLES = 256
MIRRORS = 2
# Gauss nodes along each coordinate of a mirror cell in the reference
MIRROR_FINE = 8
# averaged cells compared: regular ones, and those that see a narrow lobe; the reference asks for this share of the
# tolerance, with more nodes a box than the table had, and at most so many points
AVERAGED, LOBES, REFERENCE = 64, 24, 0.1
FINER, MOST = {True: 2, False: 1}, {True: 1 << 22, False: 1 << 23}
# rows' energies beside albedos that are exact to this share of the tolerance
ALBEDO = 0.25
ENERGY = "largest difference of a row's energy to the albedo, over the largest channel, at rows from first to last"
# cells compared with looser rules, too, where finer ones agree to the last bit
EQUAL = 16
# an error above this is a table that misses its lobe, which no tolerance mends
LOOSEST = 0.1
DEFINITION = (
    "largest channel difference over the cell's largest channel (at least 1e-9/sr), the maximum over a stratified "
    "subset of cells evaluated again by direct quadrature at a hundredth of the tolerance (averages: at a tenth)"
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
    energy : dict or None
        Of averages: the light in some rows beside their albedo; `largest` counts it in.
    components : dict or None
        By name, over the same cells: the largest ``absolute`` error, 1/sr, and the largest ``relative`` one, over the
        component's own largest channel (at least 1e-9/sr).
    """

    largest: float
    p95: float
    rms: float
    cells: int
    mirror_cells: int
    worst: tuple[int, ...]
    energy: dict[str, Any] | None = None
    components: dict[str, dict[str, float]] | None = None

    @property
    def reason(self) -> str:
        """Say what to change where the tolerance is not met."""
        if self.energy and self.energy["largest"] >= self.largest:
            return (
                f"the row at theta_i = {self.energy['at_degrees']:.4g} degrees holds so much more or less light than "
                "its albedo; take a finer grid there"
            )
        return "the rule for cells with kinks or the mirror direction leaves this much; take a finer grid" + (
            "" if self.largest > LOOSEST else ", or ask for a looser tolerance"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the estimate as plain JSON."""
        return {
            "estimate": self.largest,
            "p95": self.p95,
            "rms": self.rms,
            "cells": self.cells,
            "mirror_cells": self.mirror_cells,
            "worst_cell": list(self.worst),
            **({"row_energy": self.energy} if self.energy else {}),
            **({"components": self.components} if self.components else {}),
            "definition": DEFINITION if self.energy is None else f"{DEFINITION}; and {ENERGY}",
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


def _averaged(
    setup: Setup, grid: Grid, mirror_cells: NDArray[np.int64], tolerance: float, nodes: int, orders: int
) -> tuple[NDArray[np.int64], Array, int]:
    """Return cells of a table of averages, their finer averages (K, P, C), and how many see a narrow lobe.

    Cells that see the lobe, or a mirror direction without a finite value, are among them from the first to the last.
    """
    cells = stratified_cells(grid, SAMPLES)
    cells = cells[:: max(1, len(cells) // AVERAGED)]
    lobed = unresolved(setup, grid)
    lobed[tuple(mirror_cells.T)] = True
    held = np.argwhere(lobed)
    if len(held):
        held = held[np.unique(np.linspace(0, len(held) - 1, LOBES).round().astype(int))]
        cells = np.unique(np.concatenate([cells, held]), axis=0)
    engine = Engine(setup, max(REFERENCE * tolerance, 1e-13), orders, fast=False)
    # the first rule of averages asks its boxes for the tolerance, later ones for less
    finer = box_nodes(grid, tolerance if nodes <= NODES else REFERENCE * tolerance) + FINER[grid.isotropic]
    narrow = lobed[tuple(cells.T)]
    reference, _ = cell_averages(engine, grid, cells, REFERENCE * tolerance, finer, narrow, MOST[grid.isotropic])
    return cells, reference, int(np.count_nonzero(narrow))


def _pointwise(
    setup: Setup, grid: Grid, singular_cells: NDArray[np.int64], tolerance: float, nodes: int, orders: int
) -> tuple[NDArray[np.int64], Array, int]:
    """Return cells of a table of points, their values (K, P, C) by a finer rule, and how many hold averages instead."""
    fine = Engine(setup, max(0.01 * tolerance, 1e-13), orders, fast=False)
    cells = stratified_cells(grid, SAMPLES)
    if len(singular_cells):
        is_singular = (cells[:, None, :] == singular_cells[None, :, :]).all(axis=2).any(axis=1)
        cells = cells[~is_singular]
    reference = fine.points(*(np.ascontiguousarray(a) for a in cell_angles(grid, cells)))
    if not len(singular_cells):
        return cells, reference, 0
    pick = np.unique(np.linspace(len(singular_cells) // 3, len(singular_cells) - 1, MIRRORS).round().astype(int))
    some = singular_cells[pick]
    rough = Engine(setup, min(0.1 * tolerance, 1e-4), orders, fast=False)
    means = mirror_average(rough, grid, some, max(MIRROR_FINE, nodes + 1))
    return np.concatenate([cells, some]), np.concatenate([reference, means]), len(some)


def estimate(
    setup: Setup,
    grid: Grid,
    values: NDArray[np.floating],
    singular_cells: NDArray[np.int64],
    tolerance: float,
    nodes: int,
    layers: NDArray[np.floating] | None = None,
    orders: int = 0,
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
    layers : ndarray (P, ..., C), optional
        The components of the table, whose errors are estimated, too.
    orders : int, optional
        How many bounce orders are components; 0 for the total alone.
    """
    found = _averaged if grid.cell == "average" else _pointwise
    cells, parts, mirrors = found(setup, grid, singular_cells, tolerance, nodes, orders)
    reference = parts.sum(axis=1)
    compared = values[tuple(cells.T)]
    scale = np.maximum(np.abs(reference).max(axis=1), FLOOR)
    error = np.abs(compared.astype(np.float64) - reference).max(axis=1) / scale
    if str(values.dtype) == "float64" and grid.cell != "average":
        error = np.maximum(error, _least(setup, grid, cells[: len(cells) - mirrors], compared, error, tolerance))
    worst = int(np.argmax(error))
    energy = energies(setup, grid, values, ALBEDO * tolerance) if grid.cell == "average" else None
    return Estimate(
        largest=max(float(error[worst]), energy["largest"] if energy else 0.0),
        p95=float(np.quantile(error, 0.95)),
        rms=float(math.sqrt(np.mean(error * error))),
        cells=len(cells),
        mirror_cells=mirrors,
        worst=tuple(int(k) for k in cells[worst]),
        energy=energy,
        components=None if layers is None or not orders else _by_component(setup, orders, layers, cells, parts),
    )


def _by_component(
    setup: Setup, orders: int, layers: NDArray[np.floating], cells: NDArray[np.int64], parts: Array
) -> dict[str, dict[str, float]]:
    """Return the largest errors of each component (P, ..., C) over cells with references (K, P, C)."""
    found = {}
    for n, name in enumerate(component_names(setup, orders)):
        reference = parts[:, n]
        gap = np.abs(layers[n][tuple(cells.T)].astype(np.float64) - reference).max(axis=1)
        own = np.maximum(np.abs(reference).max(axis=1), FLOOR)
        found[name] = {"absolute": float(gap.max()), "relative": float((gap / own).max())}
    return found


def _least(setup: Setup, grid: Grid, cells: NDArray[np.int64], values: Array, error: Array, tolerance: float) -> Array:
    """Return the least relative errors (K,) where rules agree to the last bit; 0 elsewhere and for mirror cells."""
    found = np.zeros(len(values))
    equal = np.flatnonzero(error[: len(cells)] == 0.0)[:EQUAL]
    if not equal.size:
        return found
    angles = [np.ascontiguousarray(a[equal]) for a in cell_angles(grid, cells)]

    def evaluate(at: NDArray[np.intp], wanted: float) -> Array:
        return Engine(setup, wanted, fast=False).points(*(a[at] for a in angles))

    given = values[equal][:, None]
    size = np.maximum(np.abs(given).max(axis=-1), FLOOR)
    found[equal] = (least_errors(given, tolerance, evaluate, scale=size) / size)[:, 0]
    return found
