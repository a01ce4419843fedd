"""Polynomials of the projected Fresnel reflectance for loops that vectorise.

Reflectances have their singularities at small negative cosines. A Moebius map of the cosine moves these away, so that a
polynomial in the mapped variable converges fast; and the further a range of cosines stays from grazing, the lower its
degree. A row of a table therefore takes the polynomials of the narrowest zone [start, 1] that holds its cosines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from brdftab.materials.fresnel import Fresnel, reflectance

# smallest cosines of the zones; degrees are multiples of 4, as the kernels take four coefficients at a time
STARTS = (0.0, 0.25, 0.45, 0.75)
DEGREES = tuple(range(4, 49, 4))
# poles of the map c/(c + b) that suit metals and dielectrics; the plain cosine suits Schlick
POLES = (0.5, 1.0, 0.3, 0.8, 2.0, math.inf)
# a channel fainter than this part of the brightest one is judged by the brightest one
DARK = 1e-3
# Chebyshev nodes and polynomials of the series that are cut to a degree
NODES = np.cos(np.pi * (np.arange(96) + 0.5) / 96)
BASIS = np.polynomial.chebyshev.chebvander(NODES, 63)
# further degrees cannot mend an error above this at degree 24
HOPELESS = (24, 1e-2)


@dataclass(frozen=True)
class Fit:
    """Polynomials of a reflectance, one set a zone.

    Attributes
    ----------
    starts : float64 (Z,)
        Smallest cosine of each zone, increasing from 0.
    degrees : int64 (Z,)
        Degree of each zone, a multiple of 4.
    maps : float64 (Z, 4)
        m1, m0, d1, d0 of x = (m1 c + m0)/(d1 c + d0), which takes [start, 1] to [-1, 1].
    coefficients : float64 (Z, C, K)
        Highest power first; a zone uses its first degree + 1 ones.
    error : float
        Largest error relative to the channel, or to a thousandth of the brightest one where that is larger.
    """

    starts: np.ndarray
    degrees: np.ndarray
    maps: np.ndarray
    coefficients: np.ndarray
    error: float

    def arrays(self, dtype: type) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return starts, degrees, maps and coefficients, the last two in that type, for the kernels."""
        return self.starts, self.degrees, self.maps.astype(dtype), self.coefficients.astype(dtype)


def _map(start: float, pole: float) -> tuple[float, float, float, float]:
    """Return m1, m0, d1, d0 of the map of [start, 1] to [-1, 1] with a pole at -pole."""
    if math.isinf(pole):
        return 2.0 / (1.0 - start), -(1.0 + start) / (1.0 - start), 0.0, 1.0
    low, high = start / (start + pole), 1.0 / (1.0 + pole)
    scale = 2.0 / (high - low)
    shift = -1.0 - scale * low
    # scale c/(c + pole) + shift over one denominator, so that the sum does not cancel
    return scale + shift, shift * pole, 1.0, pole


def _evaluate(coefficients: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Evaluate polynomials (C, K), highest power first, in the type of x (N,); returns (N, C)."""
    value = np.zeros((x.size, coefficients.shape[0]), x.dtype)
    for column in coefficients.astype(x.dtype).T:
        value = value * x[:, None] + column
    return value


def _series(fresnel: Fresnel, mapping: tuple[float, float, float, float]) -> np.ndarray:
    """Return the Chebyshev series (64, C) of the reflectance in the mapped variable."""
    m1, m0, d1, d0 = mapping
    cosine = (NODES * d0 - m0) / (m1 - NODES * d1)
    # on these nodes the Chebyshev polynomials are orthogonal
    series = BASIS.T @ (reflectance(fresnel, cosine) @ fresnel.weights) * (2.0 / NODES.size)
    series[0] *= 0.5
    return series


def _powers(series: np.ndarray) -> np.ndarray:
    """Return the power coefficients (C, K), highest first, of Chebyshev series (K, C)."""
    return (_to_powers()[: len(series), : len(series)].T @ series)[::-1].T


@cache
def _to_powers() -> np.ndarray:
    """Return the power coefficients, lowest first, of the Chebyshev polynomials, a row each."""
    rows = np.zeros((DEGREES[-1] + 1, DEGREES[-1] + 1))
    rows[0, 0] = rows[1, 1] = 1.0
    for n in range(2, len(rows)):
        rows[n, 1:] = 2.0 * rows[n - 1, :-1]
        rows[n] -= rows[n - 2]
    return rows


def _fit_zone(fresnel: Fresnel, start: float, target: float, dtype: type) -> tuple[np.ndarray, np.ndarray, float]:
    """Return coefficients, map and error of the lowest degree that meets the target on [start, 1], else of the best."""
    cosine = np.linspace(start, 1.0, 401)
    if start == 0.0:
        cosine = np.concatenate([cosine, np.geomspace(1e-6, 2e-3, 50)])
    exact = reflectance(fresnel, cosine) @ fresnel.weights
    size = np.maximum(np.abs(exact), DARK * np.abs(exact).max(axis=1, keepdims=True))
    size = np.maximum(size, np.finfo(np.float64).tiny)
    mappings = [_map(start, pole) for pole in POLES]
    candidates = [_series(fresnel, mapping) for mapping in mappings]
    best: tuple[np.ndarray, np.ndarray, float] | None = None
    for degree in DEGREES:
        # the pole that leaves least in the rest of the series
        pole = int(np.argmin([np.abs(series[degree + 1 :]).sum(axis=0).max() for series in candidates]))
        m1, m0, d1, d0 = mappings[pole]
        coefficients = _powers(candidates[pole][: degree + 1])
        x: np.ndarray = ((m1 * cosine + m0) / (d1 * cosine + d0)).astype(dtype)
        error = float((np.abs(_evaluate(coefficients, x) - exact) / size).max())
        if best is None or error < best[2]:
            best = coefficients, np.array(mappings[pole]), error
        if best[2] <= target or (degree == HOPELESS[0] and best[2] > HOPELESS[1]):
            break
    assert best is not None
    return best


def fit(fresnel: Fresnel, target: float, dtype: type) -> Fit:
    """Fit each channel's reflectance on the zones [start, 1] of the cosine.

    Parameters
    ----------
    fresnel : Fresnel
        The reflectance; its projection to channels is part of the polynomials.
    target : float
        Relative error that ends the search for a degree; what was reached is `Fit.error`.
    dtype : type
        Type in which the kernels will evaluate, and in which the error is measured.
    """
    found = [_fit_zone(fresnel, start, target, dtype) for start in STARTS]
    widest = max(coefficients.shape[1] for coefficients, _, _ in found)
    packed = np.zeros((len(found), fresnel.weights.shape[1], widest))
    for zone, (coefficients, _, _) in zip(packed, found, strict=True):
        zone[:, : coefficients.shape[1]] = coefficients
    return Fit(
        np.array(STARTS),
        np.array([coefficients.shape[1] - 1 for coefficients, _, _ in found]),
        np.stack([mapping for _, mapping, _ in found]),
        packed,
        max(error for _, _, error in found),
    )
