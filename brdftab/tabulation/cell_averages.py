"""Cell averages: the mean of f over a cell, weighted by cos(theta) sin(theta) of both directions.

The density of V-grooves goes like 1/sin(theta_h) at the mirror direction. Cells there are integrated around the
singular point in coordinates that take it away: x = (theta_o - theta_i) cos(theta) and y = (phi - pi) sin(theta) make
the singularity 1/hypot(x, y), and y = x sinh(v) in each triangle makes the integrand smooth.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from brdftab.evaluation import delta
from brdftab.evaluation.engine import Engine
from brdftab.quadrature import unit_gauss
from brdftab.tables.grid import Grid
from brdftab.typing import Array

# beyond this polar angle (radians) the half vector turns fast inside a cell, which takes more nodes
GRAZING = 1.48
# values below this (1/sr) are compared absolutely: nothing reflects there
FLOOR = 1e-9


def _triangles(a: float, b: float, nodes: int) -> tuple[Array, Array, Array]:
    """Return x, y and weights over the rectangle [0, a] x [0, b] for integrands like 1/hypot(x, y)."""
    u, wu = unit_gauss(nodes)
    v, wv = unit_gauss(nodes + 2)
    parts: list[tuple[Array, Array, Array]] = []
    for long, short in ((a, b), (b, a)):
        reach = math.asinh(short / long)
        first = long * u[:, None] + 0.0 * v
        second = first * np.sinh(reach * v)
        weight = wu[:, None] * wv * long * first * reach * np.cosh(reach * v)
        parts.append((first, second, weight) if long == a and not parts else (second, first, weight))
    return tuple(np.concatenate([p[k].reshape(-1) for p in parts]) for k in range(3))  # type: ignore[return-value]


def _pair_nodes(
    theta_i: tuple[float, float], theta_o: tuple[float, float], psi: tuple[float, float], nodes: int
) -> tuple[Array, Array, Array, Array]:
    """Return theta_i, theta_o, psi = phi - pi and weights over a pair of cells, graded around the mirror direction.

    The difference d of both angles and psi carry the singularity; their mean runs over a range that is linear in d
    between the breakpoints.
    """
    (a, b), (c, d) = theta_i, theta_o
    cuts = sorted({c - b, c - a, d - b, d - a, 0.0} & set(_inside((c - b, c - a, d - b, d - a, 0.0), c - b, d - a)))
    middle = 0.5 * (max(a, c) + min(b, d))
    sx, sy = max(math.cos(middle), 1e-9), max(math.sin(middle), 1e-9)
    u, wu = unit_gauss(nodes)
    parts = []
    for low, high in itertools.pairwise(cuts):
        for first, last in itertools.pairwise(sorted({psi[0], psi[1], 0.0} & set(_inside((*psi, 0.0), *psi)))):
            far_x, far_y = max(abs(low), abs(high)), max(abs(first), abs(last))
            if (high - low) * (last - first) <= 0.0:
                continue
            if low * high == 0.0 and first * last == 0.0:
                x, y, w = _triangles(far_x * sx, far_y * sy, nodes)
                delta, p = math.copysign(1.0, low + high) * x / sx, math.copysign(1.0, first + last) * y / sy
                weight = w / (sx * sy)
            else:
                delta = np.repeat(low + (high - low) * u, u.size)
                p = np.tile(first + (last - first) * u, u.size)
                weight = np.outer(wu, wu).reshape(-1) * (high - low) * (last - first)
            bottom = np.maximum(a + 0.5 * delta, c - 0.5 * delta)
            length = np.maximum(np.minimum(b + 0.5 * delta, d - 0.5 * delta) - bottom, 0.0)
            mean = bottom[:, None] + length[:, None] * u
            half = 0.5 * delta[:, None]
            full = (weight * length)[:, None] * wu
            parts.append([z.reshape(-1) for z in (mean - half, mean + half, np.repeat(p[:, None], u.size, 1), full)])
    return tuple(np.concatenate([p[k] for p in parts]) for k in range(4))  # type: ignore[return-value]


def _inside(values: tuple[float, ...], low: float, high: float) -> list[float]:
    return [v for v in values if low <= v <= high]


def _edges(grid: Grid, axis: str, index: int) -> tuple[float, float]:
    edge = grid.edges[axis]
    return float(edge[index]), float(edge[index + 1])


def mirror_average(engine: Engine, grid: Grid, cells: NDArray[np.int64], nodes: int) -> Array:
    """Return the averages (K, P, C) over cells that hold the mirror direction; a delta is part of the first component.

    Parameters
    ----------
    engine : Engine
        What evaluates points.
    grid : Grid
        The grid.
    cells : ndarray (K, 3 or 4)
        Indices in the order of the grid's axes.
    nodes : int
        Gauss nodes along each coordinate.
    """
    gathered: list[list[Array]] = []
    owner = []
    u, wu = unit_gauss(max(nodes - 1, 2))
    for number, cell in enumerate(cells):
        count = nodes if grid.edges["theta_i"][cell[0] + 1] < GRAZING else nodes + 4
        ranges = {name: _edges(grid, name, int(k)) for name, k in zip(grid.axis_names, cell, strict=True)}
        azimuths: list[tuple[float, float]] = [(0.0, 1.0)]
        if not grid.isotropic:
            first, last = ranges["phi_i"]
            azimuths = [(first + (last - first) * x, w) for x, w in zip(u, wu, strict=True)]
        for phi_i, w_phi in azimuths:
            for psi in _relative(grid, ranges, phi_i):
                theta_i, theta_o, p, weight = _pair_nodes(ranges["theta_i"], ranges["theta_o"], psi, count)
                weight = weight * w_phi * np.cos(theta_i) * np.sin(theta_i) * np.cos(theta_o) * np.sin(theta_o)
                gathered.append([theta_i, theta_o, math.pi + p, np.full_like(theta_o, phi_i), weight])
                owner.append(np.full(theta_o.size, number))
    ti, to, phi, az, weight = (np.concatenate([g[k] for g in gathered]) for k in range(5))
    index = np.concatenate(owner)
    values = engine.points(ti, to, phi, az)
    total = np.zeros((len(cells), *values.shape[1:]))
    np.add.at(total, index, values * weight[:, None, None])
    mass = np.bincount(index, weights=weight, minlength=len(cells))
    means: Array = total / mass[:, None, None]
    means[:, 0] += delta.cell_averages(engine.setup, grid, cells)
    return means


def _relative(grid: Grid, ranges: dict[str, tuple[float, float]], phi_i: float) -> list[tuple[float, float]]:
    """Return the ranges of psi = phi_o - phi_i - pi of a cell, wrapped around 0 where they hold it."""
    if grid.isotropic:
        low, high = ranges["phi"]
        return [(low - math.pi, high - math.pi)]
    low, high = ranges["phi_o"]
    shift = phi_i + math.pi
    turn = 2.0 * math.pi * round((0.5 * (low + high) - shift) / (2.0 * math.pi))
    return [(low - shift - turn, high - shift - turn)]


def axis_nodes(edges: Array, count: int, polar: bool) -> tuple[Array, Array]:
    """Return nodes (count, N) and weights (count, N) of every cell of an axis; the weights of a cell add up to 1."""
    u, w = unit_gauss(count)
    nodes = edges[None, :-1] + np.diff(edges)[None, :] * u[:, None]
    weights = np.broadcast_to(w[:, None], nodes.shape)
    if polar:
        weights = weights * np.abs(np.cos(nodes)) * np.sin(nodes)
    return nodes, weights / weights.sum(axis=0)
