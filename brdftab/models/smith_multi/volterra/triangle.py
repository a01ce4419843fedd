"""The triangular systems of azimuth modes, solved for all bounces at once.

Light that comes down at depression b_i scatters further down or up, and every scattering raises d_z. Let z_o(b) be the
light that leaves at elevation b_o of what travels upwards at elevation b < b_o, for any number of bounces:

    z_o(b) = K(b -> b_o) + int_b^b_o K(b -> b') w(b') z_o(b') db'.

By reciprocity it is also what becomes of light from depression b_o on its way down. One bounce H turns down into up, so
that the sum over two and more bounces is z_i w H + H w z_o + z_i w H w z_o: symmetric, with half the unknowns.
"""

from __future__ import annotations

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel


@kernel
def _add_rows(scalars, rows, k0, k1, starts, low, out, r):
    """Add sum_k scalars[k] rows[k] to out[r], columns from max(low, starts[k]) on; starts must not decrease."""
    width = out.shape[1]
    k = k0
    while k + 4 <= k1:
        a, b, c, d = scalars[k], scalars[k + 1], scalars[k + 2], scalars[k + 3]
        for n in range(max(low, starts[k]), width):
            out[r, n] += a * rows[k, n] + b * rows[k + 1, n] + (c * rows[k + 2, n] + d * rows[k + 3, n])
        k += 4
    while k < k1:
        a = scalars[k]
        for n in range(max(low, starts[k]), width):
            out[r, n] += a * rows[k, n]
        k += 1


@kernel
def _invert(matrix, size):
    """Invert the leading block of a small, diagonally dominant matrix in place."""
    for p in range(size):
        pivot = 1.0 / matrix[p, p]
        matrix[p, p] = 1.0
        for c in range(size):
            matrix[p, c] *= pivot
        for r in range(size):
            if r != p:
                factor = matrix[r, p]
                matrix[r, p] = 0.0
                for c in range(size):
                    matrix[r, c] -= factor * matrix[p, c]


@kernel
def _climb(up, up_source, within, nodes, z):
    """Fill z (N, T) with the weighted unknown w z_o at the nodes, from the highest panel down."""
    weight, first, active, starts, inner, share = nodes
    total = weight.size
    block = np.empty((share.shape[1], share.shape[1]))
    solved = np.empty((share.shape[1], z.shape[1]))
    for p in range(first.size - 2, -1, -1):
        low, high, lowest = first[p], first[p + 1], active[p]
        size = high - low
        for j in range(low, high):
            for i in range(lowest):
                z[j, i] = 0.0
            for i in range(lowest, z.shape[1]):
                z[j, i] = up_source[j, i]
            _add_rows(up[j], z, high, total, starts, lowest, z, j)
            for k in range(size):
                part = 0.0
                for r in range(inner[j], inner[j + 1]):
                    part -= within[r] * share[r, k]
                block[j - low, k] = part
            block[j - low, j - low] += 1.0
        _invert(block, size)
        for k in range(size):
            for i in range(lowest, z.shape[1]):
                solved[k, i] = 0.0
            for j in range(size):
                a = block[k, j] * weight[low + k]
                for i in range(lowest, z.shape[1]):
                    solved[k, i] += a * z[low + j, i]
        for k in range(size):
            for i in range(lowest, z.shape[1]):
                z[low + k, i] = solved[k, i]


@kernel
def _join(z, turn, turn_source, stops, starts, turned, cross, out):
    """Write the symmetric form of the weighted unknown z with the bounces from down to up to out (T, T)."""
    total, sources = z.shape
    column, zeros = np.empty(total), np.zeros(total, np.int64)
    for k in range(total):
        for i in range(sources):
            turned[k, i] = 0.0
        _add_rows(turn[k], z, 0, total, starts, starts[k], turned, k)
    for i in range(sources):
        for k in range(stops[i]):
            column[k] = z[k, i]
        for o in range(sources):
            out[i, o] = 0.0
            cross[i, o] = 0.0
        _add_rows(column, turned, 0, stops[i], starts, i, out, i)
        _add_rows(column, turn_source, 0, stops[i], zeros, 0, cross, i)
    for i in range(sources):
        for o in range(i, sources):
            value = out[i, o] + cross[i, o] + cross[o, i]
            out[i, o] = value
            out[o, i] = value


@parallel_kernel
def solve_modes(up, up_source, within, turn, turn_source, nodes, stops, out):
    """Fill out (K, T, T) for K pairs of wavelength and order."""
    starts = nodes[3]
    for q in numba.prange(up.shape[0]):
        total, sources = up_source.shape[1:]
        z, turned = np.empty((total, sources)), np.empty((total, sources))
        cross = np.empty((sources, sources))
        _climb(up[q], up_source[q], within[q], nodes, z)
        _join(z, turn[q], turn_source[q], stops, starts, turned, cross, out[q])
