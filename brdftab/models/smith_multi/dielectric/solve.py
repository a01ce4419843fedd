"""All bounces between the states of a dielectric, mode by mode: a few sweeps of the scattering series.

With A the kernel from a direction of light or view to the states, G that between states, W their weights and J the
reversal of a path (p -> -p), the orders k >= 2 are A W (G W)^(k-2) J A^T. The sum converges fast: G W has a spectral
radius below .1 where light is refracted away, and reflection above is triangular.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import ParameterError
from brdftab.models.microfacet.project import unit_gauss
from brdftab.models.smith_multi.dielectric.levels import Level
from brdftab.models.smith_multi.dielectric.modes import ABOVE, BELOW, THROUGH, integrate, largest, lobes
from brdftab.models.smith_multi.dielectric.states import (
    LOWEST,
    Side,
    build,
    kept_panels,
    one_sided,
    panel_edges,
    split_panels,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]
States = tuple[Array, Array, Index]
# bytes of matrices held at a time, and the most that any tolerance may take
CHUNK, MOST = 1 << 28, 1 << 33
SWEEPS = 60


@dataclass(frozen=True)
class Directions:
    """Directions of light or view, as incident wave vectors.

    Attributes
    ----------
    below : bool (D,)
        Side.
    p, s : float64 (D,)
        Vertical and tangential part of the wave vector of light that arrives from there.
    """

    below: NDArray[np.bool_]
    p: Array
    s: Array


def directions(theta: Array, n: float) -> Directions:
    """Return the directions at polar angles (radians, 0 to pi) for index n below."""
    c = np.cos(theta)
    below = c < 0.0
    index = np.where(below, n, 1.0)
    return Directions(below, -index * c, index * np.abs(np.sin(theta)))


@dataclass(frozen=True)
class Matrices:
    """Modes of all kernels between states, each (M, from, to), and of the rows of directions (M, D, states)."""

    above: Array
    below: Array
    through: Array
    rows_above: Array
    rows_below: Array


@dataclass(frozen=True)
class High:
    """High modes: the kernels, the weights of the states above and below, and the numbers of the directions kept."""

    matrices: Matrices
    weights: tuple[Array, Array]
    kept: Index


class System:
    """The states of one surface and index, ready to be solved mode by mode.

    Parameters
    ----------
    theta : ndarray (D,)
        Polar angles of all directions of light and view, radians, none on the horizon.
    n, ndf, alpha, level
        Index below, 0 Beckmann or 1 GGX, roughness, resolution.
    extra : ndarray, optional
        p where panels shall end, too.
    lowest : float, optional
        Elevation down to which panels become finer; that of the lowest direction if None.
    base : System, optional
        A system of the same surface and level, whose panels are taken and split at the directions: the kernels between
        states that both have are copied from it.

    Raises
    ------
    ParameterError
        If one mode alone takes too much memory.
    """

    def __init__(
        self,
        theta: Array,
        n: float,
        ndf: int,
        alpha: float,
        level: Level,
        extra: Array | None = None,
        lowest: float | None = None,
        base: System | None = None,
    ) -> None:
        self.edges: Array
        self.n, self.ndf, self.alpha, self.level, self.base = n, ndf, alpha, level, base
        self.surface = ndf, alpha, n
        self.views = directions(theta, n)
        required = self.views.p if extra is None else np.concatenate([self.views.p, extra])
        if base is not None:
            self.edges = split_panels(base.edges, required)
        else:
            if lowest is None:
                lowest = max(float(np.abs(self.views.p).min()), LOWEST)
            self.edges = panel_edges(required, lowest, n, alpha, level)
        self.above, self.below = build(self.edges, n, ndf, alpha, level)
        self._copied: list[Index] | None = None
        if base is not None:
            panels = kept_panels(self.edges, base.edges)
            sides = (self.above, base.above), (self.below, base.below)
            self._copied = [_copied(mine, theirs, panels, level.nodes) for mine, theirs in sides]
        self.factors = one_sided(level.nodes)
        self._reached = [self._mode_limit(side.p, side.s, side is self.below) for side in (self.above, self.below)]
        limits = [self._mode_limit(self.views.p, self.views.s, below) for below in (False, True)]
        self.limits = np.where(self.views.below, limits[1], limits[0])
        self.gauss = np.ascontiguousarray(unit_gauss(level.azimuths))
        states = self.above.p.size + self.below.p.size
        self.bytes = 8 * states * (states + 2 * theta.size)
        if self.bytes > MOST:
            raise ParameterError(
                f"tolerance needs {states} states of light for alpha = {alpha:g}, {self.bytes / 2**30:.0f} GiB a mode; "
                "use a larger tolerance, fewer polar angles, or estimator = pt"
            )

    def chunks(self, start: int, stop: int) -> Iterator[tuple[int, int]]:
        """Yield ranges (first, number) of modes whose matrices fit in memory together."""
        size = max(int(CHUNK // self.bytes), 1)
        for first in range(start, stop, size):
            yield first, min(size, stop - first)

    def _low(self, start: int, count: int) -> Callable[..., Array]:
        """Return the function that makes blocks of modes start .. start + count - 1."""

        def block(kind: int, a: States, b: States) -> Array:
            out = np.zeros((count, a[0].size, b[0].size))
            rule = self.level.modes, self.level.reach, self.gauss
            integrate(kind, self.surface, *a, *b, self.factors, start, count, *rule, a is b, out)
            return out

        return block

    def _states(self) -> list[States]:
        return [(side.p, side.s, side.panel) for side in (self.above, self.below)]

    def rows(self, start: int, count: int) -> tuple[Array, Array]:
        """Return modes start .. start + count - 1 from directions to states (count, D, states), above and below."""
        return self._rows(self._low(start, count), count, self._states(), np.arange(self.views.p.size))

    def matrices(self, start: int, count: int, shared: Matrices | None = None) -> Matrices:
        """Return modes start .. start + count - 1 of all kernels; `shared` are those of the base."""
        states, block = self._states(), self._low(start, count)
        rows = self.rows(start, count)
        if self._copied is None or shared is None:
            return _matrices(block, states, rows)
        return _completed(block, states, rows, self._copied, shared)

    def _chosen(self, order: float) -> list[NDArray[np.bool_]]:
        """Tell which states above and below reach a mode."""
        return [reached >= order for reached in self._reached]

    def high(self, orders: Array, shared: Matrices | None = None, rows_only: bool = False) -> High:
        """Return modes of real orders, restricted to the states and directions that they concern.

        `shared` are those of the base; with `rows_only` the kernels between states are left out.
        """

        def block(kind: int, a: States, b: States) -> Array:
            out = np.zeros((orders.size, a[0].size, b[0].size))
            lobes(kind, self.surface, a[0], a[1], b[0], b[1], orders, self.level.reach, self.gauss, out)
            return out

        chosen = self._chosen(orders[0])
        states = [
            (side.p[kept], side.s[kept], side.panel[kept])
            for side, kept in zip((self.above, self.below), chosen, strict=True)
        ]
        weights = self.above.weights[chosen[0]], self.below.weights[chosen[1]]
        kept = np.flatnonzero(self.limits >= orders[0])
        rows = self._rows(block, orders.size, states, kept)
        if rows_only:
            return High(rows_alone(rows), weights, kept)
        if self._copied is None or self.base is None or shared is None:
            return High(_matrices(block, states, rows), weights, kept)
        copied = []
        for at, mine, theirs in zip(self._copied, chosen, self.base._chosen(orders[0]), strict=True):
            number = np.where(theirs, np.cumsum(theirs) - 1, -1)
            copied.append(np.where(at >= 0, number[at], -1)[mine])
        return High(_completed(block, states, rows, copied, shared), weights, kept)

    def _rows(self, block: Callable[..., Array], count: int, states: list[States], kept: Any) -> tuple[Array, Array]:
        """Return the kernels from the directions that are kept to the states."""
        views = self.views
        rows = [np.empty((count, kept.size, side[0].size)) for side in states]
        for below, kinds in ((False, (ABOVE, THROUGH)), (True, (THROUGH, BELOW))):
            mine = np.flatnonzero(views.below[kept] == below)
            p, s = (np.ascontiguousarray(x[kept[mine]]) for x in (views.p, views.s))
            source = p, s, np.full(p.size, -1)
            for row, kind, side in zip(rows, kinds, states, strict=True):
                row[:, mine] = block(kind, source, side)
        return rows[0], rows[1]

    def _mode_limit(self, p: Array, s: Array, below: bool) -> Array:
        """Return the mode up to which the lobes of states reach: their mirror image's and their refraction's."""
        q = (self.n - 1.0) * (self.n + 1.0)
        size = np.abs(p)
        if below:
            step = np.where(size * size > q, size - np.sqrt(np.maximum(size * size - q, 0.0)), np.inf)
        else:
            step = np.sqrt(q + size * size) - size
        steps = np.minimum(step, 2.0 * size)
        reach = self.level.reach
        return np.array([largest(self.ndf, self.alpha, a, 0.0, b * b, reach)[1] for a, b in zip(steps, s, strict=True)])


def _copied(mine: Side, theirs: Side, panels: Index, nodes: int) -> Index:
    """Return the number among their states of each of my states, -1 for new ones; panels as `kept_panels` tells."""
    panel = panels[mine.panel]
    return np.where(panel >= 0, np.searchsorted(theirs.panel, panel) + np.arange(mine.p.size) % nodes, -1)


def _runs(copied: Index) -> list[tuple[slice, slice]]:
    """Return ranges of states and the ranges that they are copied from."""
    ends = np.flatnonzero(np.diff(copied, append=-2) != 1) + 1
    starts = np.concatenate([[0], ends[:-1]])
    return [
        (slice(a, b), slice(copied[a], copied[a] + b - a)) for a, b in zip(starts, ends, strict=True) if copied[a] >= 0
    ]


def _completed(
    block: Callable[..., Array], states: list[States], rows: tuple[Array, Array], copied: list[Index], shared: Matrices
) -> Matrices:
    """Return all kernels between states, most of them copied; those of new states are made."""
    new = [np.flatnonzero(at < 0) for at in copied]
    fresh = [tuple(x[some] for x in side) for side, some in zip(states, new, strict=True)]
    runs = [_runs(at) for at in copied]

    def copy(source: Array, a: int, b: int) -> Array:
        out = np.zeros((source.shape[0], copied[a].size, copied[b].size))
        for mine, theirs in runs[a]:
            for my_column, their_column in runs[b]:
                out[:, mine, my_column] = source[:, theirs, their_column]
        return out

    def square(kind: int, side: int, source: Array) -> Array:
        out, last = copy(source, side, side), copied[side].size - 1
        made = block(kind, fresh[side], states[side])
        out[:, new[side]] = made
        # each path reversed: from -b to -a as from a to b
        out[:, :, last - new[side]] = made.transpose(0, 2, 1)[:, ::-1]
        return out

    through = copy(shared.through, 0, 1)
    through[:, new[0]] = block(THROUGH, fresh[0], states[1])
    through[:, :, new[1]] = block(THROUGH, states[0], fresh[1])
    return Matrices(square(ABOVE, 0, shared.above), square(BELOW, 1, shared.below), through, *rows)


def rows_alone(rows: tuple[Array, Array]) -> Matrices:
    """Return the rows of directions without kernels between states."""
    none = np.zeros((0, 0, 0))
    return Matrices(none, none, none, *rows)


def _matrices(block: Callable[..., Array], states: list[States], rows: tuple[Array, Array]) -> Matrices:
    """Return all kernels between states, beside the rows of directions."""
    up, down = states
    return Matrices(block(ABOVE, up, up), block(BELOW, down, down), block(THROUGH, up, down), *rows)


def sweep(matrices: Matrices, weights: tuple[Array, Array], upper: Array, lower: Array) -> tuple[Array, Array]:
    """Scatter rows (M, D, states above), (M, D, states below) once more."""
    upper, lower = upper * weights[0], lower * weights[1]
    # from below to above is from above to below with every path reversed
    crossed = np.matmul(lower[..., ::-1], matrices.through.transpose(0, 2, 1))[..., ::-1]
    return (
        np.matmul(upper, matrices.above) + crossed,
        np.matmul(lower, matrices.below) + np.matmul(upper, matrices.through),
    )


def multiple(
    matrices: Matrices,
    weights: tuple[Array, Array],
    lights: NDArray[np.int64],
    views: NDArray[np.int64],
    layers: int,
    most: float,
    end: float,
    first: int = 2,
) -> Array:
    """Return (layers, M, lights, views): bounce orders 2, 3, ... apart, the last one with all higher ones.

    Orders below `first` are left out.

    Parameters
    ----------
    lights, views : int64
        Which directions send and which receive; the fewer ones are the better lights.
    layers : int
        How many layers.
    most : float
        Highest bounce order, inf for all.
    end : float
        The series ends where an order adds less than this part of the sum.
    """
    upper, lower = matrices.rows_above[:, lights], matrices.rows_below[:, lights]
    exits = [
        np.ascontiguousarray((rows[:, views] * w)[..., ::-1]).transpose(0, 2, 1)
        for rows, w in ((matrices.rows_above, weights[0]), (matrices.rows_below, weights[1]))
    ]
    # the weights are symmetric, so that they may be applied before the reversal
    out = np.zeros((layers, upper.shape[0], lights.size, views.size))
    size, k = 0.0, 2
    total_upper, total_lower = np.zeros_like(upper), np.zeros_like(lower)
    while k <= most:
        if k < first:
            pass
        elif k - 2 < layers - 1:
            out[k - 2] = np.matmul(upper, exits[0]) + np.matmul(lower, exits[1])
        else:
            total_upper += upper
            total_lower += lower
        now = max(float(np.abs(upper).max(initial=0.0)), float(np.abs(lower).max(initial=0.0)))
        size = max(size, now)
        if now <= end * size or k > SWEEPS or k + 1 > most:
            break
        upper, lower = sweep(matrices, weights, upper, lower)
        k += 1
    out[-1] = np.matmul(total_upper, exits[0]) + np.matmul(total_lower, exits[1])
    return out
