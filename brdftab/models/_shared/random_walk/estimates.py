"""From sums over paths to values with standard errors: which cells get how many paths, in which order.

Random numbers belong to (seed, row, path), and sums of fixed groups of paths are added in their order, so that neither
the number of threads nor the size of a batch changes a bit of the result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.random_walk.rows import TILE
from brdftab.typing import Array

Whole = NDArray[np.int64]
Progress = Callable[[float], None]
# what draws: (tasks, lights, identities, views, sums, squares), see `rows.draw`
Draw = Callable[[Whole, Array, Whole, Array, Array, Array], None]
# paths whose sum is formed before it is added to the others
GROUP = 4096
# paths a cell of the first round, and where adaptive rounds end
FIRST_ROUND, MOST_PATHS = 128, 1 << 16
# values below this (1/sr) are compared absolutely: nothing reflects there
FLOOR = 1e-9
# numbers that the sums of one batch may hold
_ROOM = 1 << 23


@dataclass(frozen=True)
class Estimates:
    """Values with their statistical errors.

    Attributes
    ----------
    values : ndarray
        1/sr, by component: (N, P, C) at points, (P, *shape, C) on a grid.
    standard_error : ndarray (..., C)
        Standard error of the mean of the sum over all components, a channel.
    component_errors : ndarray
        Standard error of the mean of each component, shape of `values`, with what a quadrature leaves of known ones.
    samples : ndarray (...) of int
        Paths drawn.
    """

    values: Array
    standard_error: Array
    component_errors: Array
    samples: Whole


@dataclass(frozen=True)
class Rows:
    """Cells that are estimated together: those of a row share the direction of light, and walks where these allow it.

    Attributes
    ----------
    lights : ndarray (R, 3)
        Unit vectors towards the light.
    identities : ndarray (R,) of int
        Names of the rows for the random numbers.
    views : ndarray (M, K)
        What the drawing kernel wants to know of each view, grouped by row.
    offsets : ndarray (R + 1,) of int
        Where each row's views begin.
    known : callable
        From a slice of the views to (m, K, C) in 1/sr: the first K components, which need no paths.
    """

    lights: Array
    identities: Whole
    views: Array
    offsets: Whole
    known: Callable[[slice], Array]


def _tasks(offsets: Whole, first: int, last: int) -> Whole:
    """Return tasks (T, 6) over tiles of all rows, each of at most `GROUP` paths in a slot of its own."""
    tiles = -(-np.diff(offsets) // TILE)
    row = np.repeat(np.arange(tiles.size), tiles)
    number = np.arange(row.size) - np.repeat(np.cumsum(tiles) - tiles, tiles)
    low = offsets[row] + number * TILE
    tile = np.stack([row, low, np.minimum(low + TILE, offsets[row + 1])], axis=1)
    starts = np.arange(first, last, GROUP)
    tasks = np.empty((starts.size, len(tile), 6), dtype=np.int64)
    tasks[:, :, 0], tasks[:, :, 3], tasks[:, :, 4] = tile.T
    tasks[:, :, 1] = starts[:, None]
    tasks[:, :, 2] = np.minimum(starts + GROUP, last)[:, None]
    tasks[:, :, 5] = np.arange(starts.size)[:, None]
    return tasks.reshape(-1, 6)


def _round(
    draw: Draw, rows: Rows, active: NDArray[np.bool_], first: int, last: int, sums: Array, squares: Array
) -> None:
    """Draw paths `first` to `last` for the active cells and add them to sums (P, M, W) and squares (Q, M, C)."""
    counts = np.add.reduceat(active, rows.offsets[:-1], dtype=np.int64)
    kept = np.flatnonzero(counts)
    cells = np.flatnonzero(active)
    offsets = np.concatenate([[0], np.cumsum(counts[kept])])
    lights, identities, views = rows.lights[kept], rows.identities[kept], rows.views[cells]
    layers, _, size = sums.shape
    kept, _, channels = squares.shape
    groups = max(1, _ROOM // (cells.size * (layers * size + kept * channels)))
    for start in range(first, last, GROUP * groups):
        tasks = _tasks(offsets, start, min(start + GROUP * groups, last))
        slots = int(tasks[-1, 5]) + 1
        drawn = np.zeros((slots, layers, cells.size, size))
        square = np.zeros((slots, kept, cells.size, channels))
        draw(tasks, lights, identities, views, drawn, square)
        for slot in range(slots):
            sums[:, cells] += drawn[slot]
            squares[:, cells] += square[slot]


def _kept(layers: int) -> int:
    """Return how many sums of squares are kept: of the total, and of each component if there are several."""
    return 1 if layers == 1 else 1 + layers


def _batch(
    draw: Draw, rows: Rows, layers: int, weights: Array, samples: int | None, tolerance: float, done: Progress
) -> tuple[Array, Array, Whole]:
    """Estimate one batch of rows through all its rounds.

    Returns values (M, P, C), errors (Q, M, C) of the total and, if there are several, of each component, counts (M,).
    """
    cells, channels = len(rows.views), weights.shape[1]
    known = rows.known(slice(0, cells))
    # what has no layer of its own goes to the last one
    known = np.concatenate([known[:, : layers - 1], known[:, layers - 1 :].sum(axis=1, keepdims=True)], axis=1)
    sums, squares = np.zeros((layers, cells, len(weights))), np.zeros((_kept(layers), cells, channels))
    count = np.zeros(cells, dtype=np.int64)
    active = np.ones(cells, dtype=np.bool_)
    first, last = 0, FIRST_ROUND if samples is None else samples
    while True:
        _round(draw, rows, active, first, last, sums, squares)
        count[active] = last
        values = np.einsum("pmw,wc->mpc", sums, weights) / count[:, None, None]
        mean = values.sum(axis=1)[None]
        if len(squares) > 1:
            mean = np.concatenate([mean, values.transpose(1, 0, 2)])
        # of a single path nothing but its size is known
        spread = np.maximum(squares / count[:, None] - (mean * mean if last > 1 else 0.0), 0.0)
        error = np.sqrt(spread / np.maximum(count - 1, 1)[:, None])
        values[:, : known.shape[1]] += known
        if samples is not None or last >= MOST_PATHS:
            return values, error, count
        scale = np.maximum(np.abs(values.sum(axis=1)).max(axis=1), FLOOR)
        active = error[0].max(axis=1) > tolerance * scale
        if not active.any():
            return values, error, count
        done(min(1.0, last / MOST_PATHS))
        first, last = last, min(2 * last, MOST_PATHS)


def _part(rows: Rows, low: int, high: int) -> Rows:
    """Return some of the rows."""
    a, b = rows.offsets[low], rows.offsets[high]
    return Rows(
        rows.lights[low:high],
        rows.identities[low:high],
        rows.views[a:b],
        rows.offsets[low : high + 1] - a,
        lambda some: rows.known(slice(a + some.start, a + some.stop)),
    )


def estimate(
    draw: Draw,
    rows: Rows,
    layers: int,
    weights: Array,
    samples: int | None,
    tolerance: float,
    progress: Progress | None = None,
) -> Estimates:
    """Draw paths until every cell has enough of them.

    Parameters
    ----------
    draw : callable
        Adds paths of tasks to sums, see `rows.draw`.
    rows : Rows
        Cells, grouped.
    layers : int
        Components P.
    weights : ndarray (W, C)
        Projection of wavelengths to channels.
    samples : int or None
        Paths a cell. None: in rounds that double the number from 128, until the largest standard error of a cell's
        channels is at most `tolerance` times its largest channel, or 65536 paths are drawn; what is not met shows in
        the standard error. Stopping on the estimate itself leaves a bias well below that error.
    tolerance : float
        Relative.
    progress : callable, optional
        Called with the finished share of the work.

    Returns
    -------
    Estimates
        values (M, P, C), standard_error (M, C), component_errors (M, P, C), samples (M,).
    """
    cells, channels, kept = len(rows.views), weights.shape[1], _kept(layers)
    values, error = np.empty((cells, layers, channels)), np.empty((kept, cells, channels))
    count = np.empty(cells, dtype=np.int64)
    most = max(1, _ROOM // (layers * len(weights) + kept * channels))
    low, total = 0, len(rows.lights)
    while low < total:
        high = int(np.searchsorted(rows.offsets, rows.offsets[low] + max(most, 1), side="right")) - 1
        # a tenth at a time, so that progress shows
        high = min(max(high, low + 1), low + max(64, -(-total // 10)), total)
        part = _part(rows, low, high)
        a, b = rows.offsets[low], rows.offsets[high]

        def done(share: float, a: int = a, b: int = b) -> None:
            if progress is not None:
                progress((a + share * (b - a)) / cells)

        values[a:b], error[:, a:b], count[a:b] = _batch(draw, part, layers, weights, samples, tolerance, done)
        done(1.0)
        low = high
    # a single component is the total
    return Estimates(values, error[0], error[-layers:].transpose(1, 0, 2), count)
