"""Which azimuth modes are solved, and how all others follow from them.

A mode M_m is analytic in m, so that above a number of modes solved one by one each octave takes a few Chebyshev nodes.
For a table interpolation in m and the sum over m become one matrix; a single pair sums its modes directly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel

BLOCK = 64
CHUNK = 1 << 15


@dataclass(frozen=True)
class Orders:
    """Azimuth modes that are solved.

    Attributes
    ----------
    nodes : ndarray (S,)
        Real orders, increasing.
    lowest : ndarray (S,)
        The order from which on each node matters: its own, or where its octave begins.
    dense : int
        Number of whole orders at the beginning.
    chebyshev : int
        Nodes in an octave.
    taper : float
        Where modes fade out if they were capped, else infinite.
    """

    nodes: np.ndarray
    lowest: np.ndarray
    dense: int
    chebyshev: int
    taper: float

    @property
    def octaves(self) -> int:
        """Return the number of octaves."""
        return (self.nodes.size - self.dense) // self.chebyshev


def _chebyshev(count: int) -> np.ndarray:
    """Return the zeros of the Chebyshev polynomial, increasing."""
    return -np.cos((2 * np.arange(count) + 1) * math.pi / (2 * count))


def orders(largest: float, cap: float, dense: int, count: int) -> Orders:
    """Return the orders to solve for all modes up to `largest`, at most up to `cap`, `count` of them in an octave."""
    nodes, lowest = [np.arange(dense, dtype=np.float64)], [np.arange(dense, dtype=np.float64)]
    low, stop = dense - 0.5, min(largest, cap)
    while low < stop:
        nodes.append(low * (1.5 + 0.5 * _chebyshev(count)))
        lowest.append(np.full(count, low))
        low *= 2.0
    return Orders(np.concatenate(nodes), np.concatenate(lowest), dense, count, low if largest > low else math.inf)


def _cardinal(count: int, x: np.ndarray) -> np.ndarray:
    """Return the Lagrange polynomials of the Chebyshev zeros at x, (N, count)."""
    nodes = _chebyshev(count)
    signs = (-1.0) ** np.arange(count) * np.sin((2 * np.arange(count) + 1) * math.pi / (2 * count))
    apart = x[:, None] - nodes
    apart[apart == 0.0] = 1e-300
    part = signs / apart
    return part / part.sum(axis=1, keepdims=True)


@parallel_kernel
def _add_waves(values, start, psi, row, out):
    """Add sum_m values[m, k] 2 cos((start + m) psi) to out[row + k]."""
    for f in numba.prange(psi.size):
        angle = psi[f]
        step_c, step_s = math.cos(angle), math.sin(angle)
        total = np.zeros(values.shape[1])
        c, s = 0.0, 0.0
        for m in range(values.shape[0]):
            if m % 64 == 0:
                # the rotation is begun anew before its rounding grows
                c, s = 2.0 * math.cos((start + m) * angle), 2.0 * math.sin((start + m) * angle)
            for k in range(values.shape[1]):
                total[k] += values[m, k] * c
            c, s = c * step_c - s * step_s, s * step_c + c * step_s
        for k in range(values.shape[1]):
            out[row + k, f] += total[k]


def _fade(taper: float, m: np.ndarray) -> np.ndarray:
    """Return the factor that ends capped modes smoothly."""
    return np.ones_like(m) if math.isinf(taper) else np.exp(-36.0 * (m / taper) ** 8)


@lru_cache(maxsize=4)
def _synthesis(dense: int, count: int, octaves: int, taper: float, azimuths: bytes) -> np.ndarray:
    psi = np.frombuffer(azimuths) - math.pi
    out = np.zeros((dense + octaves * count, psi.size))
    whole = np.arange(dense)
    out[:dense] = np.cos(whole[:, None] * psi) * np.where(whole == 0, 1.0, 2.0)[:, None]
    low = dense - 0.5
    for octave in range(octaves):
        first, last = math.ceil(low), math.ceil(2.0 * low)
        for start in range(first, last, CHUNK):
            m = np.arange(start, min(start + CHUNK, last), dtype=np.float64)
            values = _cardinal(count, (m - 1.5 * low) / (0.5 * low)) * _fade(taper, m)[:, None]
            _add_waves(values, float(start), psi, dense + octave * count, out)
        low *= 2.0
    return out


def synthesis(chosen: Orders, phi: np.ndarray) -> np.ndarray:
    """Return (S, F): a function of the azimuth phi is sum_s M_s out[s], M_s its modes at the nodes; pi is forward."""
    return _synthesis(chosen.dense, chosen.chebyshev, chosen.octaves, chosen.taper, phi.tobytes())


@lru_cache
def to_series(count: int) -> np.ndarray:
    """Return the matrix that turns values at Chebyshev zeros into the coefficients of the series."""
    angle = np.arccos(_chebyshev(count))
    matrix = np.cos(np.arange(count)[:, None] * angle) * (2.0 / count)
    matrix[0] *= 0.5
    return matrix


@kernel
def _octave_sum(series, low, taper, psi, first, last, waves):
    """Return sum_m p(m) 2 cos(m psi) for first <= m < last, p a Chebyshev series on the octave above low."""
    total = 0.0
    lane = np.zeros(64)
    x, one, two, keep = np.empty(64), np.empty(64), np.empty(64), np.empty(64)
    start = first
    while start < last:
        left = min(64, last - start)
        for n in range(64):
            x[n] = (start + n - 1.5 * low) / (0.5 * low)
            one[n], two[n] = 0.0, 0.0
        for k in range(series.size - 1, 0, -1):
            c = series[k]
            for n in range(64):
                keep[n] = c + 2.0 * x[n] * one[n] - two[n]
                two[n] = one[n]
                one[n] = keep[n]
        if taper < math.inf:
            for n in range(64):
                x8 = (start + n) / taper
                x8 *= x8
                x8 *= x8
                keep[n] = math.exp(-36.0 * x8 * x8)
        else:
            for n in range(64):
                keep[n] = 1.0
        c, s = 2.0 * math.cos(start * psi), 2.0 * math.sin(start * psi)
        for n in range(64):
            lane[n] = (series[0] + x[n] * one[n] - two[n]) * keep[n] * (c * waves[0, n] - s * waves[1, n])
        for n in range(left):
            total += lane[n]
        start += 64
    return total


@parallel_kernel
def sum_pairs(values, matrix, dense, octaves, taper, largest, phi, out):
    """Fill out (K, N) with the sums over all modes of N pairs.

    Parameters
    ----------
    values : ndarray (K, N, S)
        Modes at the nodes.
    matrix : ndarray (p, p)
        From `to_series`.
    dense, octaves, taper
        From `Orders`.
    largest : ndarray (N,)
        Order from which on a pair's modes do not matter.
    phi : ndarray (N,)
        Azimuths, radians; pi is forward.
    out : ndarray (K, N)
        Where to write.
    """
    count = matrix.shape[0]
    for n in numba.prange(phi.size):
        psi = phi[n] - math.pi
        waves = np.empty((2, 64))
        for d in range(64):
            waves[0, d], waves[1, d] = math.cos(d * psi), math.sin(d * psi)
        series = np.empty(count)
        for k in range(values.shape[0]):
            total = values[k, n, 0]
            for m in range(1, dense):
                total += 2.0 * values[k, n, m] * math.cos(m * psi)
            low = dense - 0.5
            for octave in range(octaves):
                if low >= largest[n]:
                    break
                for r in range(count):
                    series[r] = 0.0
                    for c in range(count):
                        series[r] += matrix[r, c] * values[k, n, dense + octave * count + c]
                first, last = np.int64(math.ceil(low)), np.int64(math.ceil(2.0 * low))
                total += _octave_sum(series, low, taper, psi, first, last, waves)
                low *= 2.0
            out[k, n] = total
