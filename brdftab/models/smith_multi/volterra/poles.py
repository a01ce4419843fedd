"""Reflectances as sums of poles in X = 4 cos^2, shared by all wavelengths."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

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
# more poles are taken where the fit leaves so many times the tolerance of F: the bounces it serves are a part of f
ROOM = 3.0
# what the finest fit may leave of F; indices below 1 without absorption reflect all light from an angle on, a kink that
# poles do not follow: .04 is left at eta .1, .2 at .5
MOST_LEFT = 3e-4
# cosines at which that is measured
EVEN = (np.arange(400) + 1.0) / 400.0


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
    left : float
        Largest relative error over the wavelengths, rms over the cosines, weighted by them.
    """

    constant: np.ndarray
    coefficients: np.ndarray
    scales: np.ndarray
    error: float
    left: float = 0.0

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        """Return the fitted reflectance (N, W) at cosines (N,)."""
        over = 1.0 / (4.0 * cosine[:, None] ** 2 + self.scales)
        return np.asarray(self.constant + over @ self.coefficients.T)


def fit(kind: int, a: np.ndarray, b: np.ndarray, tolerance: float) -> Fit:
    """Fit reflectances (kind, a and b of `materials.fresnel.Fresnel`) by poles.

    Parameters
    ----------
    kind : int
        0 mirror, 1 conductor, 3 Schlick.
    a, b : ndarray (W,)
        Their numbers at each wavelength.
    tolerance : float
        Error asked; more poles than usual are taken where they are needed. What was reached is `Fit.error`, where
        cosines tend to 0, too, and `Fit.left`.
    """
    if kind == MIRROR:
        return Fit(np.ones(a.size), np.empty((a.size, 0)), np.empty(0), 0.0)
    best = None
    for level in LEVELS[next(n for n, level in enumerate(LEVELS) if tolerance >= level[0]) :]:
        found = _fitted(kind, a, b, *level[1:])
        if best is None or found.left < best.left:
            best = found
        if best.left <= ROOM * tolerance:
            break
    assert best is not None
    return best


def _exact(kind: int, a: np.ndarray, b: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Return the reflectance (N, W) at cosines (N,)."""
    wide = cosine[:, None]
    return formulas.conductor(a, b, wide) if kind == CONDUCTOR else formulas.schlick(a, wide)


def _fitted(kind: int, a: np.ndarray, b: np.ndarray, count: int, low: float, high: float) -> Fit:
    """Fit so many poles between powers of ten."""
    scales = 10.0 ** np.linspace(low, high, count)
    cosine = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 1200)])
    exact = _exact(kind, a, b, cosine)
    x = 4.0 * cosine[:, None] ** 2
    basis = np.concatenate([np.ones_like(x), 1.0 / (x + scales)], axis=1)
    size = np.abs(basis).max(axis=0)
    solved = np.linalg.lstsq(basis / size, exact, rcond=1e-14)[0]
    error = float(np.abs(basis / size @ solved - exact).max())
    found = solved / size[:, None]
    made = Fit(found[0].copy(), np.ascontiguousarray(found[1:].T), scales, error)
    even = _exact(kind, a, b, EVEN)
    apart = EVEN @ (made(EVEN) - even) ** 2 / np.maximum(EVEN @ even**2, np.finfo(float).tiny)
    return replace(made, left=float(np.sqrt(apart.max(initial=0.0))))


@lru_cache(maxsize=256)
def followed(kind: int, a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Tell whether poles follow the reflectance of a conductor at all its wavelengths."""
    if kind != CONDUCTOR:
        return True
    return fit(kind, np.array(a), np.array(b), MOST_LEFT / ROOM).left <= MOST_LEFT
