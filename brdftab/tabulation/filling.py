"""Filling a grid with a model's values: at the cells' positions, or as averages over the cells."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from brdftab.evaluation.engine import Engine, Progress
from brdftab.tables.grid import Grid
from brdftab.tabulation.adaptive_cells import box_nodes, cell_averages
from brdftab.tabulation.cell_averages import FLOOR, axis_nodes
from brdftab.tabulation.narrow_lobes import unresolved
from brdftab.typing import Array

# cells are averaged again, by a rule that divides itself, where this many nodes and one less differ by more than so
# many times the tolerance: at kinks the finer rule is off by up to 1.1 times that
DIFFERENCE = 0.7
# but not where one node more changes them by less than so many times the tolerance: they are steep, yet smooth
SETTLED = 0.5
# points for cells that are averaged again: so many a cell of the grid, but not fewer than a small grid may have
POINTS, LEAST_POINTS = 64, {True: 1 << 23, False: 1 << 25}
# share of the work that Gauss nodes common to all cells make up, for the bar that shows progress
COMMON = 0.8


def fill_grid(engine: Engine, grid: Grid, out: NDArray[np.floating], progress: Progress | None) -> None:
    """Fill out (P, *grid, C) with the values at the grid's positions."""
    _fill_at(engine, grid, [grid.axes[name] for name in grid.axis_names], out, progress)


def _fill_at(
    engine: Engine, grid: Grid, axes: list[Array], out: NDArray[np.floating], progress: Progress | None
) -> None:
    if grid.isotropic:
        engine.fill(axes[0], axes[1], axes[2], out, progress)
        return
    incoming = np.stack(np.meshgrid(axes[0], axes[1], indexing="ij"), -1).reshape(-1, 2)
    outgoing = np.stack(np.meshgrid(axes[2], axes[3], indexing="ij"), -1).reshape(-1, 2)
    flat = out.reshape(out.shape[0], len(incoming), len(outgoing), out.shape[-1])
    engine.fill_azimuths(incoming, outgoing, flat, progress)


def _mirrored(engine: Engine, grid: Grid) -> bool:
    """Tell whether one half of the table is the other one."""
    return grid.square and engine.setup.model.reciprocal


def _common(engine: Engine, grid: Grid, nodes: int, progress: Progress | None) -> Array:
    """Return averages (P, *grid, C) by Gauss nodes along every axis, exactly reciprocal on square grids."""
    rules = [axis_nodes(grid.edges[name], nodes, name.startswith("theta")) for name in grid.axis_names]
    total = np.zeros((engine.layers, *grid.shape, len(engine.setup.channels)))
    part = np.empty_like(total)
    picks = list(itertools.product(range(nodes), repeat=len(rules)))
    square = _mirrored(engine, grid)
    half = len(rules) // 2 if not grid.isotropic else 1
    swapped = (0, 2, 1, 3, 4) if grid.isotropic else (0, 3, 4, 1, 2, 5)
    for number, pick in enumerate(picks):
        incoming, outgoing = pick[:half], pick[half : 2 * half]
        if square and outgoing < incoming:
            continue
        _fill_at(engine, grid, [rule[0][p] for rule, p in zip(rules, pick, strict=True)], part, None)
        for axis, (rule, p) in enumerate(zip(rules, pick, strict=True)):
            part *= np.expand_dims(rule[1][p], tuple(k for k in range(part.ndim) if k != axis + 1))
        total += part
        if square and outgoing > incoming:
            total += part.transpose(swapped)
        if progress is not None:
            progress(COMMON * (number + 1) / len(picks))
    return total


def _relative(total: Array, coarser: Array) -> Array:
    """Return the largest channel difference of averages (P, ..., C) over a cell's largest channel, (...)."""
    total, coarser = total.sum(axis=0), coarser.sum(axis=0)
    scale = np.maximum(np.abs(total).max(axis=-1), FLOOR)
    return np.asarray(np.abs(total - coarser).max(axis=-1) / scale)


def fill_averages(
    engine: Engine,
    grid: Grid,
    nodes: int,
    tolerance: float,
    singular: NDArray[np.int64],
    out: NDArray[np.floating],
    progress: Progress | None,
) -> None:
    """Fill out (P, *grid, C) with cell averages, exactly reciprocal on square grids.

    All cells take the same Gauss nodes along every axis. Those that see a narrow mirror lobe, and those where one node
    less makes a difference, are averaged again by a rule that divides itself.

    Parameters
    ----------
    engine : Engine
        What evaluates points.
    grid : Grid
        The grid.
    nodes : int
        Gauss nodes along each axis, at least 2.
    tolerance : float
        Relative error asked of cells that are averaged again.
    singular : ndarray (K, axes)
        Cells with an infinite mirror direction.
    out : ndarray (P, *grid, C)
        Where the averages go.
    progress : callable or None
        Called with the finished share of the work.
    """
    total = _common(engine, grid, nodes, progress)
    doubt = _relative(total, _common(engine, grid, nodes - 1, None))
    lobed = unresolved(engine.setup, grid)
    lobed[tuple(singular.T)] = True
    again = lobed | (doubt > DIFFERENCE * tolerance)
    if _mirrored(engine, grid):
        lobed |= _swapped(grid, lobed)
        again = (again | _swapped(grid, again)) & _lower(grid)
    steep = np.argwhere(again & ~lobed)
    # no budget: every cell is one box
    finer, _ = cell_averages(engine, grid, steep, tolerance, nodes + 1, np.zeros(len(steep), dtype=bool), most=0.0)
    at = (slice(None), *steep.T)
    change = _relative(finer.transpose(1, 0, 2), total[at])
    total[at] = finer.transpose(1, 0, 2)
    doubt[tuple(steep.T)] = change
    again[tuple(steep.T)] = change > SETTLED * tolerance
    cells = np.argwhere(again)
    most = max(LEAST_POINTS[grid.isotropic], POINTS * grid.size)
    # where there are too many, those come first that hold the lobe, then those that the nodes leave the most of
    order = np.argsort(np.where(lobed, -np.inf, -doubt)[tuple(cells.T)], kind="stable")
    narrow = int(np.count_nonzero(lobed[tuple(cells.T)]))
    cells = cells[order[: max(narrow, int(most // box_nodes(grid, tolerance) ** len(grid.shape)))]]
    found, _ = cell_averages(engine, grid, cells, tolerance, lobed=lobed[tuple(cells.T)], most=most)
    total[(slice(None), *cells.T)] = found.transpose(1, 0, 2)
    if _mirrored(engine, grid):
        # weights are multiplied in another order on the other side, which rounds otherwise
        other = total.transpose((0, 2, 1, 3, 4) if grid.isotropic else (0, 3, 4, 1, 2, 5))
        total = np.where(_lower(grid)[None, ..., None], total, other)
    if progress is not None:
        progress(1.0)
    out[:] = total


def _swapped(grid: Grid, of: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return what holds of cells with light and view swapped."""
    return of.transpose((1, 0, 2) if grid.isotropic else (2, 3, 0, 1))


def _lower(grid: Grid) -> NDArray[np.bool_]:
    """Return which cells of a square grid have the view's index at or below the light's."""
    count = grid.shape[0] if grid.isotropic else grid.shape[0] * grid.shape[1]
    half = np.tri(count, dtype=bool)
    if grid.isotropic:
        return np.broadcast_to(half[:, :, None], grid.shape)
    return half.reshape(grid.shape)
