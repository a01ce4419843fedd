"""Fresnel reflectance as a constant and exponentials in X = 4 cos^2, the form that keeps Beckmann's modes closed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from brdftab.materials import formulas
from brdftab.materials.fresnel import CONDUCTOR, MIRROR

# (terms, smallest and largest y) from coarse to fine
LADDER = (
    (11, 0.2, 2e5),
    (15, 0.1, 2e6),
    (19, 0.1, 2e7),
    (23, 0.1, 2e8),
    (29, 0.1, 2e9),
    (36, 0.1, 2e10),
    (44, 0.1, 2e11),
    (60, 0.1, 2e13),
)


@dataclass(frozen=True, eq=False)
class Fit:
    """F_w(X) = constant[w] + sum_j coefficients[w, j] exp(-scales[j] X), 0 <= X <= 4.

    Attributes
    ----------
    constant : float64 (W,)
    coefficients : float64 (W, J)
    scales : float64 (J,)
        Shared by all wavelengths, increasing.
    error : float
        Largest absolute difference from the exact reflectance, over all wavelengths.
    depth : float
        Modes below exp(-depth) of the largest one of a pair count as zero.
    """

    constant: np.ndarray
    coefficients: np.ndarray
    scales: np.ndarray
    error: float
    depth: float


def _samples() -> np.ndarray:
    """Return cosines at which the fit is made and judged: dense where F bends, at both ends."""
    x = np.linspace(0.0, 1.0, 400)
    return np.unique(np.concatenate([x, x**4, 10.0 ** np.linspace(-5.0, 0.0, 200)]))


def fit(kind: int, a: np.ndarray, b: np.ndarray, tolerance: float) -> Fit:
    """Fit the reflectance of W wavelengths.

    Parameters
    ----------
    kind : int
        0 mirror, 1 conductor, 3 Schlick.
    a, b : float64 (W,)
        Its numbers at each wavelength, see materials/fresnel.py.
    tolerance : float
        Largest absolute error of F wanted.
    """
    depth = min(36.0, 20.0 - math.log(max(tolerance, 1e-16)))
    if kind == MIRROR:
        return Fit(np.ones(a.size), np.empty((a.size, 0)), np.empty(0), 0.0, depth)
    cosine = _samples()
    wide = cosine[:, None]
    exact = formulas.conductor(a, b, wide) if kind == CONDUCTOR else formulas.schlick(a, wide)
    for count, smallest, largest in LADDER:
        scales = np.geomspace(smallest, largest, count)
        basis = np.column_stack([np.ones(cosine.size), np.exp(-4.0 * wide**2 * scales)])
        found = np.linalg.lstsq(basis, exact, rcond=1e-13)[0]
        error = float(np.abs(basis @ found - exact).max())
        if error <= tolerance:
            break
    return Fit(found[0].copy(), np.ascontiguousarray(found[1:].T), scales, error, depth)
