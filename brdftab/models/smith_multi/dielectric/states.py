"""States of light between the facets of a dielectric, and the panels on which they are sampled.

A state is a side of the interface and p = n d_z, the vertical part of the wave vector (n = 1 above). A facet changes
the wave vector along its own normal only, so reflection above raises p, reflection below and refraction lower it: every
kernel jumps where p' = p. Both sides therefore share their panel edges, and every direction of a table is an edge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.random_walk.refraction import weight
from brdftab.models.smith_multi.dielectric.levels import Level
from brdftab.quadrature import gauss, unit_gauss
from brdftab.typing import Array

# edges closer than this are one edge
CLOSE = 1e-12
# no finer panels at the horizon for directions below this elevation
LOWEST = 1e-3


@dataclass(frozen=True)
class Side:
    """The nodes of one side, increasing in p and symmetric about 0.

    Attributes
    ----------
    index : float
        Refractive index of the side.
    p, s : float64 (N,)
        Vertical and tangential part of the wave vector; p^2 + s^2 = index^2.
    weights : float64 (N,)
        2 pi/(|d_z| (1 + Lambda)) times the quadrature weight in d_z.
    panel : int64 (N,)
        Number of the panel, the same on both sides.
    """

    index: float
    p: Array
    s: Array
    weights: Array
    panel: NDArray[np.int64]


def _limit(p: float, index: float, n: float, alpha: float, lowest: float, level: Level) -> float:
    """Return the widest panel (radians) that resolves the lobes around p on one side."""
    q = (n - 1.0) * (n + 1.0)
    size = abs(p)
    elevation = math.asin(min(size / index, 1.0))
    # half-widths in angle of the lobes that a direction sends to its mirror image and through the surface
    lobe = 2.0 * alpha
    if size > 0.0 and index == 1.0:
        lobe = min(lobe, alpha * (math.sqrt(q + p * p) - size) / size)
    elif p * p > q:
        lobe = min(lobe, alpha * (size - math.sqrt(p * p - q)) / size)
    return min(level.width, level.lobe * lobe, level.grading * (lowest + elevation))


def panel_edges(required: Array, lowest: float, n: float, alpha: float, level: Level) -> Array:
    """Return the edges on [0, n]: the required ones, and between them as many as both sides ask for.

    Parameters
    ----------
    required : ndarray
        p where panels end, of either sign.
    lowest : float
        No finer panels are asked for below this elevation (radians).
    n : float
        Index below the surface, > 1.
    alpha : float
        Roughness.
    level : Level
        Resolution.
    """
    done = [0.0]
    stack = sorted(({float(n), 1.0} | {float(abs(p)) for p in required if abs(p) > CLOSE}), reverse=True)
    while stack:
        low, high = done[-1], stack[-1]
        if high - low <= CLOSE:
            stack.pop()
            continue
        split = 0.0
        for index in (1.0, n):
            if high > index:
                continue
            a, b = math.asin(low / index), math.asin(high / index)
            middle = index * math.sin(0.5 * (a + b))
            if b - a > _limit(middle, index, n, alpha, lowest, level) and min(middle - low, high - middle) > CLOSE:
                split = middle
        if split > 0.0:
            stack.append(split)
        else:
            done.append(stack.pop())
    return np.array(done)


def build(low: Array, high: Array, n: float, ndf: int, alpha: float, level: Level) -> tuple[Side, Side]:
    """Return the states above and below on panels from low (P,) to high (P,), increasing in [0, n], and mirrored ones.

    `ndf` is 0 for Beckmann, 1 for GGX.
    """
    x, w = unit_gauss(level.nodes)
    width = high - low
    half = (low[:, None] + width[:, None] * x).ravel()
    p = np.concatenate([-half[::-1], half])
    measure = (width[:, None] * w).ravel()
    measure = np.concatenate([measure[::-1], measure])
    panel = np.arange(p.size) // level.nodes
    sides = []
    for index in (1.0, n):
        kept = np.abs(p) < index
        pk = p[kept]
        s = np.sqrt((index - pk) * (index + pk))
        w_t = np.array([weight(ndf, alpha, b / index, a / index) for a, b in zip(pk, s, strict=True)])
        sides.append(Side(index, pk, s, 2.0 * math.pi * w_t * measure[kept] / index, panel[kept]))
    return sides[0], sides[1]


def one_sided(count: int) -> Array:
    """Return factors (2, count, count) of the kernel between nodes of one panel, for p' > p and for p' < p.

    Divided by the weight of the target they integrate over the part of the panel beyond the source, its own limit
    included; they are symmetrised, so that reversing a path changes nothing.
    """
    x, w = gauss(count)
    up = np.zeros((count, count))
    for i in range(count):
        nodes = x[i:]
        for j in range(nodes.size):
            others = np.delete(nodes, j)
            basis = np.polynomial.Polynomial.fromroots(others) if others.size else np.polynomial.Polynomial([1.0])
            integral = (basis / np.prod(nodes[j] - others)).integ()
            up[i, i + j] = (integral(1.0) - integral(x[i])) / w[i + j]
    up = 0.5 * (up + up[::-1, ::-1].T)
    return np.ascontiguousarray(np.stack([up, up[::-1, ::-1]]))
