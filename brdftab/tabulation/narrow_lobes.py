"""Where a mirror lobe is narrower than a cell, and coordinates of such cells in which the lobe is smooth.

The half vector of two directions has the slope tan((theta_o - theta_i)/2) in the plane of incidence and about
tan(theta) sin(psi/2) across, theta the mean polar angle and psi = phi_o - phi_i - pi. A lobe of roughness alpha is thus
2 alpha wide in delta = theta_o - theta_i and 2 alpha/tan(theta) in psi, at every light. Cells near it are cut at
delta = 0 and psi = 0, and delta = s sinh(u), psi = s/tan(theta) sinh(v) make the lobe and its tails smooth in u, v.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.models.resolve import Setup
from brdftab.tables.grid import Grid
from brdftab.typing import Array

HALF_PI = 0.5 * math.pi
# cells that span more than this much of u or v are integrated in these coordinates; three nodes a coordinate leave
# less than 1e-4 of a GGX lobe below it
SPAN = 0.8
# first pieces span this much of u and v; adaptive rules divide them further
PIECE = 1.5
# pieces narrower than this (radians) hold nothing
NOTHING = 1e-13
# a lobe never gets narrower than this (radians), nor wider than the sphere
LEAST, MOST = 1e-10, 1e3
PLAIN, LOBE, FIRST, SECOND = 0, 1, 2, 3


def lobe_scale(setup: Setup) -> float:
    """Return the width in theta_o (radians) of a setup's mirror lobe: twice the least roughness; 2 where it is flat."""
    least = min(setup.alpha_x, setup.alpha_y)
    return 2.0 * least if least > 0.0 else 2.0


@dataclass(frozen=True)
class Pieces:
    """Parts of cells, each the image of a unit cube.

    Attributes
    ----------
    kind : ndarray of int (K,)
        Linear in the angles; graded around the lobe; or the first and second triangle at a singular mirror direction.
    owner : ndarray of int (K,)
        Number of the cell that a piece belongs to.
    polar, azimuth : ndarray (K, 6)
        Interval of the difference, then lower end and upper end of the mean as max(a + k d, b - k d) and
        min(a + k d, b - k d): of theta_o - theta_i and of psi. Plain pieces have the intervals of both angles.
    scale : ndarray (K, 2)
        s of delta and of psi.
    parts : ndarray of int (K, D)
        Boxes to begin with along each coordinate.
    turned : ndarray of bool (K,)
        Both directions lie below the surface.
    """

    kind: NDArray[np.int64]
    owner: NDArray[np.int64]
    polar: Array
    azimuth: Array
    scale: Array
    parts: NDArray[np.int64]
    turned: NDArray[np.bool_]


def _distance(low: Array, high: Array) -> tuple[Array, Array]:
    """Return the least and largest absolute value of intervals."""
    far = np.maximum(np.abs(low), np.abs(high))
    return np.where(low * high <= 0.0, 0.0, np.minimum(np.abs(low), np.abs(high))), far


def _across(grid: Grid) -> tuple[Array, Array]:
    """Return the least and largest |psi| of all cells of the azimuth axes, (P,) or (A, B)."""
    if grid.isotropic:
        edges = grid.edges["phi"]
        return np.maximum(math.pi - edges[1:], 0.0), math.pi - edges[:-1]
    a, b = grid.edges["phi_i"], grid.edges["phi_o"]
    low = b[None, :-1] - a[1:, None] - math.pi
    high = b[None, 1:] - a[:-1, None] - math.pi
    turn = 2.0 * math.pi * np.round(0.5 * (low + high) / (2.0 * math.pi))
    near, far = _distance(low - turn, high - turn)
    return near, np.minimum(far, math.pi)


def _folded(edges: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return both ends of polar cells measured from the surface's own side, and which lie below it."""
    below = edges[:-1] >= HALF_PI - 1e-12
    low = np.where(below, math.pi - edges[1:], edges[:-1])
    high = np.where(below, math.pi - edges[:-1], edges[1:])
    return np.maximum(low, 0.0), np.minimum(high, HALF_PI), below


def _spans(scale: float, near: Array, far: Array, aside: Array) -> Array:
    """Return the range of asinh(x / s) from near to far, s the lobe's width or the distance from it."""
    s = np.hypot(scale, aside)
    return np.arcsinh(far / s) - np.arcsinh(near / s)


def unresolved(setup: Setup, grid: Grid) -> NDArray[np.bool_]:
    """Return which cells (grid.shape) see the mirror lobe or its flanks change too much for a few nodes.

    Parameters
    ----------
    setup : Setup
        Gives the lobe's width.
    grid : Grid
        The cells.
    """
    scale = lobe_scale(setup)
    first, last = _folded(grid.edges["theta_i"]), _folded(grid.edges["theta_o"])
    near_psi, far_psi = _across(grid)
    found = np.zeros(grid.shape, dtype=bool)
    for i in range(grid.shape[0]):
        same = last[2] == first[2][i]
        a, b = first[0][i], first[1][i]
        near, far = _distance(last[0] - b, last[1] - a)
        low, high = 0.5 * (a + last[0]), 0.5 * (b + last[1])
        # the last cell ends where the lobe has no width any more
        steep = np.tan(np.minimum(low + 0.75 * (high - low), HALF_PI - 1e-6))
        shape = (-1, *(1,) * near_psi.ndim)
        y_near = np.tan(low).reshape(shape) * near_psi
        y_far = steep.reshape(shape) * far_psi
        x_near, x_far = near.reshape(shape), far.reshape(shape)
        wide = np.maximum(_spans(scale, x_near, x_far, y_near), _spans(scale, y_near, y_far, x_near)) > SPAN
        wide &= same.reshape(shape)
        if grid.isotropic:
            found[i] = wide
        else:
            found[i] = wide.transpose(1, 0, 2)
    return found


def _differences(first: tuple[float, float], last: tuple[float, float]) -> list[tuple[float, ...]]:
    """Return pieces of a pair of intervals by the difference last - first: its interval, and what bounds the mean."""
    (a, b), (c, d) = first, last
    cuts = sorted({c - b, c - a, d - b, d - a} | ({0.0} if c - b < 0.0 < d - a else set()))
    return [(low, high, a, c, b, d) for low, high in itertools.pairwise(cuts) if high - low > NOTHING]


def _spread(piece: tuple[float, ...], steep: float, scale: float) -> float:
    """Return the range of asinh(steep x / scale) over a piece's interval."""
    near, far = sorted((abs(piece[0]), abs(piece[1])))
    return math.asinh(steep * far / scale) - math.asinh(steep * near / scale)


def pieces(setup: Setup, grid: Grid, cells: NDArray[np.int64], lobed: NDArray[np.bool_], singular: bool) -> Pieces:
    """Return the pieces of some cells.

    Parameters
    ----------
    setup : Setup
        Gives the lobe's width.
    grid : Grid
        The grid.
    cells : ndarray (K, 3 or 4)
        Indices in the order of the grid's axes.
    lobed : ndarray of bool (K,)
        Cells to be graded around the lobe.
    singular : bool
        The density is infinite at the mirror direction.
    """
    names = grid.axis_names
    edges = [grid.edges[name] for name in names]
    width = lobe_scale(setup)
    rows: list[tuple[int, int, tuple[float, ...], tuple[float, ...], tuple[float, float], tuple[int, ...], bool]] = []
    for number, (cell, near) in enumerate(zip(cells.tolist(), lobed.tolist(), strict=True)):
        ends = [(float(e[k]), float(e[k + 1])) for e, k in zip(edges, cell, strict=True)]
        theta_i, theta_o = ends[0], ends[-2]
        one = (1,) * len(names)
        if not near:
            around = ends[2] if grid.isotropic else (*ends[1], *ends[3])
            flat = (*theta_i, *theta_o, 0.0, 0.0)
            rows.append((PLAIN, number, flat, (*around, *(0.0,) * (6 - len(around))), (1.0, 1.0), one, False))
            continue
        below = theta_i[0] >= HALF_PI - 1e-12
        if below:
            theta_i, theta_o = ((math.pi - t[1], math.pi - t[0]) for t in (theta_i, theta_o))
        turns = _azimuths(grid, ends)
        aside = min(min(abs(t[0]), abs(t[1])) for t in turns)
        low, high = 0.5 * (theta_i[0] + theta_o[0]), 0.5 * (theta_i[1] + theta_o[1])
        steep = math.tan(min(low + 0.75 * (high - low), HALF_PI - 1e-6))
        polar = _differences(theta_i, theta_o)
        apart = min(min(abs(d[0]), abs(d[1])) for d in polar)
        scale = (math.hypot(width, aside * math.tan(low)), math.hypot(width, apart))
        for d, t in itertools.product(polar, turns):
            along = max(1, math.ceil(_spread(d, 1.0, scale[0]) / PIECE))
            over = max(1, math.ceil(_spread(t, steep, scale[1]) / PIECE))
            corner = singular and d[0] * d[1] == 0.0 and t[0] * t[1] == 0.0
            for kind in (FIRST, SECOND) if corner else (LOBE,):
                share = (max(along, over), 1, 1) if corner else (along, 1, over)
                rows.append((kind, number, d, t, scale, share if grid.isotropic else (*share, 1), below))
    columns = list(zip(*rows, strict=True))
    return Pieces(
        kind=np.array(columns[0]),
        owner=np.array(columns[1]),
        polar=np.array(columns[2], dtype=np.float64),
        azimuth=np.array(columns[3], dtype=np.float64),
        scale=np.array(columns[4], dtype=np.float64),
        parts=np.array(columns[5]),
        turned=np.array(columns[6]),
    )


def _azimuths(grid: Grid, ends: list[tuple[float, float]]) -> list[tuple[float, ...]]:
    """Return the pieces in psi = phi - pi, wrapped around 0; with three axes the mean stands still."""
    if grid.isotropic:
        low, high = ends[2]
        return [(low - math.pi, min(high - math.pi, 0.0), 0.0, 0.0, 0.0, 0.0)]
    found = []
    # at most a quarter turn each, so that psi holds no second mirror direction
    lights, views = (_quarters(*ends[k]) for k in (1, 3))
    for light, view in itertools.product(lights, views):
        middle = 0.5 * (view[0] + view[1] - light[0] - light[1]) - math.pi
        turn = math.pi + 2.0 * math.pi * round(middle / (2.0 * math.pi))
        found += _differences(light, (view[0] - turn, view[1] - turn))
    return found


def _quarters(low: float, high: float) -> list[tuple[float, float]]:
    """Return an interval in parts of at most a quarter turn."""
    count = max(1, math.ceil((high - low) / HALF_PI - 1e-9))
    return list(itertools.pairwise(np.linspace(low, high, count + 1).tolist()))


def _mean(interval: Array, difference: Array, unit: Array) -> tuple[Array, Array]:
    """Return the mean of two angles at a difference and the length of its range."""
    a, c, b, d = (interval[:, None, k] for k in (2, 3, 4, 5))
    half = 0.5 * difference
    bottom = np.maximum(a + half, c - half)
    length = np.maximum(np.minimum(b + half, d - half) - bottom, 0.0)
    return bottom + length * unit, length


def _stretched(interval: Array, scale: Array, unit: Array) -> tuple[Array, Array]:
    """Return x = +-s sinh(u) on an interval on one side of 0, from its nearer end on, and dx/dunit."""
    first, last = interval[:, 0:1], interval[:, 1:2]
    sign = np.where(first + last < 0.0, -1.0, 1.0)
    near, far = np.minimum(np.abs(first), np.abs(last)), np.maximum(np.abs(first), np.abs(last))
    low, high = np.arcsinh(near / scale), np.arcsinh(far / scale)
    u = low + (high - low) * unit
    return sign * scale * np.sinh(u), scale * np.cosh(u) * (high - low)


def directions(
    grid: Grid, of: Pieces, piece: NDArray[np.int64], unit: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Return theta_i, theta_o, phi, phi_i and weights (B, N) at points of pieces' unit cubes.

    Parameters
    ----------
    grid : Grid
        The grid.
    of : Pieces
        All pieces.
    piece : ndarray of int (B,)
        The piece of each box.
    unit : ndarray (B, N, 3 or 4)
        Points: along delta, mean polar angle, psi, and with four axes the mean azimuth.

    Returns
    -------
    tuple of ndarray (B, N)
        Weights hold the map's Jacobian and cos(theta) sin(theta) of both directions.
    """
    kind, polar, azimuth, scale = of.kind[piece], of.polar[piece], of.azimuth[piece], of.scale[piece]
    if (kind == PLAIN).all():
        found = _plain(grid, polar, azimuth, unit)
    else:
        x, y = unit[..., 0], unit[..., 2]
        first, second = (kind == FIRST)[:, None], (kind == SECOND)[:, None]
        weight = np.where(first | second, x, 1.0)
        x, y = np.where(second, x * y, x), np.where(first, x * y, np.where(second, x, y))
        delta, slope = _stretched(polar, scale[:, 0:1], x)
        mean, length = _mean(polar, delta, unit[..., 1])
        narrow = np.clip(scale[:, 1:2] / np.maximum(np.tan(mean), 1e-300), LEAST, MOST)
        psi, steep = _stretched(azimuth, narrow, y)
        weight = weight * slope * length * steep
        theta_i, theta_o = mean - 0.5 * delta, mean + 0.5 * delta
        phi_i = np.zeros_like(psi)
        if not grid.isotropic:
            middle, reach = _mean(azimuth, psi, unit[..., 3])
            phi_i, weight = middle - 0.5 * psi, weight * reach
        below = of.turned[piece][:, None]
        theta_i, theta_o = (np.where(below, math.pi - t, t) for t in (theta_i, theta_o))
        found = (theta_i, theta_o, math.pi + psi, phi_i, weight)
    theta_i, theta_o, phi, phi_i, weight = found
    weight = weight * np.abs(np.cos(theta_i) * np.cos(theta_o)) * np.sin(theta_i) * np.sin(theta_o)
    return theta_i, theta_o, phi, phi_i, weight


def _plain(grid: Grid, polar: Array, azimuth: Array, unit: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return the directions of pieces that are linear in the angles."""

    def run(first: Array, last: Array, t: Array) -> Array:
        return first[:, None] + (last - first)[:, None] * t

    theta_i, theta_o = run(polar[:, 0], polar[:, 1], unit[..., 0]), run(polar[:, 2], polar[:, 3], unit[..., 1])
    size = (polar[:, 1] - polar[:, 0]) * (polar[:, 3] - polar[:, 2]) * (azimuth[:, 1] - azimuth[:, 0])
    around = run(azimuth[:, 0], azimuth[:, 1], unit[..., 2])
    if grid.isotropic:
        return theta_i, theta_o, around, np.zeros_like(around), np.broadcast_to(size[:, None], around.shape)
    size = size * (azimuth[:, 3] - azimuth[:, 2])
    phi = run(azimuth[:, 2], azimuth[:, 3], unit[..., 3]) - around
    return theta_i, theta_o, phi, around, np.broadcast_to(size[:, None], around.shape)
