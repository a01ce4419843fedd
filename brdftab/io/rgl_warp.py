"""The warp of RGL files: a density on the unit square, one a polar angle of the light, and what it makes of squares.

The density is bilinear between its nodes. Its cumulative distribution along y (marginal) and, in each row, along x
(conditional) map a point of the square to another square in which the measurement is sampled evenly. Between two angles
of the light density and cumulative sums are interpolated linearly.

Source: J. Dupuy, W. Jakob, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering", ACM TOG
37(6), 2018, section 4.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.tables.measurement import Bracket
from brdftab.typing import Array

_TINY = 1e-300


class Warp:
    """Densities of several slices and their cumulative sums.

    Parameters
    ----------
    density : ndarray, shape (T, H, W)
        Not negative; y runs over H nodes and x over W, both from 0 to 1.
    """

    def __init__(self, density: NDArray[np.floating]) -> None:
        value = density.astype(np.float64)
        along = np.zeros_like(value)
        along[..., 1:] = np.cumsum(0.5 * (value[..., 1:] + value[..., :-1]), axis=-1)
        up = np.zeros(value.shape[:2])
        up[:, 1:] = np.cumsum(0.5 * (along[:, 1:, -1] + along[:, :-1, -1]), axis=-1)
        # each slice has the integral 1, so that slices of unlike scale can be mixed
        scale = 1.0 / np.maximum(up[:, -1], _TINY)
        self.value, self.along = value * scale[:, None, None], along * scale[:, None, None]
        self.up = up * scale[:, None]

    def to_sample(self, x: Array, y: Array, light: Bracket) -> tuple[Array, Array]:
        """Map points to the square of samples.

        Parameters
        ----------
        x, y : ndarray, shape (N,)
            In [0, 1].
        light : Bracket
            Slices to mix.

        Returns
        -------
        x, y : ndarray, shape (N,)
            In [0, 1].
        """
        height, width = self.value.shape[1:]
        i, _, fx = cell(x, width)
        j, _, fy = cell(y, height)
        below, above, upper = light

        def mix(array: Array, *index: NDArray[np.int64] | int) -> Array:
            """Interpolate between the two slices."""
            return (1.0 - upper) * array[(below, *index)] + upper * array[(above, *index)]

        left = (1.0 - fy) * mix(self.value, j, i) + fy * mix(self.value, j + 1, i)
        right = (1.0 - fy) * mix(self.value, j, i + 1) + fy * mix(self.value, j + 1, i + 1)
        part = (1.0 - fy) * mix(self.along, j, i) + fy * mix(self.along, j + 1, i)
        row, next_row = mix(self.along, j, -1), mix(self.along, j + 1, -1)
        whole = (1.0 - fy) * row + fy * next_row
        sx = (part + fx * (left + 0.5 * fx * (right - left))) / np.maximum(whole, _TINY)
        sy = mix(self.up, j) + fy * (row + 0.5 * fy * (next_row - row))
        return sx, sy

    def from_sample(self, slice_: int, x: Array, y: Array) -> tuple[Array, Array]:
        """Map the grid of sample positions x (n,) and y (m,) to points (m, n): the inverse of `to_sample` in a slice.

        Parameters
        ----------
        slice_ : int
            Which slice.
        x, y : ndarray
            Sample positions in [0, 1].

        Returns
        -------
        x, y : ndarray, shape (m, n)
        """
        value, along, up = self.value[slice_], self.along[slice_], self.up[slice_]
        rows = along[:, -1]
        j = np.clip(np.searchsorted(up, y, side="right") - 1, 0, up.size - 2)
        fy = _ramp(rows[j], rows[j + 1], y - up[j])
        out_x = np.empty((y.size, x.size))
        for k, (row, f) in enumerate(zip(j, fy, strict=True)):
            sums = (1.0 - f) * along[row] + f * along[row + 1]
            edge = (1.0 - f) * value[row] + f * value[row + 1]
            i = np.clip(np.searchsorted(sums, x * sums[-1], side="right") - 1, 0, sums.size - 2)
            out_x[k] = (i + _ramp(edge[i], edge[i + 1], x * sums[-1] - sums[i])) / (sums.size - 1)
        return out_x, np.repeat(((j + fy) / (up.size - 1))[:, None], x.size, axis=1)


def cell(x: Array, count: int) -> Bracket:
    """Return the nodes around positions in [0, 1] on an axis of `count` evenly spaced nodes, and the upper weight."""
    place = np.clip(x, 0.0, 1.0) * (count - 1)
    low = np.minimum(place.astype(np.int64), count - 2)
    return low, low + 1, place - low


def _ramp(first: Array, last: Array, area: Array) -> Array:
    """Return f in [0, 1] where the area under a line from `first` to `last` reaches `area`."""
    root = np.sqrt(np.maximum(first * first + 2.0 * (last - first) * area, 0.0))
    return np.clip(2.0 * area / np.maximum(first + root, _TINY), 0.0, 1.0)
