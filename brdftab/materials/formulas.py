"""Unpolarised Fresnel reflectance in numpy: the plain reference; kernels have their own compiled version.

All formulas take ``cos`` in [0, 1] (the cosine between direction and normal, clipped) and broadcast their arguments.
Source: M. Born and E. Wolf, Principles of Optics, 7th ed., sections 1.5 and 14.2.
Schlick's approximation: Computer Graphics Forum 13 (1994), doi:10.1111/1467-8659.1330233; with a term for the dip of
metals: Lazányi and Szirmay-Kalos, Fresnel term approximations for metals, WSCG 2005.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from brdftab.quadrature import gauss

# exponent of the dip's term for all metals; what fitting it, too, would gain: docs/materials.md
DIP_POWER = 6.0
# Gauss nodes in the cosine of the fit
FIT_NODES = 64


def _cosine(cos: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the clipped cosine and the squared sine, the latter without cancellation at normal incidence."""
    c = np.clip(np.asarray(cos, dtype=np.float64), 0.0, 1.0)
    return c, (1.0 - c) * (1.0 + c)


def conductor(eta: ArrayLike, k: ArrayLike, cos: ArrayLike) -> np.ndarray:
    """Return the exact reflectance of an interface from vacuum to the complex index ``eta + ik``.

    Parameters
    ----------
    eta, k : array_like
        Real part (> 0) and extinction coefficient (>= 0).
    cos : array_like
        Cosine of the angle of incidence.

    Returns
    -------
    float64, shape of the broadcast arguments, in [0, 1]
    """
    eta, k = np.asarray(eta, dtype=np.float64), np.asarray(k, dtype=np.float64)
    c, s2 = _cosine(cos)
    # a + ib = sqrt((eta + ik)^2 - sin^2): the smaller part follows from a b = eta k, which avoids cancellation
    e = (eta - 1.0) * (eta + 1.0) + c * c - k * k
    larger = np.sqrt(0.5 * (np.hypot(e, 2.0 * eta * k) + np.abs(e)))
    smaller = np.divide(eta * k, larger, out=np.zeros_like(larger), where=larger > 0.0)
    a, b = np.where(e >= 0.0, larger, smaller), np.where(e >= 0.0, smaller, larger)
    # larger = 0 only for eta = 1, k = 0 at grazing: the interface that is not there
    none = larger + c == 0.0
    down = np.where(none, 1.0, (a + c) ** 2 + b * b)
    rs = ((a - c) ** 2 + b * b) / down
    rp = rs * ((a * c - s2) ** 2 + (b * c) ** 2) / ((a * c + s2) ** 2 + (b * c) ** 2)
    return np.where(none, 0.0, 0.5 * (rs + rp))


def dielectric(ior: ArrayLike, cos: ArrayLike) -> np.ndarray:
    """Return the exact reflectance of an interface from vacuum to a lossless medium, ``ior >= 1``.

    The differences are written as ``(1 - ior^2) / sum^2``, so that nothing cancels as ior tends to 1.

    Parameters
    ----------
    ior : array_like
        Relative index of refraction, at least 1.
    cos : array_like
        Cosine of the angle of incidence.

    Returns
    -------
    float64, shape of the broadcast arguments, in [0, 1]
    """
    ior = np.asarray(ior, dtype=np.float64)
    c, s2 = _cosine(cos)
    contrast = (ior - 1.0) * (ior + 1.0)
    g = np.sqrt(contrast + c * c)  # ior times the cosine inside
    total = c + g
    safe = np.where(total > 0.0, total, 1.0)
    rs = -contrast / (safe * safe)
    rp = rs * (c * g - s2) / (c * g + s2)
    return np.where(total > 0.0, 0.5 * (rs * rs + rp * rp), 0.0)


def schlick(f0: ArrayLike, cos: ArrayLike) -> np.ndarray:
    """Return Schlick's approximation ``f0 + (1 - f0) (1 - cos)^5``.

    Parameters
    ----------
    f0 : array_like
        Reflectance at normal incidence, in [0, 1].
    cos : array_like
        Cosine of the angle of incidence.

    Returns
    -------
    float64, shape of the broadcast arguments, in [0, 1]
    """
    f0 = np.asarray(f0, dtype=np.float64)
    c, _ = _cosine(cos)
    return f0 + (1.0 - f0) * (1.0 - c) ** 5


def lazanyi(f0: ArrayLike, dip: ArrayLike, cos: ArrayLike) -> np.ndarray:
    """Return Schlick's approximation less ``dip cos (1 - cos)^6``, clipped to [0, 1].

    Parameters
    ----------
    f0 : array_like
        Reflectance at normal incidence, in [0, 1].
    dip : array_like
        From `lazanyi_dip`; 0 leaves Schlick's.
    cos : array_like
        Cosine of the angle of incidence.

    Returns
    -------
    float64, shape of the broadcast arguments, in [0, 1]
    """
    c, _ = _cosine(cos)
    return np.clip(schlick(f0, c) - np.asarray(dip, dtype=np.float64) * c * (1.0 - c) ** DIP_POWER, 0.0, 1.0)


@cache
def _fit_nodes() -> tuple[np.ndarray, np.ndarray]:
    """Return cosines and weights of the least squares."""
    x, weight = gauss(FIT_NODES)
    return 0.5 * (1.0 + x), weight


def lazanyi_dip(eta: ArrayLike, k: ArrayLike) -> np.ndarray:
    """Return the factor of `lazanyi` that comes closest to the exact `conductor`: least squares, even in the cosine."""
    c, weight = _fit_nodes()
    n, kappa = (np.asarray(v, dtype=np.float64)[..., None] for v in (eta, k))
    shape = c * (1.0 - c) ** DIP_POWER
    excess = schlick(conductor(n, kappa, 1.0), c) - conductor(n, kappa, c)
    return (excess * shape) @ weight / ((shape * shape) @ weight)
