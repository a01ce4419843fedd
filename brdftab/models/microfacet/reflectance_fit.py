"""Polynomials of the projected Fresnel reflectance for loops that vectorise.

Reflectances have their singularities at small negative cosines. A Moebius map of the cosine moves these away, so that a
polynomial in the mapped variable converges fast; and the further a range of cosines stays from grazing, the lower its
degree. A row of a table therefore takes the polynomials of the narrowest zone [start, 1] that holds its cosines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from brdftab.materials.fresnel import Fresnel, reflectance

# smallest cosines of the zones; degrees are multiples of 4, as the kernels take four coefficients at a time
STARTS = (0.0, 0.25, 0.45, 0.75)
DEGREES = tuple(range(4, 49, 4))
# poles of the map c/(c + b) that suit metals and dielectrics; the plain cosine suits Schlick
POLES = (0.5, 1.0, 0.3, 0.8, 2.0, math.inf)
# a channel fainter than this part of the brightest one is judged by the brightest one
DARK = 1e-3
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


def _interpolate(fresnel: Fresnel, mapping: tuple[float, float, float, float], degree: int) -> np.ndarray:
    """Return power coefficients (C, degree + 1), highest first, from a Chebyshev series in the mapped variable."""
    m1, m0, d1, d0 = mapping
    count = 2 * degree
    nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    cosine = (nodes * d0 - m0) / (m1 - nodes * d1)
    # on these nodes the Chebyshev polynomials are orthogonal
    basis = np.polynomial.chebyshev.chebvander(nodes, degree)
    series = basis.T @ (reflectance(fresnel, cosine) @ fresnel.weights) * (2.0 / count)
    series[0] *= 0.5
    coefficients = np.zeros((series.shape[1], degree + 1))
    for row, column in zip(coefficients, series.T, strict=True):
        powers = np.polynomial.chebyshev.cheb2poly(column)
        row[degree + 1 - powers.size :] = powers[::-1]
    return coefficients


def _fit_zone(fresnel: Fresnel, start: float, target: float, dtype: type) -> tuple[np.ndarray, np.ndarray, float]:
    """Return coefficients, map and error of the lowest degree that meets the target on [start, 1], else of the best."""
    cosine = np.linspace(start, 1.0, 401)
    if start == 0.0:
        cosine = np.concatenate([cosine, np.geomspace(1e-6, 2e-3, 50)])
    exact = reflectance(fresnel, cosine) @ fresnel.weights
    size = np.maximum(np.abs(exact), DARK * np.abs(exact).max(axis=1, keepdims=True))
    size = np.maximum(size, np.finfo(np.float64).tiny)
    best: tuple[np.ndarray, np.ndarray, float] | None = None
    for degree in DEGREES:
        for pole in POLES:
            mapping = _map(start, pole)
            m1, m0, d1, d0 = mapping
            coefficients = _interpolate(fresnel, mapping, degree)
            x = ((m1 * cosine + m0) / (d1 * cosine + d0)).astype(dtype)
            error = float((np.abs(_evaluate(coefficients, x) - exact) / size).max())
            if best is None or error < best[2]:
                best = coefficients, np.array(mapping), error
        assert best is not None
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
