"""Shares of texels covered by wide scratches: the noise is asked point by point."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.jit import kernel, parallel_kernel
from brdftab.scratch_layers.lattice import Lattice


@kernel
def _square(x, y, table, low, frame, offsets, reach, top):
    """Return the squared distance of cell coordinates (x, y) to the nearest feature, or top where none is nearer."""
    i, j = math.floor(x), math.floor(y)
    least = top
    for o in range(offsets.shape[0]):
        p, q = offsets[o, 0], offsets[o, 1]
        # cells too far along one of their own axes hold nothing near
        gap_x = i + p - x if p > 0 else x - (i + p + 1)
        gap_y = j + q - y if q > 0 else y - (j + q + 1)
        if (p != 0 and gap_x > reach[0]) or (q != 0 and gap_y > reach[1]):
            continue
        dx = i + p + table[i + p - low[0], j + q - low[1], 0] - x
        dy = j + q + table[i + p - low[0], j + q - low[1], 1] - y
        ex = frame[0, 0] * dx + frame[0, 1] * dy
        ey = frame[1, 0] * dx + frame[1, 1] * dy
        least = min(least, ex * ex + ey * ey)
    return least


@parallel_kernel
def _count(table, low, cells, frame, shift, offsets, reach, d, radius, samples, out):
    """Fill out (S, S) with the share of samples x samples points of each texel within the threshold of a feature.

    A texel whose centre is further from the threshold than its corners are from it, `radius`, is all in or all out;
    radius 0 asks all points.
    """
    size = out.shape[0]
    step = 1.0 / (size * samples)
    weight = 1.0 / (samples * samples)
    top = (d + radius) ** 2
    sure = max(d - radius, 0.0) ** 2
    for row in numba.prange(size):
        for column in range(size):
            u, v = (column + 0.5) / size, (row + 0.5) / size
            x = cells[0, 0] * u + cells[0, 1] * v + shift[0]
            y = cells[1, 0] * u + cells[1, 1] * v + shift[1]
            if radius > 0.0:
                near = _square(x, y, table, low, frame, offsets, reach, top)
                if near >= top or near < sure:
                    out[row, column] = 0.0 if near >= top else 1.0
                    continue
            hits = 0
            for a in range(samples):
                v = (row * samples + a + 0.5) * step
                for b in range(samples):
                    u = (column * samples + b + 0.5) * step
                    x = cells[0, 0] * u + cells[0, 1] * v + shift[0]
                    y = cells[1, 0] * u + cells[1, 1] * v + shift[1]
                    hits += _square(x, y, table, low, frame, offsets, reach, 2.0 * d * d) <= d * d
            out[row, column] = hits * weight


def unrolled(lattice: Lattice, reach: int) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the features (rows, columns, 2) of all cells that the tile meets, and the index of the first one.

    Parameters
    ----------
    lattice : Lattice
    reach : int
        Cells to add on every side.
    """
    corners = lattice.cells @ np.array([[0, 1, 0, 1], [0, 0, 1, 1]])
    low = corners.min(axis=1) - reach
    high = corners.max(axis=1) + 2 + reach
    i = np.arange(low[0], high[0])[:, None]
    j = np.arange(low[1], high[1])[None, :]
    wraps = i // lattice.rows
    return lattice.jitter[i - wraps * lattice.rows, (j - wraps * lattice.step) % lattice.columns], low


def sampled(lattice: Lattice, density: float, size: int, samples: int) -> NDArray[np.float32]:
    """Return covered shares (size, size) from samples x samples points a texel; rows run along v."""
    out = np.empty((size, size), dtype=np.float32)
    # a texel's half diagonals in the frame
    diagonals = lattice.frame @ lattice.cells @ np.array([[0.5, 0.5], [0.5, -0.5]]) / size
    radius = float(np.linalg.norm(diagonals, axis=0).max())
    # texels of many features are never all in or all out
    radius = radius if radius < 1.0 else 0.0
    offsets = lattice.offsets(density + radius)
    reach = (density + radius) * np.linalg.norm(np.linalg.inv(lattice.frame), axis=1)
    table, low = unrolled(lattice, int(np.abs(offsets).max()))
    fixed = table, low, lattice.cells, lattice.frame, lattice.shift, offsets, reach
    _count(*fixed, density, radius, samples, out)
    return out
