"""How many positions a table of three axes needs: two slabs tell which ones interpolation gives back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import has_mirror_averages
from brdftab.scene.cubic import choose, largest, to_log
from brdftab.scene.interpolation import EVEN, expanded
from brdftab.scene.plan import Plan, added_up, once
from brdftab.scene.subgrid import part
from brdftab.tables.axis import TWO_PI
from brdftab.tables.grid import Grid
from brdftab.tables.table import Table
from brdftab.tabulation.filling import fill_grid
from brdftab.timing import Clock
from brdftab.typing import Array

# least polar angles of the light and of the view, and azimuths, on which lines are drawn, and cells of a slab below
# which there are more: of coarse grids everything is looked at
ROWS, COLUMNS, AZIMUTHS, CELLS = 5, 18, 5, 16_000
# how much denser azimuths gather at the mirror side, where highlights are
MIRRORED = 3.0
# axes share what interpolation may cost; a part is kept back
AXES = 4.0
# lines that the choice looks at: at each position those that bend most, a few more at random
BENT, MORE = 2, 32
AROUND = ("phi_i", "phi_o")
# positions of each axis whose cells are timed where no slab was
PACED = 6


@dataclass(frozen=True)
class Kept:
    """Positions that are computed.

    Attributes
    ----------
    grid : Grid
        The part of the grid.
    apart : int
        Last azimuths that hold averages of cells.
    error : float
        Sum over the axes of the largest error on any line, relative.
    rate, step : float
        Seconds of a fill a cell, and a pair of polar angles.
    """

    grid: Grid
    apart: int
    error: float
    rate: float
    step: float


def spread(count: int, least: int, power: float = 1.5) -> NDArray[np.int64]:
    """Return up to `least` indices, the ends among them, the upper end denser by a power."""
    share = 1.0 - (1.0 - np.linspace(0.0, 1.0, min(least, count))) ** power
    return np.unique(np.round(share * (count - 1)).astype(np.int64))


def _lines(least: int, cells: int) -> int:
    """Return how many lines are drawn, of which each takes so many cells."""
    return max(least, CELLS // cells)


def slab(engine: Engine, grid: Grid, picked: dict[str, NDArray[np.int64]], dtype: str) -> Array:
    """Return values (*grid, C) at some positions of each axis, computed as a table of that type is."""
    some = part(grid, picked)
    out = np.empty((engine.layers, *some.shape, len(engine.setup.channels)), dtype)
    fill_grid(engine, some, out, None)
    return out.sum(axis=0, dtype=np.float64)


def bent(lines: Array, floor: float, times: int) -> Array:
    """Return logs (N, L) of lines (N, M, C), the largest channel: those that bend most at any position, and others."""
    logs = to_log(largest(lines), floor)
    most, more = times * BENT, times * MORE
    if logs.shape[0] < 3 or logs.shape[1] <= most * logs.shape[0] + more:
        return logs
    bend = np.abs(np.diff(logs, 2, axis=0))
    bent = np.argpartition(bend, -most, axis=1)[:, -most:]
    others = np.random.default_rng(0).integers(0, logs.shape[1], more)
    return logs[:, np.union1d(bent, others)]


def keep(engine: Engine, grid: Grid, tolerance: float, floor: float, dtype: str, times: int = 1) -> Kept:
    """Choose the positions of an isotropic grid between which cubics in log f meet a tolerance.

    Parameters
    ----------
    engine : Engine
        Of the reduced setup.
    grid : Grid
        Positions that lights and camera reach.
    tolerance : float
        Relative error that interpolation may cause.
    floor : float
        1/sr.
    dtype : str
        Type of the table.
    times : int
        So many times as many lines are looked at.

    Notes
    -----
    Lines along theta cross all lights, views and five azimuths, the mirror side among them; lines along phi cross five
    lights, their mirror views and others. Where the mirror direction is singular, polar angles are all kept, and the
    last azimuth, whose cells hold averages, stands apart.
    """
    assert grid.phi is not None
    allowed = tolerance / AXES
    singular = has_mirror_averages(engine.setup)
    apart = 1 if singular and grid.cell == "center" and grid.phi.size > 2 else 0
    rows = spread(grid.theta_i.size, times * _lines(ROWS, COLUMNS * grid.phi.size))
    views = spread(grid.theta_o.size, times * _lines(COLUMNS, rows.size * grid.phi.size // times))
    lights = with_mirror_views(grid, {"theta_i": rows, "theta_o": views})
    columns = lights["theta_o"]
    few = {name: np.arange(min(2, axis.size)) for name, axis in grid.axes.items()}
    once(f"fill of {engine.setup.model.name}, {engine.is_fast}", lambda: slab(engine, grid, few, dtype))
    clock = Clock()
    across = slab(engine, grid, lights, dtype)
    slabs = [(across[..., 0].size, rows.size * columns.size, clock.seconds)]
    kept, error = {}, 0.0
    lines = np.moveaxis(across, 2, 0).reshape(grid.phi.size, -1, across.shape[-1])
    kept["phi"], worst = choose(grid.phi, bent(lines, floor, times), allowed, even=EVEN["phi"], apart=apart)
    error += worst
    if not singular:
        clock = Clock()
        azimuths = spread(grid.phi.size, times * _lines(AZIMUTHS, grid.theta_i.size * grid.theta_o.size), MIRRORED)
        along = slab(engine, grid, {"phi": azimuths}, dtype)
        pairs = grid.theta_i.size * grid.theta_o.size
        if grid.square and engine.setup.model.reciprocal:
            pairs = (pairs + grid.theta_i.size) // 2
        slabs.append((azimuths.size * pairs, pairs, clock.seconds))
        for axis, name in enumerate(("theta_i", "theta_o")):
            lines = np.moveaxis(along, axis, 0).reshape(along.shape[axis], -1, along.shape[-1])
            kept[name], worst = choose(grid.axes[name], bent(lines, floor, times), allowed)
            error += worst
        if grid.square:
            kept["theta_i"] = kept["theta_o"] = np.union1d(kept["theta_i"], kept["theta_o"])
    return Kept(part(grid, kept), apart, error, *_cost(slabs))


def _cost(slabs: list[tuple[int, int, float]]) -> tuple[float, float]:
    """Return the seconds of a fill a cell and a pair of polar angles, from slabs of (cells, pairs, seconds)."""
    (n, p, s), (m, q, t) = slabs[0], slabs[-1]
    across = float(n * q - m * p)
    if across != 0.0:
        rate, step = (s * q - t * p) / across, (t * n - s * m) / across
        if rate >= 0.0 and step >= 0.0:
            return rate, step
    cells, pairs = [slab[2] / slab[0] for slab in slabs], [slab[2] / slab[1] for slab in slabs]
    # one of the two alone, by which the slabs differ less
    if max(pairs) * min(cells) < max(cells) * min(pairs):
        return 0.0, sum(pairs) / len(pairs)
    return sum(cells) / len(cells), 0.0


def pace(engine: Engine, grid: Grid, dtype: str) -> float:
    """Return the seconds of a fill a cell, from a few positions of every axis, but all relative azimuths."""
    some = {name: spread(axis.size, PACED) for name, axis in grid.axes.items() if name != "phi"}
    few = {name: np.arange(min(2, axis.size)) for name, axis in grid.axes.items()}
    once(f"fill of {engine.setup.model.name}, {len(grid.shape)} axes", lambda: slab(engine, grid, few, dtype))
    clock = Clock()
    values = slab(engine, grid, some, dtype)
    return clock.seconds / values[..., 0].size


def largest_error(engine: Engine, table: Table, plan: Plan, seed: int) -> float:
    """Return the largest error of looked-up values on a slab of the full grid that the choice did not see.

    It crosses other lights and views, all azimuths; cells that may hold averages are left out.
    """
    full = plan.full
    assert full is not None
    picked = _others(full, np.random.default_rng(seed))
    right = added_up(slab(engine, full, picked, plan.dtype), plan.luminance)
    found = expanded(table, full, picked)
    if plan.apart:
        right, found = right[:, :, : -plan.apart], found[:, :, : -plan.apart]
    scale = np.maximum(largest(np.abs(right)), plan.floor)
    return float((largest(np.abs(found - right)) / scale).max(initial=0.0))


def _others(full: Grid, rng: np.random.Generator) -> dict[str, NDArray[np.int64]]:
    """Return positions of a slab: lights and views at random, the lights' mirror views, azimuths all or at random."""
    azimuths = {} if full.isotropic else {name: _some(full.axes[name].size, AZIMUTHS, rng) for name in AROUND}
    around = full.axes["phi"].size if full.isotropic else math.prod(a.size for a in azimuths.values())
    rows = _lines(ROWS, COLUMNS * around)
    picked = {
        "theta_i": _some(full.theta_i.size, rows, rng),
        "theta_o": _some(full.theta_o.size, _lines(COLUMNS, rows * around), rng),
        **azimuths,
    }
    return with_mirror_views(full, picked)


def _some(count: int, most: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return indices at random, increasing, no more than there are."""
    return np.sort(rng.choice(count, min(most, count), replace=False))


def with_mirror_views(grid: Grid, picked: dict[str, NDArray[np.int64]]) -> dict[str, NDArray[np.int64]]:
    """Return picked positions with the views that mirror the picked lights."""
    size = grid.theta_o.size
    across = np.searchsorted(grid.theta_o, grid.theta_i[picked["theta_i"]]).clip(0, size - 1)
    picked = picked | {"theta_o": np.union1d(picked["theta_o"], across)}
    if grid.phi_i is None or grid.phi_o is None:
        return picked
    behind = np.searchsorted(grid.phi_o, np.mod(grid.phi_i[picked["phi_i"]] + math.pi, TWO_PI)) % grid.phi_o.size
    return picked | {"phi_o": np.union1d(picked["phi_o"], behind)}
