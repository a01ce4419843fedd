"""Where data come from: a table, a measurement or a file, all with one interface, and directions spread over it."""

from __future__ import annotations

import math
import os

import numpy as np

from brdftab.errors import ParameterError
from brdftab.io import read
from brdftab.io.atomic import show
from brdftab.tables.axis import HALF_PI, short
from brdftab.tables.measurement import Measurement, TableMeasurement
from brdftab.tables.table import Table
from brdftab.typing import Array

Source = Table | Measurement | str | os.PathLike[str]
MAX_SAMPLES = 10**8
# standard deviations of theta_o and phi around the mirror direction, radians
SPREAD = (0.12, 0.15)


def load(source: Source) -> Table | Measurement:
    """Return the table or measurement behind what a user may give.

    Parameters
    ----------
    source : Table, Measurement, str or path-like
        A file is read by content: EXR, NPZ, MERL or RGL.

    Returns
    -------
    Table or Measurement

    Raises
    ------
    ParameterError
        Where it is none of these.
    FileFormatError, BrdftabError
        As `brdftab.read`.
    """
    if isinstance(source, Table | Measurement):
        return source
    if isinstance(source, str | os.PathLike):
        return read(source)
    raise ParameterError(f"data = {short(source)} is neither a table, a measurement nor the path of a file")


def as_measurement(source: Source) -> Measurement:
    """Return the source as a measurement; a table is interpolated linearly along its axes.

    Raises
    ------
    ParameterError
        As `load`, and for an anisotropic table.
    """
    found = load(source)
    return TableMeasurement(found) if isinstance(found, Table) else found


def describe(source: Source, found: Measurement) -> str:
    """Return a name of the source for messages and results, on one line."""
    if isinstance(source, str | os.PathLike):
        return show(source)
    file, model = found.provenance.get("file"), found.provenance.get("model")
    return str(file or (f"table of {model}" if model else found.provenance.get("format", "measurement")))


def check_theta_max(theta_max: float | None) -> float:
    """Return the largest polar angle in radians; None stands for pi/2.

    Raises
    ------
    ParameterError
        Outside (0, 90] degrees.
    """
    if theta_max is None:
        return HALF_PI
    if not (isinstance(theta_max, int | float | np.number) and 0.0 < theta_max <= HALF_PI + 1e-9):
        number = isinstance(theta_max, int | float | np.number)
        shown = f"{math.degrees(theta_max):g} degrees" if number else short(theta_max)
        raise ParameterError.out_of_range("theta_max", shown, "(0, 90] degrees", "arrays and numbers are in radians")
    return min(float(theta_max), HALF_PI)


def stratified(theta_max: float, samples: int, seed: int, solid_angle: bool = False) -> tuple[Array, Array, Array]:
    """Draw directions uniform in theta_i, theta_o and phi: one at random in each of equal boxes.

    Parameters
    ----------
    theta_max : float
        Radians.
    samples : int
        About how many; the number of boxes is the nearest product of three equal or nearly equal counts.
    seed : int
        Not negative; the same seed gives the same directions.
    solid_angle : bool
        Draw the view uniform over the solid angle instead, in cos(theta_o) and phi.

    Returns
    -------
    theta_i, theta_o : ndarray of float64, shape (N,), in [0, theta_max]
    phi : ndarray of float64, shape (N,), in [0, pi]

    Raises
    ------
    ParameterError
        For samples outside [1, 10^8] or a negative seed.
    """
    if isinstance(samples, bool) or not isinstance(samples, int | np.integer) or not 1 <= samples <= MAX_SAMPLES:
        raise ParameterError.out_of_range("samples", short(samples), "[1, 10^8]", "give a whole number such as 20000")
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ParameterError.out_of_range("seed", short(seed), "[0, inf)", "give a whole number")
    side = max(1, round(samples ** (1.0 / 3.0)))
    counts = (side, side, max(1, round(samples / side**2)))
    jitter = np.random.default_rng(seed).random((3, math.prod(counts)))
    boxes = np.indices(counts).reshape(3, -1)
    theta_i, theta_o, phi = (
        top * (box + shift) / count
        for top, box, shift, count in zip((theta_max, theta_max, math.pi), boxes, jitter, counts, strict=True)
    )
    if solid_angle:
        theta_o = np.arccos(1.0 - (theta_o / theta_max) * (1.0 - math.cos(theta_max)))
    return theta_i, theta_o, phi


def near_mirror(theta_max: float, samples: int, seed: int) -> tuple[Array, Array, Array]:
    """Draw lights uniform over the projected solid angle and views around their mirror directions.

    Parameters
    ----------
    theta_max : float
        Radians.
    samples : int
        How many, at least 1.
    seed : int
        Not negative; the same seed gives the same directions.

    Returns
    -------
    theta_i, theta_o : ndarray of float64, shape (samples,), in [0, theta_max]
    phi : ndarray of float64, shape (samples,), in [0, pi]
    """
    rng = np.random.default_rng((seed, 1))
    theta_i = np.arcsin(math.sin(theta_max) * np.sqrt(rng.random(samples)))
    aside, around = rng.normal(0.0, 1.0, (2, samples)) * np.array(SPREAD)[:, None]
    theta_o = np.abs(theta_i + aside)
    # what lies beyond the end is put back as far before it
    theta_o = np.clip(np.minimum(theta_o, 2.0 * theta_max - theta_o), 0.0, theta_max)
    return theta_i, theta_o, math.pi - np.minimum(np.abs(around), math.pi)
