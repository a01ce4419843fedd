"""Pairs of directions at which a plan's choices are tried."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import has_mirror_averages
from brdftab.models.resolve import Setup
from brdftab.scene.plan import once
from brdftab.tables.grid import Grid
from brdftab.tabulation.cell_averages import mirror_average
from brdftab.timing import Clock
from brdftab.typing import Array

# cells at the mirror direction among the probes, nodes along each of their coordinates, and how often a cost is timed
MIRRORS, NODES, TIMED = 6, 3, 2
# both sides of a comparison are evaluated to this share of the tolerance; their errors are alike
EXACT = 0.1


@dataclass(frozen=True)
class Probes:
    """Pairs of directions (N,) at positions of the full grid, and how errors count there."""

    theta_i: Array
    theta_o: Array
    phi: Array
    phi_i: Array
    floor: float
    grid: Grid

    def averages(self, setup: Setup, tolerance: float, orders: int) -> Array:
        """Return averages (K, P, C) over some cells that hold the mirror direction, where a model is singular."""
        if not has_mirror_averages(setup) or self.grid.cell != "center":
            return np.empty((0, 1, 1))
        cells = np.asarray(self.grid.mirror_cells()).reshape(-1, len(self.grid.shape))
        if not len(cells):
            # no light meets its own mirror direction
            return np.empty((0, 1, 1))
        some = cells[np.unique(np.linspace(0, len(cells) - 1, MIRRORS).round().astype(int))]
        return mirror_average(Engine(setup, tolerance, orders, fast=False), self.grid, some, NODES)

    def values(self, setup: Setup, tolerance: float, orders: int = 0) -> tuple[Array, float]:
        """Return values (N, P, C) by direct evaluation, and the seconds that it took."""
        engine = Engine(setup, tolerance, orders, fast=False)
        once(
            f"points of {setup.model.name}, {orders}",
            lambda: engine.points(*(a[:1] for a in (self.theta_i, self.theta_o, self.phi, self.phi_i))),
        )
        clock = Clock()
        found = engine.points(self.theta_i, self.theta_o, self.phi, self.phi_i)
        return found, clock.seconds

    def cost(self, setup: Setup, tolerance: float) -> float:
        """Return the seconds of a fourth of the pairs, the less of two: the first may build what others find."""
        angles = (self.theta_i, self.theta_o, self.phi, self.phi_i)
        ti, to, phi, phi_i = (np.ascontiguousarray(a[::4]) for a in angles)
        few = Probes(ti, to, phi, phi_i, self.floor, self.grid)
        return min(few.values(setup, EXACT * tolerance)[1] for _ in range(TIMED))

    def error(self, found: Array, reference: Array) -> float:
        """Return the largest difference (N, C), relative to the largest channel or the floor."""
        scale = np.maximum(np.abs(reference).max(axis=1), self.floor)
        return float((np.abs(found - reference).max(axis=1) / scale).max(initial=0.0))


def probes(grid: Grid, floor: float, count: int, seed: int) -> Probes:
    """Return seeded pairs of directions at positions of a grid; few polar angles, a third near the mirror direction."""
    rng = np.random.default_rng(seed)
    inner = [
        np.unique(np.concatenate([[0, n - 1], rng.integers(0, n, 8)])) for n in (grid.theta_i.size, grid.theta_o.size)
    ]
    ti = grid.theta_i[rng.choice(inner[0], count)]
    to = grid.theta_o[rng.choice(inner[1], count)]
    third = count // 3
    to[:third] = grid.theta_o[np.searchsorted(grid.theta_o, ti[:third]).clip(0, grid.theta_o.size - 1)]
    if grid.phi is not None:
        phi = grid.phi[rng.integers(0, grid.phi.size, count)]
        late = np.minimum(rng.geometric(0.2, third), grid.phi.size)
        phi[:third] = grid.phi[grid.phi.size - late]
        return _without_mirror(Probes(ti, to, phi, np.zeros(count), floor, grid), grid)
    assert grid.phi_i is not None
    assert grid.phi_o is not None
    pi_, po = (a[rng.integers(0, a.size, count)] for a in (grid.phi_i, grid.phi_o))
    return _without_mirror(Probes(ti, to, po - pi_, pi_, floor, grid), grid)


def _without_mirror(found: Probes, grid: Grid) -> Probes:
    """Leave out pairs whose cell holds the mirror direction: it may hold an average instead of a value."""
    cells = np.ravel_multi_index(tuple(grid.mirror_cells().T), grid.shape)
    angles = _at(found, grid)
    place = tuple(np.searchsorted(grid.axes[name], angles[name]) for name in grid.axis_names)
    kept = ~np.isin(np.ravel_multi_index(place, grid.shape), cells)
    if not kept.any():
        # grids of a few cells hold nothing else
        kept[:] = True
    return Probes(found.theta_i[kept], found.theta_o[kept], found.phi[kept], found.phi_i[kept], found.floor, grid)


def _at(found: Probes, grid: Grid) -> dict[str, Array]:
    """Return the pairs' positions by axis, a hair below so that a search finds the position itself."""
    if grid.isotropic:
        angles = {"theta_i": found.theta_i, "theta_o": found.theta_o, "phi": found.phi}
    else:
        phi_o = found.phi + found.phi_i
        angles = {"theta_i": found.theta_i, "phi_i": found.phi_i, "theta_o": found.theta_o, "phi_o": phi_o}
    return {name: a - 1e-9 for name, a in angles.items()}
