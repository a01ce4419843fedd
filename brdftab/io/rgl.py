"""RGL tensor files (EPFL material database): isotropic RGB measurements.

With x = sqrt(2 theta_m/pi) and y = (phi_m - phi_i + pi)/(2 pi) of the half vector m, and s the point of the square of
samples that the file's warp makes of (x, y), the file means

    f cos(theta_o) = rgb(theta_i, s) ndf(x, y) / (4 sigma(theta_i)),

without the last factor where its field jacobian is 0. The file's theta_i is the light's. Numbers that are not positive
lie outside what was measured (negative ones were cut by the conversion to RGB).

Source: J. Dupuy, W. Jakob, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering", ACM TOG
37(6), 2018; held against the plugin `measured` of Mitsuba 3 in the tests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.directions import checked_angles, from_vector, to_vector
from brdftab.errors import FileFormatError
from brdftab.io.atomic import show
from brdftab.io.rgl_warp import Warp, cell
from brdftab.io.tensor_file import Field, read_array, read_fields
from brdftab.tables.axis import HALF_PI
from brdftab.tables.content import told
from brdftab.tables.measurement import Bracket, Cells, Mask, Measurement, bracket, interpolate
from brdftab.typing import Array

CHANNELS = ("R", "G", "B")
_NEEDED = {"phi_i": 1, "theta_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "rgb": 5, "jacobian": 1}
_FLOATS = ("<f4", "<f8", "<f2")
# float32 of pi/2 lies above it
_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class RglArrays:
    """The arrays of a file: theta_i (T,), ndf and sigma (h, w), vndf (T, H, W), rgb (T, m, n, 3)."""

    theta_i: Array
    ndf: Array
    sigma: Array
    vndf: NDArray[np.floating]
    rgb: NDArray[np.floating]
    jacobian: bool

    def __repr__(self) -> str:
        names = ("theta_i", "ndf", "sigma", "vndf", "rgb")
        return told(self, *(f"{name} {'x'.join(map(str, getattr(self, name).shape))}" for name in names))


class RglMeasurement(Measurement):
    """An isotropic RGB file of the RGL format.

    Attributes
    ----------
    arrays : RglArrays
        What the file holds.
    valid : ndarray of bool, shape (T, m, n, 3)
        False where the stored number is not positive, and over a last theta_i that repeats the one before.
    """

    def __init__(self, arrays: RglArrays, file: str = "", description: str = "") -> None:
        self.arrays, self.channels = arrays, CHANNELS
        self.valid = arrays.rgb > 0.0
        rgb = arrays.rgb
        # a copy at grazing light is no measurement; a file that is constant along theta_i has no such copy
        repeated = len(rgb) > 2 and np.array_equal(rgb[-1], rgb[-2]) and not np.array_equal(rgb[-2], rgb[-3])
        if repeated:
            self.valid[-1] = False
        self._warp = Warp(arrays.vndf)
        self.provenance = {
            "format": "RGL",
            "file": file,
            "description": description,
            "quantity": "f in 1/sr without cosine, linear RGB; the file holds f cos(theta_o) over its sampling density",
            "grid": f"theta_i {rgb.shape[0]}, samples {rgb.shape[1]} x {rgb.shape[2]}",
            "theta_i_degrees": [round(math.degrees(x), 6) for x in arrays.theta_i],
            "masked": "numbers that are not positive (outside the measured range), each channel by itself"
            + (", and the last theta_i, which repeats the one before" if repeated else ""),
        }

    def cells(self) -> Cells:
        """Return the grid of samples at each theta_i, where both directions lie above the horizon."""
        rgb = self.arrays.rgb
        rows, columns = (np.linspace(0.0, 1.0, n) for n in rgb.shape[1:3])
        parts = [self._warp.from_sample(k, columns, rows) for k in range(len(rgb))]
        x, y = (np.stack(part).reshape(-1) for part in zip(*parts, strict=True))
        theta_i = np.repeat(self.arrays.theta_i, rows.size * columns.size)
        light, half = to_vector(theta_i, 0.0), to_vector(HALF_PI * x * x, 2.0 * math.pi * y - math.pi)
        along = np.sum(light * half, axis=1)
        theta_o, phi = from_vector(2.0 * along[:, None] * half - light)
        keep = (theta_i < HALF_PI) & (theta_o < HALF_PI) & (along > 0.0)
        scale = self._scale(theta_i[keep], theta_o[keep], x[keep], y[keep])
        values = rgb.reshape(-1, 3)[keep] * scale[:, None]
        valid = self.valid.reshape(-1, 3)[keep]
        return Cells(theta_i[keep], theta_o[keep], phi[keep], values, valid, int((~keep).sum()))

    def at(self, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike) -> tuple[Array, Mask]:
        """Evaluate the file as its format defines it between samples; see `Measurement.at`."""
        shape, (ti, to, az) = checked_angles(theta_i=theta_i, theta_o=theta_o, phi=phi)
        above = (ti < HALF_PI) & (to < HALF_PI)
        axis = self.arrays.theta_i
        inside = above & (ti >= axis[0] - _SLACK) & (ti <= axis[-1] + _SLACK)
        theta_m, phi_m = from_vector(to_vector(ti, 0.0) + to_vector(to, az))
        x, y = np.sqrt(theta_m / HALF_PI), np.mod(phi_m / (2.0 * math.pi) + 0.5, 1.0)
        light = bracket(axis, ti)
        sx, sy = self._warp.to_sample(x, y, light)
        rows, columns = self.arrays.rgb.shape[1:3]
        values, valid = interpolate(self.arrays.rgb, self.valid, [light, cell(sy, rows), cell(sx, columns)])
        values[above] *= self._scale(ti[above], to[above], x[above], y[above])[:, None]
        values[~above] = 0.0
        return values.reshape(*shape, 3), (valid & inside[:, None]).reshape(*shape, 3)

    def _scale(self, theta_i: Array, theta_o: Array, x: Array, y: Array) -> Array:
        """Return what turns a stored number into f, shape (N,)."""
        if not self.arrays.jacobian:
            return 1.0 / np.cos(theta_o)
        ndf = _bilinear(self.arrays.ndf, x, y)
        sigma = _bilinear(self.arrays.sigma, np.sqrt(theta_i / HALF_PI), np.full_like(theta_i, 0.5))
        return ndf / (4.0 * sigma * np.cos(theta_o))


def read(path: Path) -> RglMeasurement:
    """Read an RGL file.

    Parameters
    ----------
    path : Path
        A file that starts with the magic number of tensor files.

    Returns
    -------
    RglMeasurement

    Raises
    ------
    FileFormatError
        Where the file is truncated or damaged, anisotropic, or spectral.
    """
    fields = read_fields(path)
    if "rgb" not in fields and "spectra" in fields:
        raise FileFormatError("the RGL file is spectral; RGB files are read: take the material's _rgb file")
    for name, dimensions in _NEEDED.items():
        if name not in fields:
            raise FileFormatError(f"the RGL file lacks the field {name}")
        if len(fields[name].shape) != dimensions or (name != "jacobian" and fields[name].dtype not in _FLOATS):
            raise FileFormatError(f"the RGL file's field {name} is not an array of floats in {dimensions} dimensions")
    _check_shapes(fields)
    arrays = {name: read_array(path, fields[name]) for name in _NEEDED}
    _check_values(arrays)
    found = RglArrays(
        arrays["theta_i"].astype(np.float64),
        arrays["ndf"].astype(np.float64),
        arrays["sigma"].astype(np.float64),
        arrays["vndf"][0],
        np.ascontiguousarray(np.moveaxis(arrays["rgb"][0], 1, -1)),
        bool(arrays["jacobian"][0]),
    )
    return RglMeasurement(found, show(path), _description(path, fields))


def _check_shapes(fields: dict[str, Field]) -> None:
    """Check that the arrays fit each other, before any is read."""
    azimuths = fields["phi_i"].shape[0]
    if azimuths != 1:
        raise FileFormatError(f"the RGL file is anisotropic ({azimuths} azimuths of the light); take an isotropic one")
    count = fields["theta_i"].shape[0]
    vndf, rgb = fields["vndf"].shape, fields["rgb"].shape
    fits = vndf[:2] == (1, count) and rgb[:3] == (1, count, 3) and count > 0 and fields["jacobian"].shape[0] > 0
    grids = (vndf[2:], rgb[3:], fields["ndf"].shape, fields["sigma"].shape)
    if not fits or min(map(min, grids)) < 2:
        raise FileFormatError("the RGL file is damaged: the shapes of its fields do not fit each other")


def _check_values(arrays: dict[str, NDArray[Any]]) -> None:
    """Refuse numbers that no evaluation could use."""
    theta_i = arrays["theta_i"]
    if not ((np.diff(theta_i) > 0.0).all() and theta_i[0] >= 0.0 and theta_i[-1] <= HALF_PI + _SLACK):
        raise FileFormatError("the RGL file is damaged: its theta_i do not increase from 0 to 90 degrees")
    for name in ("ndf", "sigma", "vndf"):
        if not (np.isfinite(arrays[name]).all() and arrays[name].min() >= 0.0):
            raise FileFormatError(f"the RGL file is damaged: its {name} holds negative or infinite numbers or NaN")
    if arrays["sigma"].min() <= 0.0 or not arrays["vndf"].any(axis=(2, 3)).all():
        raise FileFormatError("the RGL file is damaged: its sigma or vndf vanishes")
    if not np.isfinite(arrays["rgb"]).all():
        raise FileFormatError("the RGL file is damaged: its rgb holds infinite numbers or NaN")


def _description(path: Path, fields: dict[str, Field]) -> str:
    """Return the file's own text on what was measured, on one line."""
    field = fields.get("description")
    if field is None or field.dtype != "<u1" or math.prod(field.shape) > 10000:
        return ""
    text = read_array(path, field).tobytes().decode("utf-8", errors="replace").rstrip("\0")
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _bilinear(array: Array, x: Array, y: Array) -> Array:
    """Interpolate an array (h, w) at positions of the unit square; x runs along its last axis."""
    rows: Bracket = cell(y, array.shape[0])
    return interpolate(array[..., None], None, [rows, cell(x, array.shape[1])])[0][:, 0]
