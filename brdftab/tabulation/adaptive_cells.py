"""Averages over single cells by rules that divide themselves where the integrand asks for it.

A cell begins as the pieces that `brdftab.tabulation.narrow_lobes` gives it, which see its mirror lobe however narrow.
Every box of a piece takes Gauss nodes along each coordinate; how fast the Legendre coefficients fall along a coordinate
tells whether the box is divided there.
"""

from __future__ import annotations

import itertools
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from brdftab.evaluation import delta
from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import singular_setup
from brdftab.quadrature import unit_gauss
from brdftab.tables.grid import Grid
from brdftab.tabulation.cell_averages import FLOOR
from brdftab.tabulation.narrow_lobes import Pieces, directions, pieces, unresolved
from brdftab.typing import Array

# Gauss nodes along each coordinate of a box; below the tolerance more of them need fewer points
NODES, MORE, TIGHT = 4, {3: 6, 4: 5}, 3e-4
# levels of division: a box of the last is 1/1024 of its piece along a coordinate
LEVELS = 10
# a box is divided where its own error exceeds this share of what its cell may have
SHARE = 0.25
# points that are evaluated at once, and pieces that are followed at once
AT_ONCE, TOGETHER = 1 << 18, 1 << 12


@lru_cache
def _tops(count: int) -> tuple[Array, Array, Array]:
    """Return Gauss nodes, weights, and what gives the last two Legendre coefficients (count, 2)."""
    x, w = unit_gauss(count)
    legendre = [
        np.polynomial.legendre.Legendre.basis(k)(2.0 * x - 1.0) * w * (2 * k + 1) for k in (count - 2, count - 1)
    ]
    return x, w, np.stack(legendre, axis=-1)


@lru_cache
def _product(count: int, axes: int) -> tuple[Array, Array]:
    """Return nodes (count ** axes, axes) and weights of the unit cube."""
    x, w, _ = _tops(count)
    nodes = np.stack(np.meshgrid(*[x] * axes, indexing="ij"), -1).reshape(-1, axes)
    weights = np.prod(np.stack(np.meshgrid(*[w] * axes, indexing="ij"), -1).reshape(-1, axes), axis=-1)
    return nodes, weights


def _doubts(values: Array, count: int, axes: int) -> Array:
    """Return the error (B, axes) that boxes leave along each coordinate, from values (B, count ** axes).

    With coefficients that fall like a power series the rule's error is the square of the last one or less; kinks make
    them fall so slowly that the exponents are taken smaller.
    """
    _, _, tops = _tops(count)
    _, rest = _product(count, axes - 1)
    total = np.maximum(np.abs(values @ _product(count, axes)[1]), 1e-300)
    found = np.empty((len(values), axes))
    for axis in range(axes):
        cube = values.reshape(len(values), count**axis, count, -1)
        last = np.abs(np.einsum("blnr,nk->blrk", cube, tops)).reshape(len(values), -1, 2)
        even, odd = np.einsum("bmk,m->kb", last, rest) / total
        found[:, axis] = total * np.maximum(np.minimum(odd, 1e6) ** 1.5, np.minimum(even, 1e6) ** 2)
    return found


class _Boxes:
    """Boxes of pieces: which piece, lower corner and size (B, D) in its unit cube."""

    def __init__(self, piece: NDArray[np.int64], low: Array, size: Array) -> None:
        self.piece, self.low, self.size = piece, low, size

    def __len__(self) -> int:
        return len(self.piece)

    def divided(self, axes: NDArray[np.bool_]) -> _Boxes:
        """Return the halves along the axes that are marked (B, D)."""
        piece, low, size = self.piece, self.low, self.size
        for axis in range(axes.shape[1]):
            cut = axes[:, axis]
            size = size.copy()
            size[cut, axis] *= 0.5
            upper = low[cut].copy()
            upper[:, axis] += size[cut, axis]
            piece = np.concatenate([piece, piece[cut]])
            low, size = np.concatenate([low, upper]), np.concatenate([size, size[cut]])
            axes = np.concatenate([axes, axes[cut]])
        return _Boxes(piece, low, size)


def _first(of: Pieces, some: NDArray[np.int64]) -> _Boxes:
    """Return the boxes that some pieces begin with."""
    piece, low, size = [], [], []
    for number in some:
        parts = of.parts[number]
        steps = np.array(list(itertools.product(*(range(n) for n in parts))), dtype=np.float64)
        piece.append(np.full(len(steps), number))
        low.append(steps / parts)
        size.append(np.broadcast_to(1.0 / parts, steps.shape))
    return _Boxes(np.concatenate(piece), np.concatenate(low), np.concatenate(size))


def _evaluated(engine: Engine, grid: Grid, of: Pieces, boxes: _Boxes, count: int) -> tuple[Array, Array, Array]:
    """Return integrals (B, P, C) and projected solid angles (B,) of boxes, and their error by coordinate (B, D)."""
    axes = boxes.low.shape[1]
    nodes, weights = _product(count, axes)
    size = max(1, AT_ONCE // len(nodes))
    parts: list[tuple[Array, Array, Array]] = []
    for start in range(0, len(boxes), size):
        here = slice(start, start + size)
        unit = boxes.low[here, None, :] + boxes.size[here, None, :] * nodes
        *angles, weight = directions(grid, of, boxes.piece[here], unit)
        weight = weight * np.prod(boxes.size[here], axis=1)[:, None]
        values = engine.points(*(np.ascontiguousarray(a).reshape(-1) for a in angles))
        values = values.reshape(*weight.shape, *values.shape[1:]) * weight[..., None, None]
        doubts = _doubts(values.sum(axis=(2, 3)), count, axes) / values.shape[3]
        parts.append((np.einsum("n,bnpc->bpc", weights, values), weight @ weights, doubts))
    integral, mass, doubt = (np.concatenate(p) for p in zip(*parts, strict=True))
    return integral, mass, doubt


def box_nodes(grid: Grid, tolerance: float) -> int:
    """Return the Gauss nodes along each coordinate of a box that averages to a tolerance take."""
    return NODES if tolerance > TIGHT else MORE[len(grid.shape)]


def cell_averages(
    engine: Engine,
    grid: Grid,
    cells: NDArray[np.int64],
    tolerance: float,
    nodes: int | None = None,
    lobed: NDArray[np.bool_] | None = None,
    most: float = np.inf,
) -> tuple[Array, int]:
    """Return averages (K, P, C) over cells, each to a relative tolerance, and the points that it took.

    A delta is part of the first component.

    Parameters
    ----------
    engine : Engine
        What evaluates points.
    grid : Grid
        The grid.
    cells : ndarray (K, 3 or 4)
        Indices in the order of the grid's axes.
    tolerance : float
        Relative error asked of every cell; the boxes of a cell that stay above it are divided up to `LEVELS` times.
    nodes : int, optional
        Gauss nodes along each coordinate of a box; by default `box_nodes`.
    lobed : ndarray of bool (K,), optional
        Cells whose mirror lobe is narrow; known from the grid where not given.
    most : float, optional
        Points at which dividing ends; every batch of pieces has its share.
    """
    setup = engine.setup
    if lobed is None:
        lobed = unresolved(setup, grid)[tuple(cells.T)]
    total = np.zeros((len(cells), engine.layers, len(setup.channels)))
    mass = np.zeros(len(cells))
    points = 0
    if not len(cells):
        return total, points
    count = nodes or box_nodes(grid, tolerance)
    left = most
    of = pieces(setup, grid, cells, lobed, singular_setup(setup) is not None)
    rest = len(of.kind)
    # plain and graded pieces have different maps; a cell is of one kind
    for chosen in (np.flatnonzero(of.kind == 0), np.flatnonzero(of.kind != 0)):
        starts = _batches(of.owner[chosen])
        for first, last in itertools.pairwise(starts):
            share = left * (last - first) / rest
            used = _follow(engine, grid, of, chosen[first:last], tolerance, count, share, total, mass)
            points, left, rest = points + used, left - used, rest - (last - first)
    means: Array = total / mass[:, None, None]
    means[:, 0] += delta.cell_averages(setup, grid, cells)
    return means, points


def _batches(owner: NDArray[np.int64]) -> list[int]:
    """Return where batches of about `TOGETHER` pieces begin and end, no cell in two of them."""
    if not len(owner):
        return []
    firsts = np.flatnonzero(np.diff(owner, prepend=-1))
    starts = [0]
    for at in firsts[1:]:
        if at - starts[-1] >= TOGETHER:
            starts.append(int(at))
    return [*starts, len(owner)]


def _follow(
    engine: Engine,
    grid: Grid,
    of: Pieces,
    some: NDArray[np.int64],
    tolerance: float,
    nodes: int,
    most: float,
    total: Array,
    mass: Array,
) -> int:
    """Add the integrals over some pieces to their cells' `total` and `mass`; returns the points that it took."""
    boxes, points = _first(of, some), 0
    for level in range(LEVELS + 1):
        integral, solid, doubt = _evaluated(engine, grid, of, boxes, nodes)
        points += len(boxes) * nodes ** boxes.low.shape[1]
        owner = of.owner[boxes.piece]
        sums, solids = total.copy(), mass.copy()
        np.add.at(sums, owner, integral)
        np.add.at(solids, owner, solid)
        scale = np.maximum(np.abs(sums.sum(axis=1)).max(axis=1), FLOOR * solids)
        cut = doubt > SHARE * tolerance * scale[owner][:, None]
        kept = ~cut.any(axis=1)
        if level == LEVELS or points > most:
            kept[:] = True
        np.add.at(total, owner[kept], integral[kept])
        np.add.at(mass, owner[kept], solid[kept])
        if kept.all():
            break
        going = ~kept
        boxes = _Boxes(boxes.piece[going], boxes.low[going], boxes.size[going]).divided(cut[going])
    return points
