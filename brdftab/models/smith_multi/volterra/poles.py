"""Reflectances as sums of poles in X = 4 cos^2, shared by all wavelengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brdftab.materials import formulas
from brdftab.materials.fresnel import CONDUCTOR, MIRROR

# error asked, number of poles, log10 of the smallest and of the largest one
LEVELS = (
    (1e-2, 6, -4.0, 1.0),
    (1e-3, 10, -5.0, 1.0),
    (1e-4, 12, -6.0, 1.0),
    (1e-5, 16, -6.0, 2.0),
    (1e-6, 22, -8.0, 2.0),
    (1e-7, 28, -10.0, 2.0),
    (0.0, 36, -12.0, 2.0),
)


@dataclass(frozen=True)
class Fit:
    """F = constant + sum_j coefficients_j/(X + scales_j) at W wavelengths.

    Attributes
    ----------
    constant : ndarray (W,)
        Value far from all poles.
    coefficients : ndarray (W, J)
        One for each pole.
    scales : ndarray (J,)
        Positive, increasing.
    error : float
        Largest absolute error on cosines from 0 to 1.
    """

    constant: np.ndarray
    coefficients: np.ndarray
    scales: np.ndarray
    error: float


def fit(kind: int, a: np.ndarray, b: np.ndarray, tolerance: float) -> Fit:
    """Fit reflectances (kind, a and b of `materials.fresnel.Fresnel`) by poles.

    Parameters
    ----------
    kind : int
        0 mirror, 1 conductor, 3 Schlick.
    a, b : ndarray (W,)
        Their numbers at each wavelength.
    tolerance : float
        Absolute error asked; what was reached, where cosines tend to 0, is `Fit.error`.
    """
    if kind == MIRROR:
        return Fit(np.ones(a.size), np.empty((a.size, 0)), np.empty(0), 0.0)
    _, count, low, high = next(level for level in LEVELS if tolerance >= level[0])
    scales = 10.0 ** np.linspace(low, high, count)
    cosine = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 1200)])
    wide = cosine[:, None]
    exact = formulas.conductor(a, b, wide) if kind == CONDUCTOR else formulas.schlick(a, wide)
    x = 4.0 * wide * wide
    basis = np.concatenate([np.ones_like(x), 1.0 / (x + scales)], axis=1)
    size = np.abs(basis).max(axis=0)
    solved = np.linalg.lstsq(basis / size, exact, rcond=1e-14)[0]
    error = float(np.abs(basis / size @ solved - exact).max())
    found = solved / size[:, None]
    return Fit(found[0].copy(), np.ascontiguousarray(found[1:].T), scales, error)
