"""Which cells a table of estimates draws, and where the values go: identical direction lists are drawn half.

Both halves of a square table then hold the same estimate, so that it is reciprocal to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.random_walk.estimates import Estimates
from brdftab.models._shared.sampling.sampling import unit
from brdftab.typing import Array

Whole = NDArray[np.int64]


@dataclass(frozen=True)
class Layout:
    """Cells of a product grid: rows of one direction of light each, columns of views, steps in azimuth between them.

    Attributes
    ----------
    shape : tuple of int
        Of the table.
    incoming, outgoing : ndarray (R, 2), (J, 2)
        Polar angle and azimuth, radians.
    phi : ndarray (K,)
        Azimuths of the view less that of the light that each pair takes; one step of 0 if `outgoing` says it all.
    square : bool
        True where both lists are identical.
    """

    shape: tuple[int, ...]
    incoming: Array
    outgoing: Array
    phi: Array
    square: bool

    @classmethod
    def of(cls, axes: dict[str, Array]) -> Layout:
        """Return the layout of axes theta_i, theta_o, phi or theta_i, phi_i, theta_o, phi_o (radians)."""
        shape = tuple(len(a) for a in axes.values())
        if "phi" in axes:
            incoming, outgoing = (np.stack([t, 0.0 * t], axis=1) for t in (axes["theta_i"], axes["theta_o"]))
            phi = np.asarray(axes["phi"], dtype=np.float64)
        else:
            incoming, outgoing = (
                np.stack(np.meshgrid(axes[f"theta_{x}"], axes[f"phi_{x}"], indexing="ij"), axis=-1).reshape(-1, 2)
                for x in "io"
            )
            phi = np.zeros(1)
        return cls(shape, incoming, outgoing, phi, bool(np.array_equal(incoming, outgoing)))

    def columns(self, row: int) -> int:
        """Return how many columns of a row are drawn: those up to the diagonal of square tables."""
        return row + 1 if self.square else len(self.outgoing)

    def offsets(self) -> Whole:
        """Return where the cells of each row begin, (R + 1,)."""
        sizes = [self.columns(r) * len(self.phi) for r in range(len(self.incoming))]
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    def cells(self) -> tuple[Whole, Whole, Whole]:
        """Return row, column and step (M,) of the cells drawn, row by row."""
        counts = np.array([self.columns(r) for r in range(len(self.incoming))])
        row = np.repeat(np.arange(len(counts)), counts)
        column = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
        k = len(self.phi)
        return np.repeat(row, k), np.repeat(column, k), np.tile(np.arange(k), row.size)

    def angles(self) -> tuple[Array, Array, Array, Array]:
        """Return theta_i, theta_o, phi, phi_i (M,) of the cells drawn."""
        row, column, step = self.cells()
        phi_i = self.incoming[row, 1]
        return self.incoming[row, 0], self.outgoing[column, 0], self.outgoing[column, 1] - phi_i + self.phi[step], phi_i

    def spread(self, found: Estimates, swap: Array | None = None) -> Estimates:
        """Return the table of estimates of its drawn cells; `swap` (M,) is f(o, i)/f(i, o) where that is not 1."""
        row, column, step = self.cells()
        layers, channels = found.values.shape[1:]
        grid = (len(self.incoming), len(self.outgoing), len(self.phi))
        values, error = np.empty((layers, *grid, channels)), np.empty((*grid, channels))
        parts = np.empty_like(values)
        samples = np.empty(grid, dtype=np.int64)
        if self.square:
            factor = np.ones(1) if swap is None else swap
            values[:, column, row, step] = found.values.transpose(1, 0, 2) * factor[:, None]
            error[column, row, step] = found.standard_error * factor[:, None]
            parts[:, column, row, step] = found.component_errors.transpose(1, 0, 2) * factor[:, None]
            samples[column, row, step] = found.samples
        values[:, row, column, step] = found.values.transpose(1, 0, 2)
        error[row, column, step] = found.standard_error
        parts[:, row, column, step] = found.component_errors.transpose(1, 0, 2)
        samples[row, column, step] = found.samples
        return Estimates(
            values.reshape(layers, *self.shape, channels),
            error.reshape(*self.shape, channels),
            parts.reshape(layers, *self.shape, channels),
            samples.reshape(self.shape),
        )


def vectors(theta: Array, phi: Array) -> Array:
    """Return unit vectors (N, 3), contiguous."""
    return np.ascontiguousarray(unit(theta, phi))
