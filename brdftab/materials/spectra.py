"""From a reflectance spectrum to linear sRGB under D65: one weight matrix, normalised so that a spectrum of 1 is white.

Observer CIE 1931 2 degree, illuminant D65, both every 5 nm from 380 to 780 nm. The primaries are those of sRGB
(IEC 61966-2-1); the white is the light itself, so each channel is divided by its own value for a perfect mirror.
Saturated metals have channels above 1 or below 0: they lie outside the sRGB gamut, and nothing is clamped.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from brdftab.errors import ParameterError
from brdftab.materials.indices import read_csv

CHANNELS = ("R", "G", "B")
# xy of the sRGB primaries, red, green, blue (IEC 61966-2-1, table 1)
PRIMARIES = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))


def wavelengths() -> np.ndarray:
    """Return the reference wavelengths, float64 (81,): 380 to 780 nm in steps of 5 nm."""
    return read_csv("cie", "d65")[:, 0]


def unit_sum(weights: np.ndarray) -> np.ndarray:
    """Return `weights` (W, C) with each column adding up to 1, as exactly as float64 allows.

    The largest entry of a column takes up what rounding leaves.
    """
    weights = weights / weights.sum(axis=0)
    for _ in range(2):
        largest = np.abs(weights).argmax(axis=0)
        weights[largest, np.arange(weights.shape[1])] += 1.0 - weights.sum(axis=0)
    return weights


@cache
def weights() -> np.ndarray:
    """Return the projection, float64 (81, 3), read-only: ``rgb = spectrum @ weights()``; columns add up to 1."""
    light = read_csv("cie", "d65")[:, 1:] * read_csv("cie", "cie1931_2deg")[:, 1:]  # (81, XYZ)
    x, y = np.array(PRIMARIES).T
    to_xyz = np.array([x / y, np.ones(3), (1.0 - x - y) / y])
    # unit_sum divides each channel by its value for the light, which is what scaling the primaries to white does
    matrix = unit_sum(np.linalg.solve(to_xyz, light.T).T)
    matrix.setflags(write=False)
    return matrix


def to_rgb(spectrum: ArrayLike) -> np.ndarray:
    """Project reflectance spectra to linear sRGB under D65.

    Parameters
    ----------
    spectrum : array_like (..., 81)
        Reflectance at `wavelengths`, a pure number.

    Returns
    -------
    float64 (..., 3)
        Linear sRGB; a spectrum of 1 gives (1, 1, 1). Entries above 1 or below 0 are colours outside the gamut.

    Raises
    ------
    ParameterError
        If the last axis does not hold one value a reference wavelength.
    """
    spectrum = np.asarray(spectrum, dtype=np.float64)
    count = len(wavelengths())
    if spectrum.ndim == 0 or spectrum.shape[-1] != count:
        raise ParameterError(
            f"spectrum of shape {spectrum.shape} needs {count} values along its last axis (380:780:5 nm)"
        )
    return spectrum @ weights()
