"""The bounces of order two and above, mode by mode: a triangular solve and a quadratic form.

Light that comes down at depression b_i scatters further down or up, and every scattering raises d_z. Let z_o(b) be the
light that leaves at elevation b_o of what travels upwards at elevation b < b_o, for any number of bounces:

    z_o(b) = K(b -> b_o) + int_b^b_o K(b -> b') w(b') z_o(b') db'.

By reciprocity it is also what becomes of light from depression b_o on its way down. One bounce H turns down into up, so
that the sum over two and more bounces is z_i w H + H w z_o + z_i w H w z_o: symmetric, with half the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models.smith_multi.volterra.orders import Orders
from brdftab.models.smith_multi.volterra.panels import Mesh

# bytes of the kernels of a chunk of modes
MEMORY = 96e6
# with this many bounces the rest is below rounding, for any roughness
ALL_BOUNCES = 64


@dataclass(frozen=True)
class Coefficients:
    """Modes of the pairs of sources at the solved orders.

    Attributes
    ----------
    values : ndarray (L, W, V)
        Layer by layer and wavelength by wavelength, for order s a block (size_s, size_s) of pairs from offset_s on.
    offset, size : int64 (S,)
        Where a block begins, and how many of the lowest sources it holds; the modes of higher ones are negligible.
    """

    values: np.ndarray
    offset: np.ndarray
    size: np.ndarray


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
def _solve(up, up_source, within, turn, turn_source, nodes, stops, out):
    """Fill out (K, T, T) for K pairs of wavelength and order."""
    starts = nodes[3]
    for q in numba.prange(up.shape[0]):
        total, sources = up_source.shape[1:]
        z, turned = np.empty((total, sources)), np.empty((total, sources))
        cross = np.empty((sources, sources))
        _climb(up[q], up_source[q], within[q], nodes, z)
        _join(z, turn[q], turn_source[q], stops, starts, turned, cross, out[q])


def _inside(up: np.ndarray, within: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Return the operator K w of the unknown at the nodes, (K, N, N)."""
    count = up.shape[1]
    inside = np.zeros(up.shape)
    for p in range(mesh.first.size - 1):
        low, high = mesh.first[p], mesh.first[p + 1]
        inside[:, low:high, high:] = up[:, low:high, high:] * mesh.weight[high:count]
        for j in range(low, high):
            pairs = slice(mesh.inner[j], mesh.inner[j + 1])
            inside[:, j, low:high] = within[:, pairs] @ mesh.share[pairs, : high - low]
    return inside


def _series(kernels: tuple[np.ndarray, ...], mesh: Mesh, named: int, cap: int | None) -> list[np.ndarray]:
    """Return the modes (K, T, T) of 2 .. named + 1 bounces one by one, then those of 2 .. cap together if it is given.

    The Neumann series of the equations that `_solve` solves.
    """
    up, up_source, within, turn, turn_source = kernels
    inside, weight = _inside(up, within, mesh), mesh.weight[:, None]
    last = max(named, 0 if cap is None else cap - 1)
    # weighted unknown by its number of bounces, from 1 on
    z = [up_source]
    while len(z) < last and np.abs(z[-1]).max() > 1e-18 * np.abs(z[0]).max():
        z.append(inside @ z[-1])
    z = [weight * part for part in z]
    turned = [turn @ part for part in z[: max(named - 1, 0)]]

    def symmetric(half: np.ndarray) -> np.ndarray:
        return half + half.transpose(0, 2, 1)

    def cross(part: np.ndarray) -> np.ndarray:
        return symmetric(turn_source.transpose(0, 2, 1) @ part)

    found: list[np.ndarray] = []
    for bounce in range(2, named + 2):
        if bounce - 2 >= len(z):
            found.append(np.zeros_like(found[-1]))
            continue
        term = cross(z[bounce - 2])
        for a in range((bounce - 1) // 2):
            b = bounce - 3 - a
            form = z[a].transpose(0, 2, 1) @ turned[b]
            term += 0.5 * symmetric(form) if a == b else symmetric(form)
        found.append(term)
    if cap is not None:
        sums = np.cumsum(z[: cap - 1], axis=0)
        total = cross(sums[-1])
        for a in range(min(cap - 2, len(z))):
            half = z[a].transpose(0, 2, 1) @ (turn @ sums[min(cap - 3 - a, len(sums) - 1)])
            total += 0.5 * symmetric(half)
        found.append(total)
    return found


def _part(mesh: Mesh, sources: int) -> Mesh:
    """Return the mesh below the lowest sources alone."""
    if sources == mesh.source.size:
        return mesh
    panels = int(np.searchsorted(mesh.beta[mesh.first[:-1]], mesh.source[sources - 1]))
    count = int(mesh.first[panels])
    pairs = int(mesh.inner[count])
    return Mesh(
        mesh.source[:sources],
        mesh.beta[:count],
        mesh.weight[:count],
        mesh.first[: panels + 1],
        mesh.active[:panels],
        mesh.inner_from[:pairs],
        mesh.inner_to[:pairs],
        mesh.inner[: count + 1],
        mesh.share[:pairs],
    )


def _kernels(ndf: Any, part: Mesh, some: np.ndarray, alpha: float, fitted: Any) -> tuple[np.ndarray, ...]:
    """Return the modes of all pairs that a solve needs, each (W M, ...)."""
    waves, count, total, sources = fitted.constant.size, some.size, part.beta.size, part.source.size
    beta, source = part.beta, part.source
    sides = ((beta, beta), (beta, source), (-beta, beta), (-beta, source))
    found = []
    for a, b in sides:
        out = np.empty((waves, count, a.size, b.size))
        ndf.modes(a, b, some, alpha, fitted, out)
        found.append(out.reshape(waves * count, total, -1))
    within = np.empty((waves, count, part.inner_to.size))
    ndf.pairs(part.inner_from, part.inner_to, some, alpha, fitted, within)
    up, up_source, turn, turn_source = found
    return up, up_source.reshape(-1, total, sources), within.reshape(waves * count, -1), turn, turn_source


def _arguments(part: Mesh) -> tuple[np.ndarray, ...]:
    """Return what the kernels need of a mesh: weights, panels, first source above panels and nodes, inner rule."""
    starts = np.repeat(part.active, np.diff(part.first))
    return part.weight, part.first, part.active, starts, part.inner, part.share


def _chunks(mesh: Mesh, chosen: Orders, waves: int, reached: np.ndarray) -> list[tuple[int, int, int]]:
    """Return (first order, last order, sources) of chunks of orders that are solved together.

    `reached` (T,) is the largest order that any pair of each source and a lower one needs.
    """
    found = []
    start = 0
    while start < chosen.nodes.size:
        low = chosen.lowest[start]
        needed = np.flatnonzero(reached > low)
        if needed.size == 0:
            break
        sources = int(needed[-1]) + 1
        nodes = float(np.searchsorted(mesh.beta, mesh.source[sources - 1]))
        most = max(1, int(MEMORY / (16.0 * waves * nodes * (nodes + sources + 4.0))))
        if start < chosen.dense:
            stop = min(start + most, 16 if start < 16 else chosen.dense, chosen.dense)
        else:
            stop = min(start + most, int(np.searchsorted(chosen.lowest, low, side="right")))
        found.append((start, stop, sources))
        start = stop
    return found


def solve(
    ndf: Any, mesh: Mesh, alpha: float, fitted: Any, chosen: Orders, needed: np.ndarray, layers: int, cap: int | None
) -> Coefficients:
    """Return the modes of all bounces from two on, of every pair of sources.

    Parameters
    ----------
    ndf : module
        `ggx` or `beckmann`.
    mesh : Mesh
        Sources and nodes.
    alpha : float
        Roughness.
    fitted : Fit
        The reflectance, as that module fits it.
    chosen : Orders
        Orders to solve.
    needed : ndarray (T, T)
        Order from which on the modes of a pair of sources are negligible; pairs (higher, lower) alone are looked at.
    layers : int
        0 for the sum in one layer; else bounces 2 .. layers + 1 in one layer each, and what remains in a last one
        unless `cap` bounces end before.
    cap : int or None
        Largest number of bounces.
    """
    waves = fitted.constant.size
    chunks = _chunks(mesh, chosen, waves, np.tril(needed).max(axis=1))
    size = np.zeros(chosen.nodes.size, np.int64)
    for start, stop, sources in chunks:
        size[start:stop] = sources
    offset = np.concatenate([[0], np.cumsum(size * size)])
    short = cap if cap is not None and cap < ALL_BOUNCES else None
    named = layers if short is None else min(layers, short - 1)
    rest = layers == 0 or short is None or short - 1 > layers
    values = np.empty((named + rest, waves, int(offset[-1])))
    for start, stop, sources in chunks:
        part = _part(mesh, sources)
        kernels = _kernels(ndf, part, chosen.nodes[start:stop], alpha, fitted)
        terms = _series(kernels, part, named, short) if named or short else []
        if short is None:
            total = np.empty((waves * (stop - start), sources, sources))
            _solve(*kernels, _arguments(part), np.searchsorted(part.beta, part.source), total)
            terms.append(total)
        if named and rest:
            terms[-1] = terms[-1] - sum(terms[:-1])
        for layer, term in zip(values, terms, strict=False):
            layer[:, int(offset[start]) : int(offset[stop])] = term.reshape(waves, -1)
    return Coefficients(values, offset[:-1], size)
