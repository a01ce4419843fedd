"""A table by quadrature: one attempt after the other, each with finer rules, until the estimated error holds."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import DTypeLike, NDArray

from brdftab.errors import SingularDirectionError
from brdftab.evaluation.engine import Engine, Progress
from brdftab.evaluation.points import has_mirror_averages, singular
from brdftab.models.resolve import Setup
from brdftab.tables.grid import Grid
from brdftab.tabulation.cell_averages import mirror_average
from brdftab.tabulation.error_estimate import Estimate, estimate
from brdftab.tabulation.filling import fill_averages, fill_grid
from brdftab.timing import Clock
from brdftab.typing import Array

MIRROR_NODES = (7, 11)
# nodes common to all averaged cells, and the tolerance asked of those averaged again, over the table's, with three axes
# and with four, where boxes leave far less than they seem to: asked for 1e-2, cells of 30 degrees leave 1e-5
AVERAGE_RULES = ((3, {True: 1.0, False: 5.0}), (5, {True: 0.1, False: 0.5}))
# mirror cells whose nodes are held at once
AT_ONCE = 16


def singular_cells(setup: Setup, grid: Grid) -> NDArray[np.int64]:
    """Return the cells that must hold an average, or refuse point values where there are none."""
    none = np.empty((0, len(grid.shape)), dtype=np.int64)
    if not has_mirror_averages(setup):
        return none
    cells = np.asarray(grid.mirror_cells()).reshape(-1, len(grid.shape))
    axes = grid.axes
    normal = (
        np.argwhere(np.isclose(axes["theta_i"], 0.0, atol=1e-12)),
        np.argwhere(np.isclose(axes["theta_o"], 0.0, atol=1e-12)),
    )
    if normal[0].size and normal[1].size:
        # at normal incidence and view the half vector is the normal for every azimuth
        ranges = [
            [0] if name.startswith("theta") else range(n) for name, n in zip(grid.axis_names, grid.shape, strict=True)
        ]
        cells = np.unique(np.concatenate([cells, np.array(list(itertools.product(*ranges)))]), axis=0)
    if grid.cell != "point" or not len(cells):
        return cells
    theta_i, theta_o = axes["theta_i"][cells[:, 0]], axes["theta_o"][cells[:, -2]]
    azimuth = np.zeros(len(cells)) if grid.isotropic else axes["phi_i"][cells[:, 1]]
    phi = axes["phi"][cells[:, 2]] if grid.isotropic else axes["phi_o"][cells[:, 3]] - azimuth
    bad = singular(setup, theta_i, theta_o, phi, azimuth)
    if bad.any():
        at = int(np.argmax(bad))
        raise SingularDirectionError(
            f"cell = point is refused: the grid holds {int(bad.sum())} mirror directions (theta_i = theta_o = "
            f"{math.degrees(theta_i[at]):g}, phi = {math.degrees(phi[at]):g} degrees), where {setup.model.name} has no "
            "finite value; use cell = center or average, or positions aside"
        )
    return none


class Run:
    """One attempt at one tolerance: engine, values, cost.

    Cells that are singular in `averaged` hold averages, by default those of the setup itself.
    """

    def __init__(
        self,
        setup: Setup,
        grid: Grid,
        dtype: DTypeLike,
        tolerance: float,
        orders: int,
        fast: bool,
        engine: Engine | None = None,
        averaged: Setup | None = None,
    ) -> None:
        self.setup, self.grid, self.orders = setup, grid, orders
        self.cells = singular_cells(averaged or setup, grid)
        clock = Clock()
        self.engine = engine or Engine(setup, tolerance, orders, fast)
        self.kernel_time = clock.seconds
        self.values = np.empty((self.engine.layers, *grid.shape, len(setup.channels)), dtype=dtype)

    def compute(self, nodes: int, progress: Progress | None) -> None:
        """Fill the table; nodes is the number of Gauss nodes along each coordinate of an averaged cell."""
        clock = Clock()
        if self.grid.cell == "average":
            share = next((share for least, share in AVERAGE_RULES if nodes <= least), AVERAGE_RULES[-1][1])
            asked = share[self.grid.isotropic] * self.engine.tolerance
            fill_averages(self.engine, self.grid, nodes, asked, self.cells, self.values, progress)
        else:
            # averages first: they take most of the time, and tell how much
            mean, part = self._averages(nodes, progress)
            rest = None if progress is None else (lambda done: progress(part + (1.0 - part) * done))
            fill_grid(self.engine, self.grid, self.values, rest)
            if mean is not None:
                self._store(mean)
        self.kernel_time += clock.seconds

    def refine(self, worst: tuple[int, ...]) -> bool:
        """Make the averages of the mirror cells again with more nodes if the worst cell is one of them."""
        if self.grid.cell != "center" or worst not in {tuple(c) for c in self.cells.tolist()}:
            return False
        clock = Clock()
        mean, _ = self._averages(MIRROR_NODES[1], None)
        assert mean is not None
        self._store(mean)
        self.kernel_time += clock.seconds
        return True

    def _averages(self, nodes: int, progress: Progress | None) -> tuple[Array | None, float]:
        """Return the averages (K, P, C) of the mirror cells, None without any, and their share of all directions."""
        if not len(self.cells):
            return None, 0.0
        others = self.grid.size // 2 if self.grid.square and not self.engine.is_fast else 0
        before, found, share = self.engine.evaluated, [], 0.0
        for start in range(0, len(self.cells), AT_ONCE):
            found.append(mirror_average(self.engine, self.grid, self.cells[start : start + AT_ONCE], nodes))
            done = min(start + AT_ONCE, len(self.cells))
            each = max(self.engine.evaluated - before, 1) / done
            share = each * len(self.cells) / (each * len(self.cells) + others)
            if progress is not None:
                progress(share * done / len(self.cells))
        return np.concatenate(found), share

    def _store(self, mean: Array) -> None:
        """Write the averages of mirror cells; both halves of a square grid get the same number."""
        cells = self.cells
        if self.grid.square:
            swap = cells[:, [1, 0, 2]] if self.grid.isotropic else cells[:, [2, 3, 0, 1]]
            lookup = {tuple(c): n for n, c in enumerate(cells.tolist())}
            partner = np.array([lookup.get(tuple(c), n) for n, c in enumerate(swap.tolist())])
            mean = 0.5 * (mean + mean[partner])
        self.values[(slice(None), *cells.T)] = mean.transpose(1, 0, 2)

    @property
    def method(self) -> str:
        """Say how the values were made."""
        return "prepared" if self.engine.is_fast else "direct"

    @property
    def total(self) -> NDArray[np.floating]:
        """Return the sum over the components."""
        if self.engine.layers == 1:
            return self.values[0]
        return self.values.sum(axis=0, dtype=np.float64).astype(self.values.dtype)


def _attempts(setup: Setup, grid: Grid, tolerance: float, orders: int) -> list[tuple[float, bool, int]]:
    """Return (tolerance, fast, nodes) of the runs to try until the estimate holds."""
    if grid.cell == "average":
        return [(tolerance, True, nodes) for nodes, _ in AVERAGE_RULES]
    return [
        (tolerance, True, MIRROR_NODES[0]),
        (tolerance, False, MIRROR_NODES[0]),
        (max(0.01 * tolerance, 1e-13), False, MIRROR_NODES[1]),
    ]


def until_met(
    setup: Setup, grid: Grid, dtype: DTypeLike, tolerance: float, orders: int, progress: Progress | None
) -> tuple[Run, Estimate]:
    """Compute with ever finer rules until the estimate is at or below the tolerance, or no finer rule is left."""
    best: tuple[Run, Estimate] | None = None
    cost = 0.0
    floor = 1.2e-7 if np.dtype(dtype) == np.float32 else 0.0
    for asked, fast, nodes in _attempts(setup, grid, tolerance, orders):
        if best is not None and not fast and best[0].engine.is_fast is False and asked == tolerance:
            continue
        run = Run(setup, grid, dtype, asked, orders, fast)
        run.compute(nodes, progress)
        judged = estimate(setup, grid, run.total, run.cells, tolerance, nodes, run.values, orders)
        if judged.largest > max(tolerance, floor) and run.refine(judged.worst):
            # only the averages of the mirror cells fall short: they alone are made again
            judged = estimate(setup, grid, run.total, run.cells, tolerance, MIRROR_NODES[1], run.values, orders)
        cost += run.kernel_time
        if best is None or judged.largest < best[1].largest:
            best = run, judged
        if best[1].largest <= max(tolerance, floor):
            break
    assert best is not None
    best[0].kernel_time = cost
    return best
