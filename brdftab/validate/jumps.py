"""Jumps of a function along a line: found by sixth differences, then closed in on until only the jump is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.typing import Array

# a difference of this order, so many times those around it is looked into
ORDER, STANDS_OUT = 6, 20.0
# how many such places a line may have, and how many neighbours tell what is usual
PLACES, AROUND = 2, 12
PARTS, ROUNDS, DEGREE = 12, 11, 4
# values below this share of the line's largest are dark
DARK = 1e-12
TINY = 1e-300
# the other side of a jump at zero
LEAST = 1e-200


def _smooth_fit() -> tuple[Array, Array]:
    """Return the matrix that leaves of steps what no polynomial of `DEGREE` follows, and its diagonal."""
    basis = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, PARTS), DEGREE))[0]
    rest = np.eye(PARTS) - basis @ basis.T
    return rest, np.diag(rest).copy()


_REST, _FREE = _smooth_fit()


@dataclass(frozen=True)
class Jump:
    """A jump between two neighbouring positions of a line.

    Attributes
    ----------
    line : int
        Which line.
    below, above : float
        The positions, 1e-12 of the line's steps apart.
    size : float
        Change of the value, less the slope around, over the larger of the values.
    """

    line: int
    below: float
    above: float
    size: float


def suspects(values: Array) -> list[tuple[int, int]]:
    """Return (position, line) where the difference of values (N, L) stands out from those around it."""
    found = []
    high, half = np.abs(np.diff(values, ORDER, axis=0)), ORDER // 2
    for line in range(values.shape[1]):
        d, f = high[:, line], values[:, line]
        if not np.isfinite(d).all():
            continue
        padded = np.pad(d, AROUND, mode="reflect")
        usual = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1), axis=-1)
        rounding = 4.0**half * np.finfo(float).eps * np.abs(f[half:-half]) + DARK * 1e-3 * np.abs(f).max() + TINY
        share = d / (usual + rounding)
        for _ in range(PLACES):
            at = int(np.argmax(share))
            if share[at] <= STANDS_OUT:
                break
            found.append((at + half, line))
            share[max(0, at - ORDER) : at + ORDER + 1] = 0.0
    return found


def closed_in(
    f: Callable[[Array, Any], Array], low: Array, high: Array, line: NDArray[np.int64]
) -> tuple[Array, Array, Array]:
    """Close in on the largest change beside the slope; return both ends and its size, all (K,).

    `f` takes positions and lines (n,) and returns values (n,).
    """
    size = np.zeros_like(low)
    for _ in range(ROUNDS):
        t = low[:, None] + (high - low)[:, None] * (np.arange(PARTS + 1) / PARTS)
        values = f(t.reshape(-1), np.repeat(line, PARTS + 1)).reshape(t.shape)
        steps = np.diff(values, axis=1)
        # what a smooth function leaves of the steps, by how much each step is free of the fit
        rest, rows = steps @ _REST, np.arange(low.size)
        best = np.argmax(np.abs(rest) / np.sqrt(_FREE), axis=1)
        size = np.abs(rest[rows, best]) / _FREE[best] / np.maximum(np.abs(values).max(axis=1), TINY)
        low, high = t[rows, best], t[rows, best + 1]
        if (high - low <= 8.0 * np.spacing(np.maximum(np.abs(low), np.abs(high)))).all():
            break
    return low, high, size


def jumps(f: Callable[[Array, Any], Array], t: Array, values: Array) -> list[Jump]:
    """Return the jumps of L lines that were evaluated at positions t (N,), values (N, L); kinks and slopes are none."""
    places = suspects(values)
    if not places:
        return []
    at, line = np.array(places).T
    low, high, size = closed_in(f, t[np.maximum(at - 3, 0)], t[np.minimum(at + 3, t.size - 1)], line)
    top = np.abs(values).max(axis=0)
    found = []
    for a, b, s, n in zip(low, high, size, line, strict=True):
        if a == 0.0 and b > LEAST:
            # numbers lie closest at zero: a root there rises as steeply as any jump over all others
            b = LEAST
            ends = f(np.array([a, b]), np.array([n, n]))
            s = abs(ends[1] - ends[0]) / max(abs(ends).max(), TINY)
        here = abs(float(f(np.array([a]), np.array([n]))[0]))
        there = abs(float(f(np.array([b]), np.array([n]))[0]))
        if max(here, there) > DARK * top[n]:
            found.append(Jump(int(n), float(a), float(b), float(s)))
    return found
