"""The points that a fit sees: directions, values, what is valid, and what was left out and why."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from brdftab.directions import relative_azimuth
from brdftab.errors import BrdftabError, ParameterError
from brdftab.fit.reciprocity import reciprocity_floor, suspicions
from brdftab.fit.source import Source, as_measurement, check_theta_max, describe, load, near_mirror, stratified
from brdftab.tables.axis import short
from brdftab.tables.measurement import Cells, Mask, Measurement
from brdftab.typing import Array

SAMPLINGS = ("uniform", "mirror", "solid-angle", "grid")
# values clipped in float32 may round to just below the clip
SLACK = 1e-6
REASONS = ("below horizon", "beyond theta_max", "not finite", "not valid", "negative or zero")

__all__ = ["Dataset", "dataset", "load", "reciprocity_floor", "suspicions"]


@dataclass(frozen=True, eq=False)
class Dataset:
    """Points to fit.

    Attributes
    ----------
    theta_i, theta_o, phi : ndarray of float64, shape (N,)
        Radians; phi = phi_o - phi_i folded to [0, pi]. Every point is valid in at least one channel.
    values : ndarray of float64, shape (N, C)
        f in 1/sr without cosine. Where not valid they are what the source holds and may be anything, NaN included.
    valid : ndarray of bool, shape (N, C)
        Which values to use.
    channels : tuple of str
        C names.
    left_out : dict of str to list of int
        Values that are not valid, a number a channel, by the first reason of `REASONS` that applies. Uniform sampling
        counts drawn points, grid sampling cells.
    saturated : ndarray of bool, shape (N, C)
        Valid values at or above the saturation: the true value is at least this.
    sampling : str
        One of `SAMPLINGS`.
    source : str
        What the points come from, for people.
    reciprocity_floor : float or None
        See `brdftab.fit.reciprocity.reciprocity_floor`.
    """

    theta_i: Array
    theta_o: Array
    phi: Array
    values: Array
    valid: Mask
    channels: tuple[str, ...]
    left_out: dict[str, list[int]]
    saturated: Mask
    sampling: str
    source: str
    reciprocity_floor: float | None = None


def dataset(
    source: Source,
    *,
    theta_max: float | None = None,
    sampling: str = "uniform",
    samples: int = 20000,
    seed: int = 0,
    saturation: float | None = None,
    positive: bool = True,
) -> Dataset:
    """Take the points to fit from a table, a measurement or a file.

    Parameters
    ----------
    source : Table, Measurement, str or path-like
        Isotropic.
    theta_max : float or None
        Largest polar angle of light and view, radians in (0, pi/2].
    sampling : {"uniform", "mirror", "solid-angle", "grid"}
        "uniform" draws directions stratified-uniform in theta_i, theta_o and phi. Where the source has a dense grid
        (tables, MERL) each draw takes the cell that holds it, at the cell's own direction and each cell once: nothing
        is interpolated, so noise stays independent, an outlier spoils one point, and clipped values stay clipped. RGL
        files are evaluated at the draw. "mirror" draws half of all around the mirror direction. "solid-angle" draws the
        view uniform over the solid angle, as renderers meet it and some other fitters draw it. "grid" takes every cell
        of the source.
    samples : int
        About how many directions to draw.
    seed : int
        Of the draws.
    saturation : float or None
        Value in 1/sr from which on values count as clipped; they are kept and flagged.
    positive : bool
        Whether to leave out values that are zero or negative, which a logarithm cannot take.

    Returns
    -------
    Dataset

    Raises
    ------
    ParameterError
        For an argument out of range, or an anisotropic table.
    BrdftabError
        Where no value is valid, or none of one channel is.
    """
    if sampling not in SAMPLINGS:
        raise ParameterError.not_known("sampling", short(sampling), SAMPLINGS)
    if saturation is not None and not (math.isfinite(saturation) and saturation > 0.0):
        raise ParameterError.out_of_range("saturation", saturation, "(0, inf)", "give the clipped value in 1/sr")
    top = check_theta_max(theta_max)
    found = as_measurement(source)
    name = describe(source, found)
    cells = found.cells() if sampling == "grid" else _drawn(found, top, samples, seed, sampling)
    valid, left_out = _judge(cells, top, positive)
    _check(valid, found.channels, left_out, name, top)
    keep = valid.any(axis=1)
    values, valid = cells.values[keep], valid[keep]
    with np.errstate(invalid="ignore"):
        saturated = np.zeros_like(valid) if saturation is None else valid & (values >= saturation * (1.0 - SLACK))
    return Dataset(
        cells.theta_i[keep],
        cells.theta_o[keep],
        relative_azimuth(0.0, cells.phi[keep]),
        values,
        valid,
        found.channels,
        left_out,
        saturated,
        sampling,
        name,
        reciprocity_floor(found, top, seed),
    )


def _drawn(found: Measurement, top: float, samples: int, seed: int, sampling: str) -> Cells:
    """Return the cells that hold uniform draws, or the values at the draws."""
    ti, to, phi = stratified(top, samples, seed, sampling == "solid-angle")
    if sampling == "mirror":
        few, many = stratified(top, max(samples // 2, 1), seed), near_mirror(top, max(samples // 2, 1), seed)
        ti, to, phi = (np.concatenate(pair) for pair in zip(few, many, strict=True))
    cells = found.cells_at(ti, to, phi)
    return Cells(ti, to, phi, *found.at(ti, to, phi)) if cells is None else cells


def _judge(cells: Cells, top: float, positive: bool) -> tuple[Mask, dict[str, list[int]]]:
    """Return which values to use, and how many of each channel are left out for which reason."""
    beyond = (np.maximum(cells.theta_i, cells.theta_o) > top + 1e-12)[:, None]
    finite = np.isfinite(cells.values)
    with np.errstate(invalid="ignore"):
        low = (cells.values <= 0.0) & positive
    rest = np.ones_like(cells.valid)
    counts = {REASONS[0]: [cells.below_horizon] * cells.values.shape[1]}
    for reason, bad in zip(REASONS[1:], (beyond, ~finite, ~cells.valid, low), strict=True):
        counts[reason] = (rest & bad).sum(axis=0).tolist()
        rest &= ~bad
    return rest, counts


def _check(valid: Mask, channels: tuple[str, ...], left_out: dict[str, list[int]], name: str, top: float) -> None:
    """Refuse data of which nothing, or nothing of one channel, is left."""
    empty = [c for c in range(len(channels)) if not valid[:, c].any()]
    if not empty:
        return
    what = "no valid value" if len(empty) == len(channels) else f"no valid value in channel {channels[empty[0]]}"
    why = ", ".join(f"{counts[empty[0]]:,} {reason}" for reason, counts in left_out.items() if counts[empty[0]])
    raise BrdftabError(
        f"{name}: {what} up to theta_max = {math.degrees(top):g} degrees (left out: {why or 'nothing'}); raise "
        "theta_max or check the file's mask and units"
    )
