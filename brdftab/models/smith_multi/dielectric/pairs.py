"""Bounces beyond the first between listed pairs of directions, on panels that no direction shapes.

The kernels from a direction jump where p' = p. Two bounces are summed on the common panels and, where one of both
directions lies in a panel, on its parts. For more bounces the rows of a direction are projected: integrated over the
parts of its panel against the polynomials through the panel's nodes. The kernels between states serve all pairs, and no
value depends on what else is asked.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.models.smith_multi.dielectric.levels import Level
from brdftab.models.smith_multi.dielectric.modes import ABOVE, BELOW, THROUGH
from brdftab.models.smith_multi.dielectric.series import TOP, Part, chebyshev
from brdftab.models.smith_multi.dielectric.solve import (
    Block,
    Directions,
    Matrices,
    States,
    System,
    directions,
    multiple,
    rows_from,
)
from brdftab.models.smith_multi.dielectric.states import CLOSE, LOWEST, Side, build
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array, Index

Rows = tuple[Array, Array]
# pairs whose rows are held at a time
GROUP = 64


@dataclass(frozen=True)
class Span:
    """A range of modes: those that are solved, how their kernels are made, and the states that they concern."""

    start: int
    stop: int
    orders: Array
    block: Block
    states: list[States]
    weights: Rows

    @property
    def count(self) -> int:
        """Return how many modes are solved."""
        return self.orders.size


def _spans(core: System, top: float) -> Iterator[Span]:
    """Yield the ranges of modes up to top: chunks of low ones, and octaves, which are whole for every pair."""
    sides = core.above, core.below
    weights = core.above.weights, core.below.weights
    for start, count in core.chunks(0, core.level.modes):
        orders = np.arange(start, start + count, dtype=np.float64)
        yield Span(start, start + count, orders, core.low(start, count), core.states(), weights)
    reached = [core.mode_limit(side.p, side.s, side is core.below) for side in sides]
    start = core.level.modes
    while start <= top:
        orders = chebyshev(start - 0.5, 2 * start - 0.5, core.level.octave)
        # whole panels, on which rows are projected
        kept = [np.isin(x.panel, x.panel[far >= orders[0]]) for x, far in zip(sides, reached, strict=True)]
        states = [(x.p[some], x.s[some], x.panel[some]) for x, some in zip(sides, kept, strict=True)]
        some_weights = core.above.weights[kept[0]], core.below.weights[kept[1]]
        yield Span(start, 2 * start, orders, core.lobes(orders), states, some_weights)
        start *= 2


def _panel(core: System, p: float) -> int:
    """Return the number of the panel of [0, n] that holds |p| inside, -1 if it is an edge."""
    if float(np.abs(core.edges - abs(p)).min()) <= CLOSE:
        return -1
    return int(np.searchsorted(core.edges, abs(p))) - 1


def _parts(core: System, panels: list[int], p: Array) -> tuple[Side, Side]:
    """Return states on the parts into which p cuts panels, of both signs."""
    low, high = [], []
    for panel in sorted(set(panels)):
        a, b = core.edges[panel], core.edges[panel + 1]
        ends = np.unique(np.concatenate([[a, b], np.abs(p)[(np.abs(p) > a) & (np.abs(p) < b)]]))
        low.append(ends[:-1])
        high.append(ends[1:])
    return build(np.concatenate(low), np.concatenate(high), core.n, core.ndf, core.alpha, core.level)


def _states(side: Side, some: NDArray[np.bool_]) -> States:
    """Return some states of a side, in panels of their own."""
    return side.p[some], side.s[some], np.full(int(some.sum()), -2)


def _pick(views: Directions, some: Index) -> Directions:
    return Directions(views.below[some], views.p[some], views.s[some])


def _joined(rows: Rows, weights: Rows, a: Index, b: Index, kept: list[NDArray[np.bool_]] | None = None) -> Array:
    """Return (M, pairs): what passes from directions a to states and on to directions b."""
    total = np.zeros((rows[0].shape[0], a.size))
    for side, (row, weight) in enumerate(zip(rows, weights, strict=True)):
        w = weight if kept is None else weight * kept[side]
        for at in range(a.size):
            total[:, at] += np.einsum("ms,ms->m", row[:, a[at]], (row[:, b[at]] * w)[:, ::-1])
    return total


def _twice(core: System, span: Span, views: Directions, rows: Rows, a: Index, b: Index) -> Array:
    """Return (M, pairs): two bounces between pairs of directions."""
    total = np.zeros((span.count, a.size))
    count = core.edges.size - 1
    for at in range(a.size):
        ends = np.array([a[at], b[at]])
        p = views.p[ends]
        panels = [panel for panel in (_panel(core, x) for x in p) if panel >= 0]
        cut = [x for panel in set(panels) for x in (count - 1 - panel, count + panel)]
        kept = [~np.isin(side[2], cut) for side in span.states]
        one = np.array([at])
        total[:, at] = _joined(rows, span.weights, a[one], b[one], kept)[:, 0]
        if panels:
            sides = _parts(core, panels, p)
            states = [_states(side, np.ones(side.p.size, bool)) for side in sides]
            parts = rows_from(_pick(views, ends), span.block, span.count, states)
            weights = sides[0].weights, sides[1].weights
            total[:, at] += _joined(parts, weights, np.array([0]), np.array([1]))[:, 0]
    return total


def _basis(x: Array, nodes: Array) -> Array:
    """Return (nodes, X): the polynomials through nodes, 1 at one of them each, at places x."""
    out = np.ones((nodes.size, x.size))
    for j in range(nodes.size):
        for k in range(nodes.size):
            if k != j:
                out[j] *= (x - nodes[k]) / (nodes[j] - nodes[k])
    return out


def _project(core: System, span: Span, views: Directions, rows: Rows) -> None:
    """Replace rows in the panel of their own direction, so that sums over states hold its jump."""
    x = unit_gauss(core.level.nodes)[0]
    count = core.edges.size - 1
    for d in range(views.p.size):
        p = float(views.p[d])
        panel = _panel(core, p)
        if panel < 0:
            continue
        a, b = core.edges[panel], core.edges[panel + 1]
        nodes = a + (b - a) * x
        nodes = nodes if p > 0.0 else -nodes[::-1]
        sides = _parts(core, [panel], views.p[d : d + 1])
        mine = [np.sign(side.p) == np.sign(p) for side in sides]
        states = [_states(side, some) for side, some in zip(sides, mine, strict=True)]
        parts = rows_from(_pick(views, np.array([d])), span.block, span.count, states)
        number = count + panel if p > 0.0 else count - 1 - panel
        for k, side in enumerate(sides):
            own = np.flatnonzero(span.states[k][2] == number)
            if own.size:
                measure = side.weights[mine[k]] * _basis(states[k][0], nodes)
                rows[k][:, d, own] = (parts[k][:, 0] @ measure.T) / span.weights[k][own]


def _solve(core: System, pairs: Array, layers: int, first: int, most: float) -> list[Part]:
    """Return the parts of all pairs (K, 2) of polar angles on the panels of one system without directions."""
    blocks = []
    for start in range(0, len(pairs), GROUP):
        theta, place = np.unique(pairs[start : start + GROUP], return_inverse=True)
        views = directions(theta, core.n)
        limit = [core.mode_limit(views.p, views.s, below) for below in (False, True)]
        a, b = place.reshape(-1, 2).T
        far = np.where(views.below, limit[1], limit[0])
        blocks.append((start, views, a, b, np.minimum(far[a], far[b])))
    found = []
    for span in _spans(core, min(max(block[4].max() for block in blocks), TOP)):
        up, down = span.states
        kernels = [(ABOVE, up, up), (BELOW, down, down), (THROUGH, up, down)] if most > 2 else []
        made = [span.block(*ends) for ends in kernels]
        for start, views, a, b, reached in blocks:
            # the states of higher modes hold no others
            some = np.flatnonzero((reached >= span.start) | (span.start < core.level.modes))
            if not some.size:
                continue
            rows = rows_from(views, span.block, span.count, span.states)
            if most > 2:
                _project(core, span, views, rows)
                lights, i = np.unique(a[some], return_inverse=True)
                targets, o = np.unique(b[some], return_inverse=True)
                matrices = Matrices(made[0], made[1], made[2], *rows)
                values = multiple(matrices, span.weights, lights, targets, layers, most, core.level.sweep, first)
                values = values[:, :, i, o]
            else:
                values = np.zeros((layers, span.count, some.size))
                values[0] = _twice(core, span, views, rows, a[some], b[some])
            zero = np.zeros(1, np.int64)
            found.append(Part(span.start, span.stop, span.orders, start + some, zero, values[..., None]))
    return found


def solve_pairs(
    pairs: Array, n: float, ndf: int, alpha: float, levels: tuple[Level, Level], layers: int, most: float
) -> list[Part]:
    """Return the modes of bounce orders 2 and above of pairs of directions, the pairs being the lights of the parts.

    Parameters
    ----------
    pairs : ndarray (K, 2)
        Polar angles, radians, none on the horizon.
    n, ndf, alpha
        Index below, 0 Beckmann or 1 GGX, roughness.
    levels : tuple of Level
        Resolution of two bounces, and of more.
    layers : int
        Orders 2, 3, ... apart, the last one with all higher ones.
    most : float
        Highest bounce order, inf for all.
    """
    found = []
    for first, last, level in ((2, min(most, 2.0), levels[0]), (3, most, levels[1])):
        if last >= first:
            # panels fine enough for light at the horizon: coarser ones for steep pairs would be kernels of their own
            core = System(np.zeros(0), n, ndf, alpha, level, lowest=LOWEST)
            found += _solve(core, pairs, layers, first, last)
    return found
