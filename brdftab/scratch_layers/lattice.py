"""Features of Worley noise on a tile that repeats, in the stretched and turned frame of a scratch layer.

The paper's frame is y = S^-1 R(-angle) x with S = diag(length, width): turned first, then stretched (Eq. 7 as printed
turns after it has stretched, which leaves isotropic noise as it is). A layer's noise has one feature a unit cell of y.
So that the tile repeats, cells follow the nearest integer matrix instead, with exactly |det| of them on the tile; all
distances stay those of the true frame, so that neither angle nor length nor width is rounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.errors import ParameterError
from brdftab.jit import parallel_kernel
from brdftab.scratch_layers.areas import FARTHEST
from brdftab.typing import Array

MOST = 40_000_000
# features and directions that the covered area is measured with
PROBED, ANGLES = 16384, 24


@dataclass(frozen=True, eq=False)
class Lattice:
    """Features of one layer on the unit tile.

    Attributes
    ----------
    cells : int64 (2, 2)
        y = cells x + shift are cell coordinates of a point x = (u, v) of the tile.
    frame : float64 (2, 2)
        From cell coordinates to the frame where scratches are discs; close to 1.
    shift : float64 (2,)
        Random offset, in cells.
    rows, step, columns : int
        Cell (i, j) is the same as (i - rows, j - step) and (i, j - columns); rows * columns cells differ.
    jitter : float32 (rows, columns, 2)
        Place of the feature in its cell, in [0, 1).
    """

    cells: NDArray[np.int64]
    frame: Array
    shift: Array
    rows: int
    step: int
    columns: int
    jitter: NDArray[np.float32]

    @property
    def count(self) -> int:
        """Number of features on the tile."""
        return self.rows * self.columns

    def offsets(self, reach: float) -> NDArray[np.int64]:
        """Return (N, 2) the cells, relative to one cell, that have points within `reach` of it, nearest first.

        The cell itself comes first.
        """
        inverse = np.linalg.inv(self.frame)
        most = np.ceil(np.abs(inverse) @ np.array([reach, reach])).astype(int) + 1
        i, j = np.meshgrid(np.arange(-most[0], most[0] + 1), np.arange(-most[1], most[1] + 1), indexing="ij")
        found = np.stack([i.ravel(), j.ravel()], axis=-1)
        # two cells' differences fill a parallelogram around the offset; its edges hold the nearest point
        edge = np.linspace(-1.0, 1.0, 33)
        one = np.ones_like(edge)
        rim = np.concatenate([np.stack(pair, -1) for pair in ((edge, one), (edge, -one), (one, edge), (-one, edge))])
        gap = np.linalg.norm((found[:, None, :] + rim) @ self.frame.T, axis=-1).min(axis=1)
        gap[np.abs(found).max(axis=1) <= 1] = 0.0
        far = np.linalg.norm(found @ self.frame.T, axis=-1)
        order = np.argsort(far, kind="stable")
        # the rim is sampled: allow for what lies between two samples
        return found[order][(gap <= reach + 0.05)[order]].astype(np.int64)

    def positions(self) -> Array:
        """Return (rows * columns, 2) the features' places (u, v) on the tile, in [0, 1)."""
        i, j = np.meshgrid(np.arange(self.rows), np.arange(self.columns), indexing="ij")
        y = np.stack([i, j], axis=-1) + self.jitter - self.shift
        return np.mod(y.reshape(-1, 2) @ np.linalg.inv(self.cells).T, 1.0)


def frame_of(length: float, width: float, angle: float) -> Array:
    """Return S^-1 R(-angle), the matrix that makes unit noise cells of scratches along `angle` (radians)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c / length, s / length], [-s / width, c / width]])


def _integers(frame: Array) -> NDArray[np.int64]:
    """Return the integer matrix with positive determinant that is nearest to a frame in the frame's own measure."""
    count = max(abs(np.linalg.det(frame)), 1.0)
    best, least = np.eye(2, dtype=np.int64), math.inf
    lows = np.floor(frame[0]).astype(int)
    for a in range(lows[0] - 1, lows[0] + 3):
        for b in range(lows[1] - 1, lows[1] + 3):
            # rows of the lattice this far apart ask for so much more or less of the other to keep the count
            share = a * frame[1, 1] - b * frame[1, 0]
            if share <= 0.0:
                continue
            c0, d0 = np.rint(frame[1] * count / share).astype(int)
            for c in (c0 - 1, c0, c0 + 1):
                for d in (d0 - 1, d0, d0 + 1):
                    size = a * d - b * c
                    if size <= 0:
                        continue
                    found = np.array([[a, b], [c, d]], dtype=np.int64)
                    odd = frame @ np.linalg.inv(found)
                    cost = float(((odd - np.eye(2)) ** 2).sum()) + 4.0 * (size / count - 1.0) ** 2
                    if cost < least:
                        best, least = found, cost
    return best


def _bezout(a: int, b: int) -> tuple[int, int, int]:
    """Return g, x, y with a x + b y = g, the greatest common divisor, g > 0."""
    x, y, u, v = 1, 0, 0, 1
    while b:
        q = a // b
        a, b, x, y, u, v = b, a - q * b, u, v, x - q * u, y - q * v
    return (a, x, y) if a > 0 else (-a, -x, -y)


def build(length: float, width: float, angle: float, rng: np.random.Generator) -> Lattice:
    """Draw the features of a layer.

    Parameters
    ----------
    length, width : float
        Mean length and width of a noise cell, in tiles, in (0, 1].
    angle : float
        Direction of the scratches against u, radians.
    rng : numpy.random.Generator

    Raises
    ------
    ParameterError
        If the tile would hold more than `MOST` features.
    """
    if 1.0 / (length * width) > MOST:
        raise ParameterError(
            f"width = {width:g} with length = {length:g} makes {1.0 / (length * width):.3g} scratches a layer; "
            f"at most {MOST:.3g} fit: make the scratches longer or wider"
        )
    true = frame_of(length, width, angle)
    cells = _integers(true)
    (a, b), (c, d) = cells.tolist()
    rows, x, y = _bezout(a, b)
    columns = (a * d - b * c) // rows
    return Lattice(
        cells,
        true @ np.linalg.inv(cells),
        rng.random(2),
        rows,
        (c * x + d * y) % columns,
        columns,
        rng.random((rows, columns, 2), dtype=np.float32),
    )


@parallel_kernel
def _reaches(jitter, step, frame, offsets, chosen, angles, top, out):
    """Fill out (N, A) with the distance from each chosen feature to the end of its Voronoi cell, at most `top`."""
    rows, columns = jitter.shape[0], jitter.shape[1]
    for n in numba.prange(chosen.size):
        i, j = chosen[n] // columns, chosen[n] % columns
        px, py = float(jitter[i, j, 0]), float(jitter[i, j, 1])
        for m in range(angles):
            out[n, m] = top
        for o in range(1, offsets.shape[0]):
            k = i + offsets[o, 0]
            wraps = k // rows
            k -= wraps * rows
            q = (j + offsets[o, 1] - wraps * step) % columns
            dx = offsets[o, 0] + jitter[k, q, 0] - px
            dy = offsets[o, 1] + jitter[k, q, 1] - py
            ex = frame[0, 0] * dx + frame[0, 1] * dy
            ey = frame[1, 0] * dx + frame[1, 1] * dy
            square = ex * ex + ey * ey
            if square >= 4.0 * top * top:
                continue
            for m in range(angles):
                # each feature turns the fan of directions by another golden share of a step
                turn = 2.0 * math.pi * (m + (n * 0.6180339887498949) % 1.0) / angles
                along = ex * math.cos(turn) + ey * math.sin(turn)
                if along > 0.0 and 0.5 * square < along * out[n, m]:
                    out[n, m] = 0.5 * square / along


def threshold(lattice: Lattice, expected: float, area: float) -> float:
    """Return the threshold at which this very tile covers `area`.

    Parameters
    ----------
    lattice : Lattice
    expected : float
        Threshold that covers it on average.
    area : float
        Share of the tile, in [0, 1].

    Notes
    -----
    Covered is the part of each disc in its feature's Voronoi cell, integrated in polar coordinates:
    area = N length width pi <min(d, r)^2> with r the distance to the cell's end. Of many features 16384 stand for all.
    """
    if area <= 0.0:
        return 0.0
    top = 2.0 * FARTHEST if area > 0.98 else expected + 0.2
    count = lattice.count
    chosen = np.arange(count) if count <= PROBED else np.linspace(0, count - 1, PROBED).astype(np.int64)
    r = np.empty((chosen.size, ANGLES))
    _reaches(lattice.jitter, lattice.step, lattice.frame, lattice.offsets(2.0 * top), chosen, ANGLES, top, r)
    if area >= 1.0:
        return float(r.max()) * 1.01
    # <min(d, r)^2> by the sums of what is nearer than d
    nearer = np.sort(r[r < top])
    sums = np.concatenate([[0.0], np.cumsum(nearer * nearer)])
    asked = area * abs(float(np.linalg.det(lattice.frame))) / math.pi * r.size
    low, high = 0.0, top
    for _ in range(40):
        d = 0.5 * (low + high)
        n = int(np.searchsorted(nearer, d))
        if sums[n] + (r.size - n) * d * d < asked:
            low = d
        else:
            high = d
    return 0.5 * (low + high)
