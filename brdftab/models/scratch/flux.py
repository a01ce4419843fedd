"""From counts of rays to a flux matrix that is reciprocal and keeps energy.

T[k, j] is the flux that a scratch, lit evenly over its aperture from the angles of bin j, sends into bin k: T = T^T is
reciprocity, a column's sum is C[j] = int_bin cos p dp less what the cap of bounces cuts off. Counted rays hold neither
exactly: averaging T with its transpose gives the first at the cost of the second, and symmetric scaling
T <- g T g mends both.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.jit import parallel_kernel
from brdftab.models.scratch.shoot import GRAZING
from brdftab.models.scratch.tracer import GROUPS
from brdftab.typing import Array

ROUNDS = 4000
CLOSE = 1e-12
# numbers beside the flux: bounces, representative cosines, spread of the smallest and what the others do with it
FACTS = 3 + GROUPS


def edges(bins: int) -> Array:
    """Return the edges (M + 1,) of M equal bins of angle across the scratch, radians."""
    return np.linspace(-0.5 * math.pi, 0.5 * math.pi, bins + 1)


def aperture(bins: int) -> Array:
    """Return C (M,), the integral of cos p over each bin; 2 in all."""
    return np.diff(np.sin(edges(bins)))


@parallel_kernel
def _gather(counts, share, trust, symmetric, flux, facts):
    """Fill flux (L, M, M) and facts (L, FACTS, M, M) from counts (M, L, M, KEPT), each path with its reverse.

    Columns count by the number of their angles, `trust` (M,). Of a symmetric profile the second half of the columns is
    counted; a path and its mirror image weigh the same.
    """
    bins, layers, _, kept = counts.shape
    for n in numba.prange(bins):
        # long and short rows take turns
        k = n // 2 if n % 2 == 0 else bins - 1 - n // 2
        sums = np.empty(kept)
        for layer in range(layers):
            for j in range(k + 1):
                for m in range(kept):
                    if symmetric:
                        a = counts[j, layer, k, m] if 2 * j >= bins else counts[bins - 1 - j, layer, bins - 1 - k, m]
                        b = counts[k, layer, j, m] if 2 * k >= bins else counts[bins - 1 - k, layer, bins - 1 - j, m]
                    else:
                        a, b = counts[j, layer, k, m], counts[k, layer, j, m]
                    sums[m] = (a * share[j] * trust[j] + b * share[k] * trust[k]) / (trust[j] + trust[k])
                mass = sums[0]
                flux[layer, k, j] = flux[layer, j, k] = mass
                if mass <= 0.0:
                    continue
                least = sums[2] / mass
                spread = math.sqrt(max(sums[2 + GROUPS] / mass - least * least, 0.0))
                groups = min(max(1, (layer + 2) // 3 + 1 if layer > 0 else 1), GROUPS)
                others = 0.0
                for g in range(1, groups):
                    others += sums[2 + g] / mass / (groups - 1)
                tilt = 0.0
                if spread > 1e-6 and groups > 1:
                    tilt = (sums[3 + GROUPS] / mass - least * others) / spread
                for m in range(1 + GROUPS):
                    facts[layer, m, k, j] = facts[layer, m, j, k] = sums[1 + m] / mass
                facts[layer, 1 + GROUPS, k, j] = facts[layer, 1 + GROUPS, j, k] = spread
                facts[layer, 2 + GROUPS, k, j] = facts[layer, 2 + GROUPS, j, k] = tilt


def balanced(flux: Array, target: Array) -> tuple[Array, float]:
    """Return factors g (M,) that make the row sums of the symmetric matrix g T g equal to the target, and how well.

    Parameters
    ----------
    flux : ndarray (M, M)
        Symmetric, not negative.
    target : ndarray (M,)
        Sums asked.

    Returns
    -------
    tuple
        Factors, and the largest relative deviation of a sum.
    """
    g = np.ones(target.size)
    best, deviation = g, math.inf
    for _ in range(ROUNDS):
        sums = g * (flux @ g)
        ratio = np.ones_like(target)
        np.divide(target, sums, out=ratio, where=(target > 0.0) & (sums > 0.0))
        now = float(np.abs(1.0 / ratio - 1.0).max())
        if now < deviation:
            best, deviation = g, now
        if now <= CLOSE:
            break
        # the root keeps the scaling symmetric and damps its swing
        g = g * np.sqrt(ratio)
    return best, deviation


def assemble(counts: Array, lost: Array, symmetric: bool) -> tuple[Array, NDArray[np.float32], float, Array]:
    """Return the flux matrices and what else is kept of the rays.

    Parameters
    ----------
    counts : ndarray (M, L, M, KEPT)
        By incident bin, layer and exit bin, from `shoot`.
    lost : ndarray (M,)
        Share of a column's rays that the cap cuts off.
    symmetric : bool
        Only the second half of the columns is counted.

    Returns
    -------
    flux : ndarray (L, M, M)
        By layer, exit and incident bin, symmetric.
    facts : float32 (L, FACTS, M, M)
        Mean number of bounces, representative cosines, spread of the smallest one, and by how much the others move with
        it; 0 where there is no flux.
    deviation : float
        Largest relative deviation of a column's sum.
    change : ndarray (M,)
        Factors of the scaling: how far the rays were from keeping energy.
    """
    bins, layers = lost.size, counts.shape[1]
    c = aperture(bins)
    flux = np.zeros((layers, bins, bins))
    facts = np.zeros((layers, FACTS, bins, bins), dtype=np.float32)
    trust = np.ones(bins)
    trust[0] = trust[-1] = GRAZING
    _gather(counts, c, trust, symmetric, flux, facts)
    g, deviation = balanced(flux.sum(axis=0), c * (1.0 - lost))
    flux *= g[:, None] * g
    return flux, facts, deviation, g
