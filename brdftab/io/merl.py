"""MERL BRDF files: three planes of float64 over half and difference read and written.

A file is three int32 (90, 90, 180) and then R, G, B, each with the index phi_d + 180 (theta_d + 90 theta_h). Stored
numbers are f times 1500, 1500/1.15 and 1500/1.66. A negative number says "not measured". theta_h is spaced by square
roots, so cell i holds theta_h from i^2/90 to (i+1)^2/90 degrees; theta_d and phi_d have cells of one degree. A value is
taken to stand at its cell's centre: theta_h = 90 ((i+.5)/90)^2, theta_d = j+.5, phi_d = k+.5 degrees. phi_d runs over
180 degrees only, because a pair of directions and its reverse are one cell; the variant with 360 keeps them apart.

Source: W. Matusik, H. Pfister, M. Brand, L. McMillan, "A Data-Driven Reflectance Model", ACM TOG 22(3), 2003, whose
file format this is.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.directions import checked_angles, half_difference, in_out, wrap
from brdftab.errors import FileFormatError, ParameterError
from brdftab.io.atomic import atomic, show
from brdftab.tables.axis import HALF_PI
from brdftab.tables.content import listed
from brdftab.tables.measurement import Bracket, Cells, Mask, Measurement, TableMeasurement, interpolate
from brdftab.tables.table import Table
from brdftab.typing import Array

HALF, DIFFERENCE = 90, 90
AZIMUTHS = (180, 360)
HEADS = {struct.pack("<3i", HALF, DIFFERENCE, count): count for count in AZIMUTHS}
SCALES = np.array([1.0, 1.15, 1.66]) / 1500.0
CHANNELS = ("R", "G", "B")
NOT_MEASURED = -1.0


class MerlMeasurement(Measurement):
    """A MERL file.

    Attributes
    ----------
    values : ndarray of float64, shape (90, 90, P, 3)
        f in 1/sr without cosine along theta_h, theta_d, phi_d, channel; P is 180 or 360.
    valid : ndarray of bool, same shape
        False where the file holds a negative number or one that is not finite.
    """

    def __init__(self, values: Array, valid: Mask, file: str = "") -> None:
        self.values, self.valid, self.channels = values, valid, CHANNELS
        self.azimuths = values.shape[2]
        self.reciprocal = self.azimuths == AZIMUTHS[0]
        self.provenance = {
            "format": "MERL",
            "file": file,
            "quantity": "f in 1/sr without cosine, linear RGB of the camera that measured",
            "grid": f"theta_h {HALF} (square-root spaced), theta_d {DIFFERENCE}, phi_d {self.azimuths}",
            "masked": "values that are negative (not measured) or not finite, each channel by itself",
            "reciprocity": "built into the format" if self.reciprocal else "both orders of a pair are stored",
        }

    def cells(self) -> Cells:
        """Return the cells whose centre has both directions above the horizon, about three quarters of all."""
        return self._take(np.arange(self.valid[..., 0].size))

    def cells_at(self, theta_i: Array, theta_o: Array, phi: Array) -> Cells:
        """Return the cells that hold the directions, each once, where their centre lies above the horizon."""
        counts = (HALF, DIFFERENCE, self.azimuths)
        place = self._place(theta_i, theta_o, phi)
        index = [np.clip(x.astype(np.int64), 0, n - 1) for x, n in zip(place, counts, strict=True)]
        return self._take(np.unique(np.ravel_multi_index(tuple(index), counts)))

    def at(self, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike) -> tuple[Array, Mask]:
        """Interpolate linearly in sqrt(theta_h), theta_d and phi_d, which is periodic; see `Measurement.at`.

        Half a cell from the ends of theta_h and theta_d the value is that of the outer cell.
        """
        shape, flat = checked_angles(theta_i=theta_i, theta_o=theta_o, phi=phi)
        half, difference, azimuth = self._place(*flat)
        low = np.floor(azimuth - 0.5)
        turn = np.mod(low, self.azimuths).astype(np.int64)
        around = (turn, (turn + 1) % self.azimuths, azimuth - 0.5 - low)
        values, valid = interpolate(
            self.values, self.valid, [_centred(half, HALF), _centred(difference, DIFFERENCE), around]
        )
        above = (flat[0] < HALF_PI) & (flat[1] < HALF_PI)
        values[~above] = 0.0
        return values.reshape(*shape, 3), (valid & above[:, None]).reshape(*shape, 3)

    def _place(self, theta_i: Array, theta_o: Array, phi: Array) -> tuple[Array, Array, Array]:
        """Return where directions lie in units of cells along each axis; cell k reaches from k to k + 1."""
        theta_h, _, theta_d, phi_d = half_difference(theta_i, 0.0, theta_o, phi)
        # 180 azimuths: the reverse of a pair has phi_d + pi
        period = math.pi if self.reciprocal else 2.0 * math.pi
        return (
            HALF * np.sqrt(theta_h / HALF_PI),
            DIFFERENCE * theta_d / HALF_PI,
            self.azimuths * np.mod(phi_d, period) / period,
        )

    def _take(self, flat: NDArray[np.int64]) -> Cells:
        """Return cells by their flat index."""
        theta_i, theta_o, phi = _centres(flat, self.azimuths)
        keep = (theta_i < HALF_PI) & (theta_o < HALF_PI)
        kept = flat[keep]
        values, valid = self.values.reshape(-1, 3)[kept], self.valid.reshape(-1, 3)[kept]
        return Cells(theta_i[keep], theta_o[keep], phi[keep], values, valid, int((~keep).sum()))


def directions(azimuths: int = 180) -> tuple[Array, Array, Array]:
    """Return the directions of the cells' centres.

    Parameters
    ----------
    azimuths : {180, 360}
        Cells along phi_d.

    Returns
    -------
    theta_i, theta_o, phi : ndarray of float64, shape (90, 90, azimuths)
        Radians; phi in [0, 2 pi). Where a theta reaches pi/2 or more, that cell lies below the horizon.

    Raises
    ------
    ParameterError
        For another number of azimuths.
    """
    if azimuths not in AZIMUTHS:
        raise ParameterError.out_of_range("azimuths", azimuths, "180, 360", "these are the two variants of the format")
    shape = (HALF, DIFFERENCE, azimuths)
    theta_i, theta_o, phi = (x.reshape(shape) for x in _centres(np.arange(math.prod(shape)), azimuths))
    return theta_i, theta_o, phi


def write_merl(
    source: ArrayLike | Table | Measurement | Callable[[Array, Array, Array], ArrayLike],
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
) -> None:
    """Write a MERL file; it appears whole or not at all.

    Parameters
    ----------
    source : array_like of shape (3, 90, 90, 180) or (3, 90, 90, 360), Table, Measurement, or callable
        f in 1/sr without cosine: planes R, G, B over theta_h, theta_d, phi_d at the centres that `directions` returns;
        NaN where a value is not measured, which is stored as a negative number. A callable takes theta_i, theta_o, phi
        (N,) in radians and returns (N, 3) or (N, 1); cells below the horizon are stored as not measured. Tables over an
        isotropic grid and measurements of another format, with the channels R, G, B or one alone, are interpolated as
        `Measurement.at` does; what it calls invalid, as angles beyond the grid's outer positions, is not measured.
    path : str or path-like
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    ParameterError
        Where the array has another shape or holds an infinite number, the table is anisotropic, or the channels are
        others.
    OutputExistsError, BrdftabError
        As `brdftab.write`.
    """
    if isinstance(source, Table):
        source = TableMeasurement(source)
    if isinstance(source, MerlMeasurement):
        planes = np.where(source.valid, source.values, np.nan)
    elif isinstance(source, Measurement):
        planes = _evaluated(_lookup(source))
    elif callable(source):
        planes = _evaluated(source)
    else:
        given = np.asarray(source, dtype=np.float64)
        if given.ndim != 4 or given.shape[:3] != (3, HALF, DIFFERENCE) or given.shape[3] not in AZIMUTHS:
            raise ParameterError(f"the array has the shape {given.shape}; a MERL file needs (3, 90, 90, 180 or 360)")
        planes = np.moveaxis(given, 0, -1)
    if np.isinf(planes).any():
        raise ParameterError("the array holds an infinite number; give finite values, or NaN where not measured")
    stored = np.where(np.isnan(planes), NOT_MEASURED, planes / SCALES)
    with atomic(path, overwrite=overwrite) as temporary, open(temporary, "wb") as file:
        file.write(struct.pack("<3i", *stored.shape[:3]))
        np.ascontiguousarray(np.moveaxis(stored, -1, 0), dtype="<f8").tofile(file)


def read(path: Path) -> MerlMeasurement:
    """Read a MERL file.

    Parameters
    ----------
    path : Path
        A file that starts with the sizes of a MERL file.

    Returns
    -------
    MerlMeasurement

    Raises
    ------
    FileFormatError
        Where the file's size is not the one that its header needs.
    """
    with open(path, "rb") as file:
        azimuths = HEADS[file.read(12)]
        shape = (3, HALF, DIFFERENCE, azimuths)
        size, needed = file.seek(0, 2), 12 + 8 * math.prod(shape)
        if size != needed:
            kind = "truncated" if size < needed else "damaged"
            raise FileFormatError(
                f"the MERL file is {kind}: it has {size:,} bytes, its header (90, 90, {azimuths}) needs {needed:,}"
            )
        file.seek(12)
        stored = np.fromfile(file, dtype="<f8", count=math.prod(shape)).reshape(shape)
    stored = np.ascontiguousarray(np.moveaxis(stored, 0, -1))
    valid = np.isfinite(stored) & (stored >= 0.0)
    with np.errstate(invalid="ignore"):
        stored *= SCALES
    return MerlMeasurement(stored, valid, show(path))


def _centres(flat: NDArray[np.int64], azimuths: int) -> tuple[Array, Array, Array]:
    """Return theta_i, theta_o, phi of the centres of cells by their flat index, each (N,)."""
    i, j, k = np.unravel_index(flat, (HALF, DIFFERENCE, azimuths))
    theta_h = HALF_PI * ((i + 0.5) / HALF) ** 2
    theta_d = HALF_PI * (j + 0.5) / DIFFERENCE
    phi_d = np.radians(k + 0.5)
    theta_i, phi_i, theta_o, phi_o = in_out(theta_h, 0.0, theta_d, phi_d)
    return theta_i, theta_o, wrap(phi_o - phi_i)


def _centred(place: Array, count: int) -> Bracket:
    """Return the two cells whose centres enclose a place."""
    x = np.clip(place - 0.5, 0.0, count - 1.0)
    low = np.minimum(x.astype(np.int64), count - 2)
    return low, low + 1, x - low


def _lookup(source: Measurement) -> Callable[[Array, Array, Array], Array]:
    """Return what looks up another measurement: (N, 3) or (N, 1), NaN where it is not valid."""
    if source.channels != CHANNELS and len(source.channels) != 1:
        raise ParameterError(
            f"channels = {listed(source.channels)} are not those of a MERL file, R G B; tabulate the model without "
            "wavelengths, or give planes of R, G, B as an array"
        )

    def found(theta_i: Array, theta_o: Array, phi: Array) -> Array:
        values, valid = source.at(theta_i, theta_o, phi)
        return np.where(valid, values, np.nan)

    return found


def _evaluated(source: Callable[[Array, Array, Array], ArrayLike]) -> Array:
    """Evaluate a callable at the centres; NaN below the horizon. Shape (90, 90, 180, 3)."""
    theta_i, theta_o, phi = (x.reshape(-1) for x in directions())
    above = (theta_i < HALF_PI) & (theta_o < HALF_PI)
    planes = np.full((above.size, 3), np.nan)
    found = np.asarray(source(theta_i[above], theta_o[above], phi[above]), dtype=np.float64)
    if found.shape not in ((int(above.sum()), 3), (int(above.sum()), 1)):
        raise ParameterError(f"the callable returned the shape {found.shape}; it must return ({int(above.sum())}, 3)")
    planes[above] = found
    return planes.reshape(HALF, DIFFERENCE, 180, 3)
