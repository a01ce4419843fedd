"""Shares of texels covered by thin scratches: each ellipse is laid down analytically, column by column of texels.

Points miss scratches that are much thinner than their spacing, and a map of them is mostly noise. Here every scratch
leaves exactly its area: the integral of its chord over each column of texels, spread over the rows that it crosses.
Where discs overlap in the frame of the noise, each keeps what is nearest to its own feature, so that nothing counts
twice. Texels may sum to a little more than 1 where scratches as wide as a texel touch; that is cut off.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.jit import kernel, parallel_kernel
from brdftab.scratch_layers.lattice import Lattice, frame_of

# equal shares of the features, each with a map of its own: the same sum for any number of threads
PARTS = 4
# entries of the table of the half disc's area
CHORDS = 4096
NEIGHBOURS = 96
# strips an ellipse is cut in at least where it meets others
STRIPS = 12


@kernel
def _ramp(x):
    return 0.5 * x * x if x > 0.0 else 0.0


@kernel
def _below(t, long, short):
    """Return the share of a parallelogram's area below t: two evenly spread extents around 0, added."""
    if short < 0.02 * long:
        return min(max(t / long + 0.5, 0.0), 1.0)
    p, q = 0.5 * (long + short), 0.5 * (long - short)
    if t >= p:
        return 1.0
    return (_ramp(t + p) - _ramp(t + q) - _ramp(t - q)) / (long * short)


@kernel
def _deposit(out, column, y, one, other, area, mask):
    """Spread a parallelogram's area over the rows of a column of texels; it leans by `one` and is `other` thick."""
    reach = 0.5 * (one + other)
    row, last = math.floor(y - reach), math.floor(y + reach)
    c = int(column) & mask
    before = 0.0
    long, short = max(one, other), min(one, other)
    while row < last:
        until = _below(row + 1.0 - y, long, short)
        out[row & mask, c] += area * (until - before)
        before = until
        row += 1
    out[last & mask, c] += area * (1.0 - before)


@kernel
def _clipped(near, count, s, half):
    """Return the ends (low, high) of the chord at s that lies nearer to its own feature than to any other."""
    low, high = -half, half
    for n in range(count):
        dx, dy = near[n, 0], near[n, 1]
        limit = 0.5 * (dx * dx + dy * dy) - s * dx
        if dy > 0.0:
            high = min(high, limit / dy)
        elif dy < 0.0:
            low = max(low, limit / dy)
        elif limit < 0.0:
            return 0.0, 0.0
    return low, max(low, high)


@parallel_kernel
def _lay(jitter, step, back, shift, frame, offsets, d, long, wide, cosine, sine, chords, out):
    """Add the area of every scratch to out (PARTS, S, S), in texels; its rows run along u where scratches are steep."""
    rows, columns = jitter.shape[0], jitter.shape[1]
    parts, size = out.shape[0], out.shape[1]
    mask = size - 1
    swap = abs(sine) > abs(cosine)
    # texels along the column axis and the row axis for a unit of s, the place along the scratch
    along = (sine if swap else cosine) * long * size
    rise = (cosine if swap else sine) * long * size
    # texels of a column for a unit across
    across = wide * size / (cosine if not swap else -sine)
    square = abs(along * across)
    lean = abs(rise)
    table = chords.size - 1
    for part in numba.prange(parts):
        near = np.empty((NEIGHBOURS, 2))
        target = out[part]
        for n in range(part * rows * columns // parts, (part + 1) * rows * columns // parts):
            i = n // columns
            j = n - i * columns
            px, py = float(jitter[i, j, 0]), float(jitter[i, j, 1])
            count = 0
            for o in range(1, offsets.shape[0]):
                k = i + offsets[o, 0]
                q = j + offsets[o, 1]
                if k < 0 or k >= rows:
                    wraps = k // rows
                    k -= wraps * rows
                    q -= wraps * step
                if q < 0 or q >= columns:
                    q %= columns
                dx = offsets[o, 0] + jitter[k, q, 0] - px
                dy = offsets[o, 1] + jitter[k, q, 1] - py
                ex = frame[0, 0] * dx + frame[0, 1] * dy
                ey = frame[1, 0] * dx + frame[1, 1] * dy
                if ex * ex + ey * ey < 4.0 * d * d and count < NEIGHBOURS:
                    near[count, 0], near[count, 1] = ex, ey
                    count += 1
            zx, zy = i + px - shift[0], j + py - shift[1]
            u = back[0, 0] * zx + back[0, 1] * zy
            v = back[1, 0] * zx + back[1, 1] * zy
            u, v = (u - math.floor(u)) * size, (v - math.floor(v)) * size
            cx, cy = (v, u) if swap else (u, v)
            most = d / STRIPS * 2.0 if count > 0 else 4.0 * d
            s = -d
            done = 0.0
            column = math.floor(cx - d * along)
            turn = column + 1.0 if along > 0.0 else column
            while s < d:
                border = (turn - cx) / along
                end = min(border, s + most, d)
                spot = (0.5 * end / d + 0.5) * table
                low = min(int(spot), table - 1)
                until = chords[low] + (spot - low) * (chords[low + 1] - chords[low])
                middle = 0.5 * (s + end)
                if end > s:
                    # mean half chord of the strip
                    half = d * d * (until - done) / (end - s)
                    bottom, top = -half, half
                    if count > 0:
                        bottom, top = _clipped(near, count, middle, half)
                    if top > bottom:
                        width = end - s
                        thick = (top - bottom) * abs(across)
                        y = cy + middle * rise + 0.5 * (top + bottom) * across
                        _deposit(target, column, y, lean * width, thick, square * width * (top - bottom), mask)
                done = until
                if end >= border:
                    if along > 0.0:
                        column += 1.0
                        turn += 1.0
                    else:
                        column -= 1.0
                        turn -= 1.0
                s = end


def chord_table() -> NDArray[np.float64]:
    """Return the integral of the half chord of the unit disc from -1 to x, at equal steps of x in [-1, 1]."""
    x = np.linspace(-1.0, 1.0, CHORDS + 1)
    return 0.5 * (x * np.sqrt(1.0 - x * x) + np.arcsin(x)) + 0.25 * math.pi


def splatted(
    lattice: Lattice, density: float, size: int, length: float, width: float, angle: float
) -> NDArray[np.float32]:
    """Return covered shares (size, size) of thin scratches; size is a power of two.

    Parameters
    ----------
    lattice : Lattice
    density : float
        Threshold: half axes of the ellipses are density * length and density * width.
    size : int
        Texels along a side of the tile.
    length, width, angle : float
        Of the layer, in tiles and radians.
    """
    out = np.zeros((PARTS, size, size), dtype=np.float32)
    offsets = lattice.offsets(2.0 * density)
    # the frame's axes in terms of the matrix that stretched it
    assert np.allclose(frame_of(length, width, angle), lattice.frame @ lattice.cells)
    _lay(
        lattice.jitter, lattice.step, np.linalg.inv(lattice.cells), lattice.shift, lattice.frame, offsets, density,
        length, width, math.cos(angle), math.sin(angle), chord_table(), out,
    )  # fmt: skip
    total = np.minimum(out.sum(axis=0), 1.0)
    return np.ascontiguousarray(total.T) if abs(math.sin(angle)) > abs(math.cos(angle)) else total
