"""Residuals: how a difference between fit and data is measured, and what outliers and saturated values do to it."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from brdftab.typing import Array

# value (1/sr) added on both sides of each loss: the headline metric's in logeps; log takes that of its data instead
OFFSETS = {"log": 1e-9, "logeps": 1e-3, "cbrt": 1e-9, "cosine": 0.0, "l1p": 1.0}
# share of the data's mean below which no instrument measures: six decades are what the best goniometers span, and the
# mean neither grows with a mirror peak as the largest value does nor falls with dark directions as the median does
DARK = 1e-6
LOSSES = tuple(OFFSETS)
MEANING = {
    "log": "ln f",
    "logeps": "ln(f + 0.001/sr)",
    "cbrt": "cube root of f cos(theta_i)",
    "cosine": "f cos(theta_i)",
    "l1p": "ln(1 + f)",
}


def dark(values: Array) -> float:
    """Return the value (1/sr) that the log loss adds on both sides, from the valid values of all channels."""
    return max(DARK * float(np.mean(np.maximum(values, 0.0))), 1e-300) if values.size else OFFSETS["log"]


def transform(loss: str, f: Any, cosine: Any, floor: Any = OFFSETS["log"]) -> Any:
    """Return what the residual compares; `f` (..., N) in 1/sr, `cosine` (N,) of theta_i. NumPy or JAX arrays.

    `floor` is the offset of the log loss in 1/sr.
    """
    xp = jnp if not isinstance(f, np.ndarray) else np
    if loss == "cosine":
        return f * cosine
    if loss == "cbrt":
        return xp.cbrt(xp.maximum(f, 0.0) * cosine + OFFSETS["cbrt"])
    return xp.log(xp.maximum(f, 0.0) + (floor if loss == "log" else OFFSETS[loss]))


def usable(loss: str, values: Array) -> NDArray[np.bool_]:
    """Tell which values a loss can use: a logarithm needs positive ones."""
    return values > 0.0 if loss == "log" else values > -0.5 * max(OFFSETS[loss], 1e-3)


def noise_weight(loss: str, values: Array, floor: float) -> Array:
    """Return residual weights (N, C): 1 far above the `floor` (1/sr) of the noise, 1/sqrt 2 at it, f/floor below."""
    if floor == 0.0:
        return np.ones_like(values)
    whole = np.maximum(values, 0.0) + (0.0 if loss in ("cosine", "cbrt") else OFFSETS[loss])
    return whole / np.hypot(whole, floor)


def soft_l1(r: Any, scale: Any) -> Any:
    """Return the residual whose square is the soft-L1 loss: 2 s^2 (sqrt(1 + (r/s)^2) - 1)."""
    return r * jnp.sqrt(2.0 / (1.0 + jnp.sqrt(1.0 + (r / scale) ** 2)))


def curvature(r: Any, scale: Any) -> Any:
    """Return half the second derivative of the soft-L1 loss by r, which the covariance needs."""
    return (1.0 + (r / scale) ** 2) ** -1.5


def robust_scale(r: Array) -> float:
    """Return 1.4826 times the median absolute residual: one standard deviation of normal noise."""
    return float(1.4826 * np.median(np.abs(r))) if r.size else 1.0
