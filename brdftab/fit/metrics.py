"""How far a fit is from its data, in the ways that are in use, and where."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from brdftab.errors import ParameterError
from brdftab.typing import Array

OFFSET = 1e-3
# what is darker (1/sr) counts as this in the log-RMS, in fit and data alike: no one measures it
LEAST = 1e-9


def metrics(
    fit: ArrayLike,
    data: ArrayLike,
    valid: ArrayLike,
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    floor: float = LEAST,
) -> dict[str, float]:
    """Return the error metrics over the valid values of all channels together.

    With g the fit, f the data (1/sr), <> the mean over valid values, c = cos(theta_i), e = 0.001/sr:

    - ``logeps`` = sqrt <ln((g + e)/(f + e))^2>, the headline: relative where f is large, absolute below e;
    - ``log_rms`` = sqrt <ln(g/f)^2> over f > 0; g and f below the `floor` count as the floor;
    - ``cube_root_rms`` = sqrt(<(cbrt(g c) - cbrt(f c))^2> / <cbrt(f c)^2>), the perceptual metric of Fores et al.,
      "Toward a Perceptually Based Metric for BRDF Modeling", CIC 2012, with the cosine of the light, relative to the
      data;
    - ``cosine_rms`` = sqrt(<(c (g - f))^2> / <(c f)^2>), ruled by the peaks;
    - ``l1p`` = sqrt <(log10(1 + g) - log10(1 + f))^2>.

    Parameters
    ----------
    fit, data : array_like, shape (N, C)
        1/sr without cosine. In the logarithms and roots negative values count as 0.
    valid : array_like of bool, shape (N, C)
    theta_i, theta_o : array_like, shape (N,)
        Radians. Only theta_i enters, `theta_o` is checked for its shape.
    floor : float, optional
        1/sr, above 0.

    Returns
    -------
    dict of str to float
        The five names above, each 0 for a perfect fit.

    Raises
    ------
    ParameterError
        Where shapes do not fit, nothing is valid, or a valid number is not finite.
    """
    g, f, cosine = _pooled(fit, data, valid, theta_i, theta_o)
    ratio = log_ratio(g, f, floor)[f > 0.0]
    g0, f0 = np.maximum(g, 0.0), np.maximum(f, 0.0)
    root = np.cbrt(f0 * cosine)
    return {
        "logeps": _rms(np.log((g0 + OFFSET) / (f0 + OFFSET))),
        "log_rms": _rms(ratio),
        "cube_root_rms": _relative(np.cbrt(g0 * cosine) - root, root),
        "cosine_rms": _relative(cosine * (g - f), cosine * f),
        "l1p": _rms((np.log1p(g0) - np.log1p(f0)) / math.log(10.0)),
    }


def log_ratio(fit: Array, data: Array, floor: float) -> Array:
    """Return ln(g/f), both at least the `floor` (1/sr)."""
    return np.asarray(np.log(np.maximum(fit, floor) / np.maximum(data, floor)))


def error_by_theta(
    fit: ArrayLike, data: ArrayLike, valid: ArrayLike, theta_i: ArrayLike, edges: ArrayLike
) -> list[dict[str, Any]]:
    """Return the error ln((g + e)/(f + e)), e = 0.001/sr, by the polar angle of the light.

    Parameters
    ----------
    fit, data : array_like, shape (N, C)
        1/sr without cosine.
    valid : array_like of bool, shape (N, C)
    theta_i : array_like, shape (N,)
        Radians.
    edges : array_like, shape (K + 1,)
        Increasing, radians; an angle on an inner edge belongs to the bin above, on the last one to the last bin.

    Returns
    -------
    list of dict, K of them
        ``low``, ``high`` (radians), ``count`` (valid values), ``mean`` and ``rms`` (None where there is no value). A
        mean far from 0 beside its rms is structure that the model cannot follow.

    Raises
    ------
    ParameterError
        As `metrics`, and where `edges` do not increase.
    """
    bounds = np.asarray(edges, dtype=np.float64)
    if bounds.ndim != 1 or bounds.size < 2 or not (np.diff(bounds) > 0.0).all():
        raise ParameterError("edges must be at least two increasing angles in radians")
    g, f, theta = _pooled(fit, data, valid, theta_i, theta_i, angle=True)
    error = np.log((np.maximum(g, 0.0) + OFFSET) / (np.maximum(f, 0.0) + OFFSET))
    bins = np.where(theta == bounds[-1], bounds.size - 2, np.searchsorted(bounds, theta, side="right") - 1)
    found = []
    for k in range(bounds.size - 1):
        here = error[bins == k]
        found.append(
            {
                "low": float(bounds[k]),
                "high": float(bounds[k + 1]),
                "count": int(here.size),
                "mean": float(here.mean()) if here.size else None,
                "rms": _rms(here) if here.size else None,
            }
        )
    return found


def _pooled(
    fit: ArrayLike, data: ArrayLike, valid: ArrayLike, theta_i: ArrayLike, theta_o: ArrayLike, angle: bool = False
) -> tuple[Array, Array, Array]:
    """Return valid values of all channels as flat arrays: fit, data, cos(theta_i) or theta_i itself."""
    g, f = (np.asarray(x, dtype=np.float64) for x in (fit, data))
    use = np.asarray(valid, dtype=bool)
    ti, to = (np.asarray(x, dtype=np.float64) for x in (theta_i, theta_o))
    if f.ndim != 2 or g.shape != f.shape or use.shape != f.shape or ti.shape != f.shape[:1] or to.shape != ti.shape:
        raise ParameterError(
            f"fit {g.shape}, data {f.shape} and valid {use.shape} must all be (N, C), theta_i {ti.shape} and theta_o "
            f"{to.shape} (N,)"
        )
    if not use.any():
        raise ParameterError("no value is valid; metrics need at least one")
    if not (np.isfinite(g[use]).all() and np.isfinite(f[use]).all()):
        raise ParameterError("fit or data hold a valid value that is not finite; mask it out")
    third = np.broadcast_to((ti if angle else np.cos(ti))[:, None], f.shape)
    return g[use], f[use], third[use]


def _rms(x: Array) -> float:
    """Return the root mean square, 0 for no value."""
    return math.sqrt(float(np.mean(x * x))) if x.size else 0.0


def _relative(difference: Array, reference: Array) -> float:
    """Return the RMS of a difference over that of its reference: 0 where both vanish, infinite where only that does."""
    size, gap = _rms(reference), _rms(difference)
    if size == 0.0:
        return 0.0 if gap == 0.0 else math.inf
    return gap / size
