"""Measured data that are no product grid of angles: the file's own cells, and values between them.

`Measurement` is what a reader of a measured format returns. `TableMeasurement` gives a `Table` the same interface, so
that whatever takes measured data takes tables too.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.directions import checked_angles, relative_azimuth
from brdftab.errors import ParameterError
from brdftab.tables.axis import HALF_PI
from brdftab.tables.content import SeveralArrays, listed, told
from brdftab.tables.table import Table
from brdftab.typing import Array

Mask = NDArray[np.bool_]
# a weight within this of 0 or 1 is rounding of a point that lies on a position
_ON = 1e-9
# positions below and above a point along one axis, and the weight of the upper one, each (N,)
Bracket = tuple[NDArray[np.int64], NDArray[np.int64], Array]


@dataclass(frozen=True, eq=False, repr=False)
class Cells(SeveralArrays):
    """A list of measured directions and values.

    Attributes
    ----------
    theta_i, theta_o : ndarray of float64, shape (N,)
        Polar angles of light and view, radians, below pi/2.
    phi : ndarray of float64, shape (N,)
        phi_o - phi_i, radians; pi is the mirror side.
    values : ndarray of float64, shape (N, C)
        f in 1/sr without cosine, as the file holds it, whether valid or not.
    valid : ndarray of bool, shape (N, C)
        True where the value was measured.
    below_horizon : int
        Cells of the file that are not listed because one of their directions lies at or below the horizon.
    """

    theta_i: Array
    theta_o: Array
    phi: Array
    values: Array
    valid: Mask
    below_horizon: int = 0

    _arrays = "theta_i, theta_o, phi, values, valid"

    def __repr__(self) -> str:
        share = 100.0 * float(self.valid.mean()) if self.valid.size else 0.0
        return told(
            self,
            f"{self.theta_i.size:,} directions",
            f"{self.values.shape[-1]} channels",
            f"{share:.2f} % valid",
            f"{self.below_horizon:,} more below the horizon",
        )


class Measurement(SeveralArrays, ABC):
    """Base of measured data; a measurement is equal (``==``) to itself alone.

    Attributes
    ----------
    channels : tuple of str
        Names of the channels, C of them.
    provenance : dict
        JSON-able facts: format, file, what the numbers are, what was masked.
    reciprocal : bool
        True where the format stores each pair of directions and its reverse as one value, so that reciprocity cannot
        be judged.
    """

    channels: tuple[str, ...]
    provenance: dict[str, Any]
    reciprocal: bool = False
    _arrays = "cells().values, cells().theta_i and so on, or what at(theta_i, theta_o, phi) returns"

    def __repr__(self) -> str:
        facts = [str(self.provenance.get(key) or "") for key in ("format", "model", "file", "grid")]
        return told(self, *facts, f"channels {listed(self.channels)}")

    @abstractmethod
    def cells(self) -> Cells:
        """Return the file's own cells."""

    @abstractmethod
    def at(self, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike) -> tuple[Array, Mask]:
        """Interpolate in the file's own parametrisation.

        Parameters
        ----------
        theta_i, theta_o : array_like
            Polar angles of light and view, radians in [0, pi]; they broadcast with `phi`.
        phi : array_like
            phi_o - phi_i, radians; pi is the mirror side.

        Returns
        -------
        values : ndarray of float64, shape (..., C)
            f in 1/sr without cosine; 0 at and below the horizon.
        valid : ndarray of bool, shape (..., C)
            False where any value that contributes is not valid, beyond the measured range, and below the horizon.

        Raises
        ------
        ParameterError
            If an angle is not finite or out of range, or the angles do not broadcast.
        """

    def cells_at(self, theta_i: Array, theta_o: Array, phi: Array) -> Cells | None:
        """Return the cells that hold the given directions, each cell once.

        Parameters
        ----------
        theta_i, theta_o, phi : ndarray of float64, shape (N,)
            Directions, radians.

        Returns
        -------
        Cells or None
            None where the file's samples are so far apart that only interpolation can answer.
        """
        return None


class TableMeasurement(Measurement):
    """A table over an isotropic grid, seen as a measurement: multilinear between the positions of its axes.

    Between the outer positions of phi and 0 or pi the value is that of the outer position, because f is even around
    both. Beyond the outer positions of theta nothing is valid, nor are cells that hold the average of a delta: they say
    more of the cell than of f.

    Raises
    ------
    ParameterError
        For an anisotropic table.
    """

    def __init__(self, table: Table) -> None:
        if not table.grid.isotropic:
            raise ParameterError(
                f"the table has the axes {', '.join(table.grid.axis_names)}; isotropic tables (theta_i, theta_o, phi) "
                "can be read as measurements"
            )
        self.table = table
        self.channels = table.channels
        self.provenance = {"format": "brdftab table", "model": table.provenance.get("model")}
        self._values = table.values.reshape(-1, len(table.channels))
        self._mask = _without_delta(table)
        self._valid = None if self._mask is None else self._mask.reshape(self._values.shape)

    def cells(self) -> Cells:
        """Return every cell of the grid with both polar angles below pi/2."""
        return self._take(np.arange(self.table.grid.size))

    def cells_at(self, theta_i: Array, theta_o: Array, phi: Array) -> Cells:
        """Return the cells whose edges enclose the directions, each once."""
        grid, found = self.table.grid, []
        inside = np.ones(theta_i.shape, dtype=bool)
        for name, angle in (("theta_i", theta_i), ("theta_o", theta_o), ("phi", relative_azimuth(0.0, phi))):
            edges = grid.edges[name]
            inside &= (angle >= edges[0]) & (angle <= edges[-1])
            found.append(np.clip(np.searchsorted(edges, angle, side="right") - 1, 0, edges.size - 2))
        flat = np.ravel_multi_index(tuple(found), grid.shape)
        return self._take(np.unique(flat[inside]))

    def at(self, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike) -> tuple[Array, Mask]:
        """Interpolate linearly along theta_i, theta_o and phi; see `Measurement.at`."""
        shape, (ti, to, az) = checked_angles(theta_i=theta_i, theta_o=theta_o, phi=phi)
        grid = self.table.grid
        assert grid.phi is not None
        inside = (ti < HALF_PI) & (to < HALF_PI)
        axes = []
        for axis, angle in ((grid.theta_i, ti), (grid.theta_o, to), (grid.phi, relative_azimuth(0.0, az))):
            axes.append(bracket(axis, angle))
            if axis is not grid.phi:
                # the slack lets a position stand that was turned to degrees and back
                inside &= (angle >= axis[0] - 1e-12) & (angle <= axis[-1] + 1e-12)
        values, valid = interpolate(self.table.values, self._mask, axes)
        valid &= inside[:, None] & np.isfinite(values)
        values[~((ti < HALF_PI) & (to < HALF_PI))] = 0.0
        return values.reshape(*shape, -1), valid.reshape(*shape, -1)

    def _take(self, flat: NDArray[np.int64]) -> Cells:
        """Return cells by their flat index."""
        grid = self.table.grid
        i, j, k = np.unravel_index(flat, grid.shape)
        assert grid.phi is not None
        theta_i, theta_o, phi = grid.theta_i[i], grid.theta_o[j], grid.phi[k]
        keep = (theta_i < HALF_PI) & (theta_o < HALF_PI)
        values = self._values[flat[keep]].astype(np.float64)
        valid = np.ones(values.shape, dtype=bool) if self._valid is None else self._valid[flat[keep]]
        return Cells(theta_i[keep], theta_o[keep], phi[keep], values, valid, int((~keep).sum()))


def _without_delta(table: Table) -> Mask | None:
    """Return the mask of a table, cells that hold a delta not valid."""
    delta = table.provenance.get("delta")
    if not (isinstance(delta, dict) and delta.get("in_cells")):
        return table.mask
    mask = np.ones(table.values.shape, dtype=bool) if table.mask is None else table.mask.copy()
    mask[tuple(table.grid.mirror_cells().T)] = False
    return mask


def bracket(axis: Array, x: Array) -> Bracket:
    """Return the neighbours of points on an increasing axis; beyond its ends the end itself.

    Parameters
    ----------
    axis : ndarray, shape (n,)
    x : ndarray, shape (N,)

    Returns
    -------
    low, high : ndarray of int64, shape (N,)
    weight : ndarray of float64, shape (N,)
        Of `high`, in [0, 1].
    """
    low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, max(axis.size - 2, 0))
    high = np.minimum(low + 1, axis.size - 1)
    gap = np.where(high > low, axis[high] - axis[low], 1.0)
    return low, high, np.clip((x - axis[low]) / gap, 0.0, 1.0) * (high > low)


def interpolate(data: NDArray[Any], valid: Mask | None, axes: list[Bracket]) -> tuple[Array, Mask]:
    """Interpolate linearly along each axis.

    Parameters
    ----------
    data : ndarray, shape (n_1, ..., n_d, C)
    valid : ndarray of bool, same shape, or None
    axes : list of Bracket, d of them

    Returns
    -------
    values : ndarray of float64, shape (N, C)
    valid : ndarray of bool, shape (N, C)
        False where a value with a weight above 0 is not valid.
    """
    count, channels = axes[0][0].size, data.shape[-1]
    strides = [math.prod(data.shape[k + 1 : -1]) for k in range(len(axes))]
    sides: list[tuple[tuple[NDArray[np.int64], Array], tuple[NDArray[np.int64], Array]]] = []
    for (low, high, given), step in zip(axes, strides, strict=True):
        upper = np.where(given < _ON, 0.0, np.where(given > 1.0 - _ON, 1.0, given))
        # a neighbour of weight 0 is replaced by the one that counts, so that it can spoil nothing
        ends = (np.where(upper < 1.0, low, high) * step, np.where(upper > 0.0, high, low) * step)
        sides.append(((ends[0], 1.0 - upper), (ends[1], upper)))
    rows = data.reshape(-1, channels)
    marks = None if valid is None else valid.reshape(-1, channels)
    values, good = np.zeros((count, channels)), np.ones((count, channels), dtype=bool)
    with np.errstate(invalid="ignore", over="ignore"):
        for corner in itertools.product(*sides):
            index, weight = corner[0]
            for part, factor in corner[1:]:
                index, weight = index + part, weight * factor
            values += weight[:, None] * rows.take(index, axis=0)
            if marks is not None:
                good &= marks.take(index, axis=0)
    return values, good
