"""Which positions of an axis are enough: cubics in the logarithm of f between them meet a tolerance everywhere else."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdftab.typing import Array

FIRST = 6
# neighbours to either side that count, and the share of them from which on a position is kept, too
REACH, DENSE = 4, 0.5
# halves of a gap leave a sixteenth of a smooth error: beyond so many tolerances quarters are taken at once
FAR = 40.0


def largest(values: Array) -> Array:
    """Return the maximum over the short last axis, which NumPy's own reduction takes many times longer for."""
    found = values[..., 0]
    for channel in range(1, values.shape[-1]):
        found = np.maximum(found, values[..., channel])
    return found


def stencil(
    knots: Array, x: Array, *, even: tuple[float, ...] = (), apart: int = 0, period: float = 0.0
) -> tuple[NDArray[np.int64], Array]:
    """Return the four (or fewer) knots around each position and their Lagrange weights.

    Parameters
    ----------
    knots : ndarray (K,)
        Increasing.
    x : ndarray (N,)
        Positions; beyond the ends the outermost polynomial goes on.
    even : tuple of float
        Positions about which the function is even: 0 and pi of a relative azimuth.
    apart : int
        How many of the last knots are averages of other cells: taken as they are, linearly, by no cubic.
    period : float
        Of the function, 0 for none; positions lie in the period that holds the knots.

    Returns
    -------
    index : ndarray of int64 (N, S)
    weight : ndarray (N, S)
    """
    whole, source = knots, np.arange(knots.size)
    inner = knots[: knots.size - apart]
    extended, origin = inner, source[: inner.size]
    if period:
        # two of the turns before and after reach far enough
        turns = slice(max(0, inner.size - 2), 2 * inner.size + min(2, inner.size))
        extended = np.concatenate([inner - period, inner, inner + period])[turns]
        origin = np.tile(origin, 3)[turns]
    elif inner.size >= 3:
        for centre in even:
            if apart and centre > inner[-1]:
                continue
            two = np.arange(2) if centre <= inner[0] else np.arange(inner.size - 2, inner.size)
            mirrored = 2.0 * centre - inner[two]
            fresh = np.abs(mirrored - inner[two]) > 1e-12
            extended, origin = np.concatenate([extended, mirrored[fresh]]), np.concatenate([origin, two[fresh]])
        order = np.argsort(extended)
        extended, origin = extended[order], origin[order]
    size = min(4, extended.size)
    start = np.clip(np.searchsorted(extended, x, side="right") - size // 2, 0, extended.size - size)
    at = start[:, None] + np.arange(size)
    index, weight = origin[at], _lagrange(extended[at], x)
    exact = np.abs(extended[at] - x[:, None]) <= 1e-12
    hit = exact.any(axis=1)
    weight[hit] = exact[hit] / exact[hit].sum(axis=1, keepdims=True)
    if apart:
        late = x > inner[-1]
        k = np.clip(np.searchsorted(whole, x[late], side="right"), inner.size, whole.size - 1)
        share = np.clip((x[late] - whole[k - 1]) / (whole[k] - whole[k - 1]), 0.0, 1.0)
        index[late], weight[late] = inner.size - 1, 0.0
        index[late, 0], index[late, 1] = k - 1, k
        weight[late, 0], weight[late, 1] = 1.0 - share, share
    return index, weight


def _lagrange(nodes: Array, x: Array) -> Array:
    """Return Lagrange weights (N, S) at x (N,) for nodes (N, S)."""
    own = np.ascontiguousarray(nodes.T)
    away, above, below = x - own, np.ones_like(own), np.ones_like(own)
    for k in range(len(own)):
        for j in range(len(own)):
            if j != k:
                above[k] *= away[j]
                below[k] *= own[k] - own[j]
    return np.ascontiguousarray((above / below).T)


def matrix(knots: Array, x: Array, *, even: tuple[float, ...] = (), apart: int = 0, period: float = 0.0) -> Array:
    """Return the interpolation (N, K) as a dense matrix."""
    index, weight = stencil(knots, x, even=even, apart=apart, period=period)
    dense = np.zeros((x.size, knots.size))
    np.add.at(dense, (np.arange(x.size)[:, None], index), weight)
    return dense


def to_log(values: Array, floor: float) -> Array:
    """Return what is interpolated: asinh(50 f/floor), the logarithm of bright values, which zeros have, too.

    Colours outside the gamut of sRGB have negative channels.
    """
    return np.arcsinh(values * (50.0 / floor))


def from_log(logs: Array, floor: float) -> Array:
    """Invert `to_log`."""
    return np.sinh(np.clip(logs, -700.0, 700.0)) * (0.02 * floor)


def _closed(kept: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return positions with the left-out ones of dense neighbourhoods.

    What bends the lines that are looked at bends others beside: edges wander with the other angles.
    """
    there = np.zeros(count + 2 * REACH)
    there[kept + REACH] = 1.0
    there[:REACH], there[count + REACH :] = (
        there[2 * REACH - 1 : REACH - 1 : -1],
        there[count + REACH - 1 : count - 1 : -1],
    )
    share = np.convolve(there, np.full(2 * REACH + 1, 1.0 / (2 * REACH + 1)), "valid")
    return np.union1d(kept, np.flatnonzero(share >= DENSE))


def choose(
    x: Array,
    logs: Array,
    tolerance: float,
    *,
    even: tuple[float, ...] = (),
    apart: int = 0,
    period: float = 0.0,
) -> tuple[NDArray[np.int64], float]:
    """Return which positions of an axis to keep, and the largest error of the others.

    Starting from a few, the middle of each gap whose positions miss the tolerance is added until none does, and where
    they miss it by far its quarters, too.

    Parameters
    ----------
    x : ndarray (N,)
        All positions.
    logs : ndarray (N, M)
        `to_log` of the values along the axis on M lines.
    tolerance : float
        Largest error allowed, relative to the value or the floor.
    even, apart, period
        As in `stencil`.

    Returns
    -------
    kept : ndarray of int64 (K,)
        Increasing; always with both ends.
    error : float
        Largest error over all lines and positions left out.
    """
    n, closed = x.size, False
    chosen = np.zeros(n, dtype=bool)
    chosen[np.round(np.linspace(0, n - 1, min(FIRST, n))).astype(np.int64)] = True
    if apart:
        chosen[n - 1 - apart :] = True
    while True:
        kept, rest = np.flatnonzero(chosen), np.flatnonzero(~chosen)
        error = np.zeros(n)
        apart_by = np.abs(matrix(x[kept], x[rest], even=even, apart=apart, period=period) @ logs[kept] - logs[rest])
        # exact to first order above and below the floor, and a bound above it
        error[rest] = np.expm1(np.minimum(apart_by.max(axis=1, initial=0.0), 700.0))
        worst = float(error.max(initial=0.0))
        if not math.isfinite(worst):
            return np.arange(n), 0.0
        if closed or kept.size == n:
            return kept, worst
        if worst <= tolerance:
            chosen[_closed(kept, n)] = closed = True
            continue
        for limit, shares in ((tolerance, (2,)), (FAR * tolerance, (1, 3))):
            gap = np.zeros(n + 1, dtype=bool)
            gap[np.searchsorted(kept, np.flatnonzero(error > limit))] = True
            right = np.flatnonzero(gap)
            for share in shares:
                chosen[((4 - share) * kept[right - 1] + share * kept[right]) // 4] = True
