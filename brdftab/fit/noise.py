"""The noise of data as the residuals of a fit show it: by how much neighbouring directions disagree."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdftab.typing import Array

Mask = NDArray[np.bool_]
# fewer pairs say nothing of a spread
FEWEST = 50
# radians; directions this near to each other's reversal are copies where data were made reciprocal
REVERSED = 1e-6


def neighbour_noise(theta_i: Array, theta_o: Array, phi: Array, residuals: Array, valid: Mask) -> float | None:
    """Return the standard deviation of the independent noise in residuals.

    A misfit changes little between neighbours while noise is another in each, so that half the mean squared difference
    of neighbours is the variance of the noise, and of what structure is narrower than their distance.

    Parameters
    ----------
    theta_i, theta_o, phi : ndarray (N,)
        Directions of the data, radians.
    residuals : ndarray (N, C)
        Of any unit; entries that are not valid may be anything.
    valid : ndarray of bool (N, C)

    Returns
    -------
    float or None
        In the unit of the residuals; None where too few neighbours are valid.
    """
    a, b = _pairs(theta_i, theta_o, phi)
    # data that were made reciprocal hold each value twice
    gap = np.abs(theta_i[a] - theta_o[b]) + np.abs(theta_o[a] - theta_i[b]) + np.abs(phi[a] - phi[b])
    a, b = a[gap > REVERSED], b[gap > REVERSED]
    both = valid[a] & valid[b]
    if both.sum() < FEWEST:
        return None
    step = residuals[a][both] - residuals[b][both]
    return math.sqrt(0.5 * float(np.mean(step * step)))


def _pairs(theta_i: Array, theta_o: Array, phi: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return indices (K,), (K,) of directions that are neighbours: halves of halves, each across its longest side."""
    count = 2 ** int(math.log2(max(theta_i.size, 1)))
    if count < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    s = np.sin(theta_o)
    places = np.stack([np.sin(theta_i), np.cos(theta_i), s * np.cos(phi), s * np.sin(phi), np.cos(theta_o)], axis=1)
    # any share of the directions will do
    block = np.random.default_rng(0).permutation(theta_i.size)[:count].reshape(1, count)
    while block.shape[1] > 2:
        inside = places[block]
        side = np.ptp(inside, axis=1).argmax(axis=1)
        along = np.take_along_axis(inside, side[:, None, None], axis=2)[..., 0]
        order = np.argsort(along, axis=1, kind="stable")
        block = np.take_along_axis(block, order, axis=1).reshape(-1, block.shape[1] // 2)
    return block[:, 0], block[:, 1]
