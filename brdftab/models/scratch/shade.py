"""Fresnel reflectance of paths that are already traced: any material, wavelength and angle along the scratch.

A reflection between extruded walls meets them at cos(t) times the cosine in the plane across, exactly. First bounces
have |cos((p_o - p_i)/2)| there; paths of more bounces are represented by groups of their sorted cosines, and by the
spread of the smallest one, at whose two ends the product of reflectances is averaged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR, Fresnel
from brdftab.models._shared.fresnel.fresnel import fill_table, multiply
from brdftab.models.scratch.shoot import CLASSES, ORDERS
from brdftab.models.scratch.tracer import GROUPS
from brdftab.typing import Array

CELLS = 1024
# spreads of cosines below this change nothing
NARROW = 3e-3


def groups_of_layers() -> NDArray[np.int64]:
    """Return how many groups of cosines each layer (L,) has: 0 where a first bounce needs none."""
    more = [min(order, GROUPS) for order in range(2, ORDERS + 1)]
    return np.concatenate([[0], np.repeat(more, CLASSES)]).astype(np.int64)


@kernel
def add_path(fresnel, along, groups, facts, mass, first, row, total):
    """Add flux times reflectance of one entry to total (W,); `first` is the cosine of an entry of first bounces."""
    kind, a, b, table = fresnel
    if kind == MIRROR:
        for w in range(row.size):
            total[w] += mass
        return
    spread = groups > 0 and facts[5] > NARROW
    for side in range(2 if spread else 1):
        row[:] = 1.0
        sign = (1.0 - 2.0 * side) * spread
        if groups == 0:
            multiply(kind, a, b, table, along * first, row)
        for g in range(groups):
            c = facts[1 + g] + sign * (facts[5] if g == 0 else facts[6])
            multiply(kind, a, b, table, along * min(max(c, 0.0), 1.0), row)
        if groups > 0 and facts[0] > groups + 0.5:
            # groups of several bounces each
            for w in range(row.size):
                row[w] = row[w] ** (facts[0] / groups)
        for w in range(row.size):
            total[w] += (0.5 if spread else 1.0) * mass * row[w]


@parallel_kernel
def _shade(fresnel, weights, rows, column, groups, mass, facts, symmetric, share, along, out):
    """Add rho of all entries to out (M, M, C), zeros before, each with its reverse and its mirror image."""
    bins = share.size
    step = math.pi / bins
    last = bins - 1
    for n in numba.prange(bins):
        # long and short rows take turns
        k = n // 2 if n % 2 == 0 else last - n // 2
        row, total = np.empty(weights.shape[0]), np.empty(weights.shape[0])
        # a copy: views of shared arrays are counted, and threads wait for each other there
        own = np.empty(facts.shape[1])
        e = rows[k]
        while e < rows[k + 1]:
            j = column[e]
            total[:] = 0.0
            first = math.cos(0.5 * step * (k - j))
            while e < rows[k + 1] and column[e] == j:
                for m in range(own.size):
                    own[m] = facts[e, m]
                add_path(fresnel, along, groups[e], own, mass[e], first, row, total)
                e += 1
            scale = 1.0 / (share[k] * share[j])
            for c in range(weights.shape[1]):
                value = 0.0
                for w in range(row.size):
                    value += total[w] * weights[w, c]
                out[k, j, c] = out[j, k, c] = scale * value
                if symmetric:
                    out[last - k, last - j, c] = out[last - j, last - k, c] = scale * value


@dataclass(frozen=True, eq=False)
class Entries:
    """The entries of the flux matrices that hold light, row by row; one of each path, its reverse and mirror image.

    Attributes
    ----------
    rows : int64 (M + 1,)
        First entry of each exit bin.
    column, groups : int64 (E,)
        Incident bin, and groups of cosines.
    mass : float64 (E,)
        Flux.
    facts : float32 (E, 7)
        Of the paths.
    symmetric : bool
        Mirror images are left out.
    """

    rows: NDArray[np.int64]
    column: NDArray[np.int64]
    groups: NDArray[np.int64]
    mass: Array
    facts: NDArray[np.float32]
    symmetric: bool


def entries(layers: Array, facts: NDArray[np.float32], symmetric: bool) -> Entries:
    """Return the entries of flux (L, M, M) and facts (L, 7, M, M)."""
    bins = layers.shape[1]
    k, j = np.indices((bins, bins))
    kept = (k >= j) & (k + j >= bins - 1) if symmetric else k >= j
    row, column, layer = np.nonzero((layers > 0.0).transpose(1, 2, 0) & kept[..., None])
    rows = np.searchsorted(row, np.arange(bins + 1))
    found = np.ascontiguousarray(facts[layer, :, row, column])
    return Entries(rows, column, groups_of_layers()[layer], layers[layer, row, column], found, symmetric)


def arguments(fresnel: Fresnel) -> tuple[int, Array, Array, Array]:
    """Return what the kernels take of a Fresnel term: kind, parameters and look-up table."""
    a, b = np.ascontiguousarray(fresnel.a), np.ascontiguousarray(fresnel.b)
    table = np.empty((0, 2 * a.size))
    if fresnel.kind != MIRROR:
        table, _ = fill_table(fresnel.kind, a, b, CELLS)
    return fresnel.kind, a, b, table


def shaded(found: Entries, share: Array, t: float, fresnel: Fresnel) -> Array:
    """Return rho (M, M, C) in 1/rad, by exit and incident bin, at the angle t along the scratch.

    Parameters
    ----------
    found : Entries
        Where there is flux.
    share : ndarray (M,)
        Integral of the cosine over each bin.
    t : float
        Radians in [-pi/2, pi/2].
    fresnel : Fresnel
        Reflectance.
    """
    weights = np.ascontiguousarray(fresnel.weights)
    out = np.zeros((share.size, share.size, weights.shape[1]))
    lists = found.rows, found.column, found.groups, found.mass, found.facts
    _shade(arguments(fresnel), weights, *lists, found.symmetric, share, math.cos(t), out)
    return out
