"""Shares of texels covered by wide scratches: the noise is asked point by point."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.jit import parallel_kernel
from brdftab.scratches.lattice import Lattice


@parallel_kernel
def _count(table, low, cells, frame, shift, offsets, square, samples, out):
    """Fill out (S, S) with the share of samples x samples points of each texel within the threshold of a feature."""
    size = out.shape[0]
    step = 1.0 / (size * samples)
    weight = 1.0 / (samples * samples)
    for row in numba.prange(size):
        for column in range(size):
            hits = 0
            for a in range(samples):
                v = (row * samples + a + 0.5) * step
                for b in range(samples):
                    u = (column * samples + b + 0.5) * step
                    x = cells[0, 0] * u + cells[0, 1] * v + shift[0]
                    y = cells[1, 0] * u + cells[1, 1] * v + shift[1]
                    i, j = math.floor(x), math.floor(y)
                    for o in range(offsets.shape[0]):
                        k, q = i + offsets[o, 0], j + offsets[o, 1]
                        dx = k + table[k - low[0], q - low[1], 0] - x
                        dy = q + table[k - low[0], q - low[1], 1] - y
                        ex = frame[0, 0] * dx + frame[0, 1] * dy
                        ey = frame[1, 0] * dx + frame[1, 1] * dy
                        if ex * ex + ey * ey <= square:
                            hits += 1
                            break
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
    offsets = lattice.offsets(density)
    table, low = unrolled(lattice, int(np.abs(offsets).max()))
    _count(
        table, low, lattice.cells, lattice.frame, lattice.shift, offsets, density * density, samples, out
    )  # fmt: skip
    return out
