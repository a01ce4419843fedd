"""All bounces between the states of a dielectric, mode by mode: a few sweeps of the scattering series.

With A the kernel from a direction of light or view to the states, G that between states, W their weights and J the
reversal of a path (p -> -p), the orders k >= 2 are A W (G W)^(k-2) J A^T. The sum converges fast: G W has a spectral
radius below .1 where light is refracted away, and reflection above is triangular.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import ParameterError
from brdftab.models.smith_multi.dielectric.levels import Level
from brdftab.models.smith_multi.dielectric.modes import ABOVE, BELOW, THROUGH, integrate, largest, lobes
from brdftab.models.smith_multi.dielectric.states import LOWEST, build, one_sided, panel_edges
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array, Index

States = tuple[Array, Array, Index]
Block = Callable[[int, States, States], Array]
# bytes of matrices held at a time, and the most that any tolerance may take
CHUNK, MOST = 1 << 28, 1 << 33
SWEEPS = 60
# orders up to this one are always summed: those that have a name as components, and one that stands for the rest
NAMED = 10


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
    ) -> None:
        self.n, self.ndf, self.alpha, self.level = n, ndf, alpha, level
        self.surface = ndf, alpha, n
        self.views = directions(theta, n)
        required = self.views.p if extra is None else np.concatenate([self.views.p, extra])
        if lowest is None:
            # the azimuth modes of grazing light vary on the scale of its elevation, but not for ever
            lowest = max(float(np.abs(self.views.p).min()), LOWEST)
        self.edges = panel_edges(required, lowest, n, alpha, level)
        self.above, self.below = build(self.edges[:-1], self.edges[1:], n, ndf, alpha, level)
        self.factors = one_sided(level.nodes)
        limits = [self.mode_limit(self.views.p, self.views.s, below) for below in (False, True)]
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

    def low(self, start: int, count: int) -> Block:
        """Return the function that makes blocks of modes start .. start + count - 1."""

        def block(kind: int, a: States, b: States) -> Array:
            out = np.zeros((count, a[0].size, b[0].size))
            rule = self.level.modes, self.level.reach, self.gauss
            integrate(kind, self.surface, *a, *b, self.factors, start, count, *rule, a is b, out)
            return out

        return block

    def lobes(self, orders: Array) -> Block:
        """Return the function that makes blocks of modes of real orders, high and increasing."""

        def block(kind: int, a: States, b: States) -> Array:
            out = np.zeros((orders.size, a[0].size, b[0].size))
            lobes(kind, self.surface, a[0], a[1], b[0], b[1], orders, self.level.reach, self.gauss, out)
            return out

        return block

    def states(self) -> list[States]:
        """Return p, s and panels of the states above and below."""
        return [(side.p, side.s, side.panel) for side in (self.above, self.below)]

    def rows(self, start: int, count: int) -> tuple[Array, Array]:
        """Return modes start .. start + count - 1 from directions to states (count, D, states), above and below."""
        return rows_from(self.views, self.low(start, count), count, self.states())

    def matrices(self, start: int, count: int) -> Matrices:
        """Return modes start .. start + count - 1 of all kernels."""
        states, block = self.states(), self.low(start, count)
        return _matrices(block, states, self.rows(start, count))

    def high(self, orders: Array) -> tuple[Matrices, tuple[Array, Array], Index]:
        """Return modes of real orders, restricted to the states and directions that they concern.

        Also the weights of these states and the numbers of these directions.
        """
        chosen = [self.mode_limit(side.p, side.s, side is self.below) >= orders[0] for side in (self.above, self.below)]
        states = [
            (side.p[kept], side.s[kept], side.panel[kept])
            for side, kept in zip((self.above, self.below), chosen, strict=True)
        ]
        weights = self.above.weights[chosen[0]], self.below.weights[chosen[1]]
        kept = np.flatnonzero(self.limits >= orders[0])
        block, views = self.lobes(orders), self.views
        some = Directions(views.below[kept], views.p[kept], views.s[kept])
        return _matrices(block, states, rows_from(some, block, orders.size, states)), weights, kept

    def mode_limit(self, p: Array, s: Array, below: bool) -> Array:
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


def rows_from(views: Directions, block: Block, count: int, states: list[States]) -> tuple[Array, Array]:
    """Return the kernels (count, D, states) from directions to the states above and below."""
    rows = [np.empty((count, views.p.size, side[0].size)) for side in states]
    for below, kinds in ((False, (ABOVE, THROUGH)), (True, (THROUGH, BELOW))):
        mine = np.flatnonzero(views.below == below)
        p, s = (np.ascontiguousarray(x[mine]) for x in (views.p, views.s))
        source = p, s, np.full(p.size, -1)
        for row, kind, side in zip(rows, kinds, states, strict=True):
            row[:, mine] = block(kind, source, side)
    return rows[0], rows[1]


def _matrices(block: Block, states: list[States], rows: tuple[Array, Array]) -> Matrices:
    """Return all kernels between states, beside the rows of directions."""
    up, down = states
    return Matrices(block(ABOVE, up, up), block(BELOW, down, down), block(THROUGH, up, down), *rows)


def sweep(matrices: Matrices, weights: tuple[Array, Array], upper: Array, lower: Array) -> tuple[Array, Array]:
    """Scatter rows (M, D, states above), (M, D, states below) once more."""
    upper, lower = upper * weights[0], lower * weights[1]
    # from below to above is from above to below with every path reversed
    turned = np.ascontiguousarray(lower[..., ::-1])  # a view of negative strides would keep matmul from BLAS
    crossed = np.matmul(turned, matrices.through.transpose(0, 2, 1))[..., ::-1]
    return (
        np.matmul(upper, matrices.above) + crossed,
        np.matmul(lower, matrices.below) + np.matmul(upper, matrices.through),
    )


def multiple(
    matrices: Matrices,
    weights: tuple[Array, Array],
    lights: Index,
    views: Index,
    layers: int,
    most: float,
    end: float,
    first: int = 2,
) -> Array:
    """Return (layers, M, lights, views): bounce orders 2, 3, ... apart, the last one with all higher ones.

    Parameters
    ----------
    lights, views : int64
        Which directions send and which receive; the fewer ones are the better lights.
    layers : int
        How many layers.
    most : float
        Highest bounce order, inf for all.
    end : float
        The series of a light ends where an order adds less than this part of its largest one.
    first : int
        Bounce orders below are left out.
    """
    upper, lower = matrices.rows_above[:, lights], matrices.rows_below[:, lights]
    exits = [
        np.ascontiguousarray((rows[:, views] * w)[..., ::-1]).transpose(0, 2, 1)
        for rows, w in ((matrices.rows_above, weights[0]), (matrices.rows_below, weights[1]))
    ]
    # the weights are symmetric, so that they may be applied before the reversal
    out = np.zeros((layers, upper.shape[0], lights.size, views.size))
    size, k = np.zeros(lights.size), 2
    total_upper, total_lower = np.zeros_like(upper), np.zeros_like(lower)
    while k <= most:
        if k >= first and k - 2 < layers - 1:
            out[k - 2] = np.matmul(upper, exits[0]) + np.matmul(lower, exits[1])
        elif k >= first:
            total_upper += upper
            total_lower += lower
        now = np.maximum(*(np.abs(rows).max(axis=(0, 2), initial=0.0) for rows in (upper, lower)))
        size = np.maximum(size, now)
        # each light by itself, whatever others do
        ended = (now <= end * size) & (k >= NAMED)
        if ended.all() or k > SWEEPS or k + 1 > most:
            break
        upper, lower = sweep(matrices, weights, upper * ~ended[:, None], lower * ~ended[:, None])
        k += 1
    out[-1] += np.matmul(total_upper, exits[0]) + np.matmul(total_lower, exits[1])
    return out
