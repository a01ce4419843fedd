"""Fresnel reflectance as a constant and exponentials in X = 4 cos^2, the form that keeps Beckmann's modes closed.

Two ways. `fit` serves all X at once, with some 20 exponentials at 1e-4. A pair of directions sees only X = X_0 (1 +
s t) under the weight exp(-t) of the normals, s <= alpha^2: where alpha is small two to six exponentials in t serve,
the same for all pairs (`local`), with coefficients from the exact reflectance at a few points of each pair.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from brdftab.materials import formulas
from brdftab.materials.fresnel import CONDUCTOR, MIRROR

# (exponentials, smallest and largest y) from coarse to fine
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


# the last sample in t, where exp(-t) is nothing
LONGEST = 20.0
# more exponentials are no gain over `fit`; larger rates need more modes; larger factors lose digits
MOST_RATES = 6
LARGEST_RATE = 8.0
LARGEST_FACTOR = 1e4
# smallest and largest rate tried, in alpha^2
SPREADS = ((1.0, 2.0), (1.0, 4.0), (1.0, 8.0), (0.1, 3.0), (0.1, 6.0))


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
    kind, a, b
        The reflectance itself, see `fit`.
    tolerance : float
        Absolute error asked.
    """

    constant: np.ndarray
    coefficients: np.ndarray
    scales: np.ndarray
    error: float
    depth: float
    kind: int
    a: np.ndarray
    b: np.ndarray
    tolerance: float


def _samples() -> np.ndarray:
    """Return cosines at which the fit is made and judged: dense where F bends, at both ends."""
    x = np.linspace(0.0, 1.0, 400)
    return np.unique(np.concatenate([x, x**4, 10.0 ** np.linspace(-5.0, 0.0, 200)]))


def _exact(kind: int, a: np.ndarray, b: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Return the reflectances (N, W) at N cosines."""
    wide = cosine[:, None]
    return np.asarray(formulas.conductor(a, b, wide) if kind == CONDUCTOR else formulas.schlick(a, wide))


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
    own = (depth, kind, np.ascontiguousarray(a, dtype=np.float64), np.ascontiguousarray(b, dtype=np.float64), tolerance)
    if kind == MIRROR:
        return Fit(np.ones(a.size), np.empty((a.size, 0)), np.empty(0), 0.0, *own)
    cosine = _samples()
    exact = _exact(kind, a, b, cosine)
    for count, smallest, largest in LADDER:
        scales = np.geomspace(smallest, largest, count)
        basis = np.column_stack([np.ones(cosine.size), np.exp(-4.0 * cosine[:, None] ** 2 * scales)])
        found = np.linalg.lstsq(basis, exact, rcond=1e-13)[0]
        error = float(np.abs(basis @ found - exact).max())
        if error <= tolerance:
            break
    return Fit(found[0].copy(), np.ascontiguousarray(found[1:].T), scales, error, *own)


@dataclass(frozen=True, eq=False)
class Local:
    """F_w(X_0 (1 + s t)) = sum_n exp(-rates[n] t) sum_k matrix[n, k] F_w(X_0 (1 + s times[k])).

    Attributes
    ----------
    rates : float64 (N,)
        Increasing from 0; empty where `Fit` serves better.
    times : float64 (K,)
    matrix : float64 (N, K)
    error : float
        Largest absolute difference times exp(-t/2) for s <= alpha^2.
    """

    rates: np.ndarray
    times: np.ndarray
    matrix: np.ndarray
    error: float


def _rule(rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return sample times and the least-squares matrix of exponentials with these rates."""
    count = 2 * rates.size
    times = LONGEST * (0.5 * (1.0 - np.cos(math.pi * (np.arange(count) + 0.5) / count))) ** 2
    weight = np.exp(-0.5 * times) * times**0.25
    basis = np.exp(-np.outer(times, rates))
    return times, np.linalg.lstsq(basis * weight[:, None], np.diag(weight), rcond=1e-13)[0]


@lru_cache(maxsize=32)
def local(fitted: Fit, alpha: float) -> Local:
    """Return the fewest exponentials that serve every pair at a roughness within the tolerance of a fit.

    None where there is no such set: then `fit` serves.
    """
    none = Local(np.empty(0), np.empty(0), np.empty((0, 0)), math.inf)
    if fitted.kind == MIRROR:
        return none
    s = alpha * alpha
    t = np.concatenate([np.linspace(0.0, 1.0, 20), np.linspace(1.1, 30.0, 60)])
    start = np.concatenate([np.geomspace(1e-8, 0.1, 8), np.geomspace(0.2, 3.9, 7)])

    def seen(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return X (S, T) of steep and of flat pairs, and the reflectance (S, T, W) there."""
        x = np.concatenate([start[:, None] * (1.0 + part * s * time) for part in (0.1, 1.0)])
        values = _exact(fitted.kind, fitted.a, fitted.b, np.minimum(0.5 * np.sqrt(x), 1.0).reshape(-1))
        return x, values.reshape(*x.shape, -1)

    x, exact = seen(t)
    weight = np.where(x <= 4.0, np.exp(-0.5 * t), 0.0)[..., None]
    for count in range(2, MOST_RATES + 1):
        for low, steep in SPREADS:
            rates = np.append(0.0, s * (np.geomspace(low, steep, count - 1) if count > 2 else np.array([steep])))
            times, matrix = _rule(rates)
            if rates[-1] > LARGEST_RATE or np.abs(matrix).sum(axis=1).max() > LARGEST_FACTOR:
                continue
            found = np.exp(-np.outer(t, rates)) @ matrix @ seen(times)[1]
            error = float((np.abs(found - exact) * weight).max())
            if error <= fitted.tolerance:
                return Local(rates, times, matrix, error)
    return none
