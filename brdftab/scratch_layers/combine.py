"""From the areas that layers cover to the weights of what they reflect (Eq. 4), and what culling costs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.errors import ParameterError
from brdftab.typing import Array

COMBINATIONS = ("normalised", "union")


def weights(alpha: ArrayLike, combination: str = "normalised") -> tuple[Array, Array]:
    """Return the weight of each layer and of the base; they add up to 1.

    Parameters
    ----------
    alpha : array_like (..., K)
        Shares of the footprint that the layers cover, each in [0, 1].
    combination : {"normalised", "union"}
        ``normalised`` is Eq. 4: shares add up, and are divided by their sum where it exceeds 1, so that overlaps cover
        twice elsewhere. ``union`` lets layers lie independently: they cover 1 - prod(1 - alpha) together, shared in
        proportion to their areas.

    Returns
    -------
    tuple of ndarray
        Weights (..., K) and the base's weight (...).

    Raises
    ------
    ParameterError
        If a share is outside [0, 1] or the combination is unknown.
    """
    a = np.asarray(alpha, dtype=np.float64)
    wrong = ~((a >= 0.0) & (a <= 1.0))
    if wrong.any():
        raise ParameterError.out_of_range("alpha", f"{a[wrong].flat[0]:g}", "[0, 1]", "it is a share of area")
    total = a.sum(axis=-1)
    if combination == "normalised":
        return a / np.maximum(total, 1.0)[..., None], np.maximum(1.0 - total, 0.0)
    if combination == "union":
        # 1 - prod(1 - alpha) without the cancellation that small shares would suffer
        with np.errstate(divide="ignore"):
            joint = -np.expm1(np.log1p(-a).sum(axis=-1))
        share = np.divide(joint, total, out=np.ones_like(total), where=total > 0.0)
        return a * share[..., None], 1.0 - joint
    raise ParameterError.not_known("combination", combination, COMBINATIONS)


def culled(alpha: NDArray[np.float32], threshold: float) -> tuple[NDArray[np.float32], dict[str, float]]:
    """Return the shares with those below a threshold set to 0, and what that costs.

    Parameters
    ----------
    alpha : float32 (K, ...)
        A layer each.
    threshold : float
        In [0, 1]; the paper takes 1e-6.

    Returns
    -------
    tuple
        Shares, and a dict: ``alive`` (layers kept at a texel, on average), ``bound`` (largest sum of what is dropped at
        a texel: f changes by at most that times the largest difference of a layer's f and the base's), ``area`` (mean
        of that sum).
    """
    keep = alpha >= threshold if threshold > 0.0 else alpha > 0.0
    lost = np.where(keep, np.float32(0.0), alpha).sum(axis=0, dtype=np.float64)
    facts = {
        "alive": float(keep.mean() * alpha.shape[0]),
        "bound": float(lost.max(initial=0.0)),
        "area": float(lost.mean()),
    }
    return np.where(keep, alpha, np.float32(0.0)), facts
