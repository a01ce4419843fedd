"""What data say of themselves before any fit: how far they are from reciprocal, and whether their unit is plausible."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdftab.fit.source import Source, as_measurement, check_theta_max, stratified
from brdftab.tables.measurement import Measurement
from brdftab.typing import Array

PAIRS = 20000
# grazing values of real measurements are too uncertain to judge units by
CHECKED = math.radians(75.0)
# no surface reflects more than falls on it; linear RGB of saturated colours and measurement errors stay below this
PLAUSIBLE_ALBEDO = 1.5
# dividing by a cosine must lower the mismatch at least this much: on six measured materials it never goes below 0.87
# where the values are f, and where a cosine was multiplied in it is 0.16 to 0.75 for four or five of them
CLEARLY = 0.8
# below this mismatch, that of interpolation, there is nothing to explain
NOTICEABLE = 0.02


def reciprocity_floor(source: Source, theta_max: float | None = None, seed: int = 0) -> float | None:
    """Return half the RMS of ln f(i, o)/f(o, i): no reciprocal model can have a smaller log-RMS.

    Independent noise of a size s in ln f shows as s/sqrt 2.

    Parameters
    ----------
    source : Table, Measurement, str or path-like
    theta_max : float or None
        Largest polar angle, radians.
    seed : int
        Of the 20000 pairs of directions, uniform in theta_i, theta_o and phi.

    Returns
    -------
    float or None
        Over the valid positive pairs of all channels; None where the format stores both orders as one value, or no
        pair is valid.

    Raises
    ------
    ParameterError
        As `brdftab.fit.data.dataset`.
    """
    found, top = as_measurement(source), check_theta_max(theta_max)
    if found.reciprocal:
        return None
    ratio, _ = _mismatch(found, top, seed)
    return 0.5 * _rms(ratio) if ratio.size else None


def suspicions(source: Source, theta_max: float | None = None, seed: int = 0) -> list[str]:
    """Say what speaks against the values being f in 1/sr without cosine.

    Two tests: the directional albedo, in the median over theta_i, must not exceed 1 by much; and dividing the values by
    cos(theta_i) or cos(theta_o) must not make them clearly more reciprocal.

    Parameters
    ----------
    source : Table, Measurement, str or path-like
    theta_max : float or None
        Largest polar angle, radians; at most 75 degrees are looked at.
    seed : int
        Of the directions.

    Returns
    -------
    list of str
        One line each; empty where nothing is suspicious.

    Raises
    ------
    ParameterError
        As `brdftab.fit.data.dataset`.
    """
    found, top = as_measurement(source), min(check_theta_max(theta_max), CHECKED)
    lines = _units(found, top, seed)
    if not found.reciprocal:
        lines += _cosine(found, top, seed)
    return lines


def _units(found: Measurement, top: float, seed: int) -> list[str]:
    """Judge the directional albedo below `top`."""
    theta_i, theta_o, phi = stratified(top, PAIRS, seed)
    values, valid = found.at(theta_i, theta_o, phi)
    # uniform in theta_o and phi: the mean times the range of both, and two for the other half of the azimuths
    weight = 2.0 * math.pi * top * np.cos(theta_o) * np.sin(theta_o)
    reflected = np.where(valid, values, 0.0) * weight[:, None]
    # a peak that a few directions hit cannot move the median over theta_i
    rings = np.minimum((theta_i / top * 9.0).astype(int), 8)
    # a ring without a valid value says nothing; what is valid of the others is a lower bound
    lit = [valid[rings == k].any(axis=0) for k in range(9)]
    means = [np.where(on, reflected[rings == k].mean(axis=0), np.nan) for k, on in enumerate(lit)]
    seen = np.any(lit, axis=0)
    if not seen.any():
        return []
    albedo = np.zeros(seen.shape)
    albedo[seen] = np.nanmedian(np.array(means)[:, seen], axis=0)
    worst = int(np.argmax(albedo))
    if albedo[worst] <= PLAUSIBLE_ALBEDO:
        return []
    return [
        f"the values may be in another unit than 1/sr: the directional albedo of channel {found.channels[worst]} is "
        f"{albedo[worst]:.3g} in the median over theta_i, and a surface reflects at most 1; percent would be 100 times "
        "too large, a reflectance factor pi times"
    ]


def _cosine(found: Measurement, top: float, seed: int) -> list[str]:
    """Judge whether the values carry a cosine."""
    ratio, cosines = _mismatch(found, top, seed)
    if ratio.size == 0:
        return []
    plain = 0.5 * _rms(ratio)
    name, divided = min(
        (("theta_i", 0.5 * _rms(ratio - cosines)), ("theta_o", 0.5 * _rms(ratio + cosines))), key=lambda pair: pair[1]
    )
    if plain < NOTICEABLE or divided > CLEARLY * plain:
        return []
    return [
        f"the values may be f cos({name}) rather than f: dividing them by cos({name}) lowers the reciprocity mismatch "
        f"(half the RMS of ln f(i, o)/f(o, i)) from {plain:.3g} to {divided:.3g}"
    ]


def _mismatch(found: Measurement, top: float, seed: int) -> tuple[Array, Array]:
    """Return ln f(i, o)/f(o, i) over valid positive pairs of all channels, and ln cos(theta_i)/cos(theta_o)."""
    theta_i, theta_o, phi = stratified(top, PAIRS, seed)
    cells = found.cells_at(theta_i, theta_o, phi)
    if cells is None:
        one, valid = found.at(theta_i, theta_o, phi)
    else:
        # between cells the noise of neighbours averages out and would look smaller than it is
        theta_i, theta_o, phi = cells.theta_i, cells.theta_o, cells.phi
        one, valid = cells.values, cells.valid & np.isfinite(cells.values)
        valid = valid & (np.maximum(theta_i, theta_o) <= top + 1e-12)[:, None]
    # light and view change places: phi_i - phi_o
    two, valid_too = found.at(theta_o, theta_i, -phi)
    both = valid & valid_too & (one > 0.0) & (two > 0.0)
    cosines = np.broadcast_to(np.log(np.cos(theta_i) / np.cos(theta_o))[:, None], both.shape)
    return np.log(one[both] / two[both]), cosines[both]


def _rms(values: NDArray[np.float64]) -> float:
    """Return the root mean square."""
    return math.sqrt(float(np.mean(values * values)))
