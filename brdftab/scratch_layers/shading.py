"""What a footprint of scratched material reflects: layers and base, weighted by the areas that they cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdftab.errors import ParameterError
from brdftab.evaluation.points import evaluate_setup
from brdftab.models.resolve import Setup
from brdftab.scratch_layers.combine import weights
from brdftab.scratch_layers.layers import Layered
from brdftab.typing import Array

# what is asked of the base, and of the rays through a scratch (512 a bin)
BASE, TRACE = 1e-6, 1e-3


def _spread(values: Array, channels: int) -> Array:
    """Return (..., C): one channel counts in each."""
    return np.broadcast_to(values, (*values.shape[:-1], channels))


def evaluate(
    layered: Layered,
    alpha: ArrayLike,
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    phi: ArrayLike,
    *,
    phi_i: ArrayLike = 0.0,
    combination: str | None = None,
) -> Array:
    """Evaluate the BRDF of a footprint: sum w_k f_k + w_base f_base.

    Parameters
    ----------
    layered : Layered
    alpha : array_like (..., K)
        Shares of area, from `AlphaMaps.at`; their leading axes broadcast against the angles.
    theta_i, theta_o, phi, phi_i : array_like (...)
        Directions as in `brdftab.evaluate`, radians; azimuth 0 is u.
    combination : str, optional
        Instead of the file's; see `brdftab.scratch_layers.combine.weights`.

    Returns
    -------
    ndarray (..., C)
        In 1/sr without cosine; of a flat interface as base without its mirror reflection, a delta that pictures
        contain. Layers without area are not evaluated, and each distinct profile is traced once.

    Raises
    ------
    ParameterError
        If alpha does not have a share a layer, or an angle is not valid.
    """
    share = np.asarray(alpha, dtype=np.float64)
    count = len(layered.layers)
    if share.ndim == 0 or share.shape[-1] != count:
        raise ParameterError(
            f"alpha of shape {share.shape} does not end in the number of layers, {count}; give one each"
        )
    each, rest = weights(share, combination or layered.combination)
    channels = len(layered.channels)
    shape = np.broadcast_shapes(rest.shape, *(np.shape(a) for a in (theta_i, theta_o, phi, phi_i)))
    total: Array = np.zeros((*shape, channels))
    if np.any(rest > 0.0):
        total = total + rest[..., None] * _spread(values(layered.base, theta_i, theta_o, phi, phi_i, BASE), channels)
    for k, layer in enumerate(layered.layers):
        if not np.any(each[..., k] > 0.0):
            continue
        # the model's own azimuth 0 lies along its scratches
        turned = np.asarray(phi_i, dtype=np.float64) - layer.angle
        found = values(layer.setup(layered.psi), theta_i, theta_o, phi, turned, TRACE)
        total = total + each[..., k, None] * _spread(found, channels)
    return total


def values(
    setup: Setup, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike, phi_i: ArrayLike, tolerance: float
) -> Array:
    """Return f (..., C) of one model."""
    return evaluate_setup(setup, theta_i, theta_o, phi, phi_i, 0, tolerance)[..., 0, :]
