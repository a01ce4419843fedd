"""The bounces of order two and above: which orders and sources are solved together, all at once or bounce by bounce."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from brdftab import system
from brdftab.errors import ParameterError
from brdftab.models.smith_multi.volterra.orders import Orders
from brdftab.models.smith_multi.volterra.panels import Mesh
from brdftab.models.smith_multi.volterra.triangle import solve_modes

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

    The Neumann series of the equations of triangle.py.
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


def _check_memory(shape: tuple[int, int, int], sources: int) -> None:
    """Refuse modes that the machine cannot hold."""
    needed, there = 8.0 * math.prod(shape), system.offered()
    if needed > there:
        raise ParameterError(
            f"the solver needs {needed / 2**30:.3g} GiB for the azimuth modes of {sources} polar angles, {shape[1]} "
            f"wavelengths and {shape[0]} components, outside the {there / 2**30:.3g} GiB that this machine offers; ask "
            "for fewer polar angles, fewer wavelengths, no components or a larger tolerance"
        )


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

    Raises
    ------
    ParameterError
        If the modes take more memory than the machine has.
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
    shape = named + rest, waves, int(offset[-1])
    _check_memory(shape, mesh.source.size)
    values = np.empty(shape)
    for start, stop, sources in chunks:
        part = _part(mesh, sources)
        kernels = _kernels(ndf, part, chosen.nodes[start:stop], alpha, fitted)
        terms = _series(kernels, part, named, short) if named or short else []
        if short is None:
            total = np.empty((waves * (stop - start), sources, sources))
            solve_modes(*kernels, _arguments(part), np.searchsorted(part.beta, part.source), total)
            terms.append(total)
        if named and rest:
            terms[-1] = terms[-1] - sum(terms[:-1])
        for layer, term in zip(values, terms, strict=False):
            layer[:, int(offset[start]) : int(offset[stop])] = term.reshape(waves, -1)
    return Coefficients(values, offset[:-1], size)
