"""Walks that serve many views at once: every vertex of a walk sends light to each view of its row (next event).

The views of one row share their walks, so that their errors are correlated; each estimate is unbiased by itself.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.codes import GGX
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.random_walk.terms import facet
from brdftab.models._shared.random_walk.trace import COLUMNS, FACTOR, HEIGHT, WX, WY, WZ, reflections

# views that a task serves: what it adds up stays in the first-level cache
TILE = 256
# columns of a task: row, first and last path (exclusive), first and last view (exclusive), slot of the sums
ROW, FIRST, LAST, LOW, HIGH, SLOT = range(6)


@kernel
def _send(ndf, alpha_x, alpha_y, heights, vertex, views, value, cosine):
    """Fill in the facet's term D/4 times both segments' for each view (n, 5), and the cosine of incidence."""
    x, y, z, factor, level = vertex[WX], vertex[WY], vertex[WZ], vertex[FACTOR], vertex[HEIGHT]
    if ndf == GGX:
        # `facet` without its branch, so that several views are done at a time
        factor *= 0.25 / (math.pi * alpha_x * alpha_y)
        p, q = 1.0 / (alpha_x * alpha_x), 1.0 / (alpha_y * alpha_y)
        for j in range(views.shape[0]):
            hx, hy, hz = x + views[j, 0], y + views[j, 1], z + views[j, 2]
            x2, y2, z2 = hx * hx, hy * hy, hz * hz
            length2 = x2 + y2 + z2
            ratio = length2 / (p * x2 + q * y2 + z2 + 1e-300)
            value[j] = ratio * ratio * (factor * views[j, 3] if hz > 0.0 else 0.0)
            cosine[j] = length2
    else:
        for j in range(views.shape[0]):
            hx, hy, hz = x + views[j, 0], y + views[j, 1], z + views[j, 2]
            value[j] = facet(ndf, alpha_x, alpha_y, hx, hy, hz) * factor * views[j, 3]
            cosine[j] = hx * hx + hy * hy + hz * hz
    for j in range(views.shape[0]):
        cosine[j] = 0.5 * math.sqrt(cosine[j])
    if heights:
        for j in range(views.shape[0]):
            value[j] *= math.exp(level * views[j, 4])


@kernel
def add_squares(path, weights, squares):
    """Add the square of each channel of one path's values (n, W) to squares (n, C)."""
    for j in range(path.shape[0]):
        for c in range(weights.shape[1]):
            total = 0.0
            for w in range(weights.shape[0]):
                total += path[j, w] * weights[w, c]
            squares[j, c] += total * total


@kernel
def serve(
    ndf, alpha_x, alpha_y, kind, fa, fb, table, heights, limit, least, most, seed,
    task, light, identity, views, weights, sums, squares,
):  # fmt: skip
    """Draw the paths of one task and add them up, see `draw`."""
    layers, count, size = sums.shape
    kept = squares.shape[0] - 1
    vertices, throughput = np.empty((most, COLUMNS)), np.empty((most, size))
    value, cosine, row, path = np.empty(count), np.empty(count), np.empty(size), np.empty((1 + kept, count, size))
    for number in range(task[FIRST], task[LAST]):
        met = reflections(
            ndf, alpha_x, alpha_y, light[0], light[1], light[2], (kind, fa, fb, table), heights, limit, most,
            seed, identity, number, vertices, throughput,
        )  # fmt: skip
        if met < least:
            continue
        # layers that this path adds to
        low, high = min(least, kept), min(met, kept)
        path[0] = 0.0
        path[low : high + 1] = 0.0
        for k in range(least - 1, met):
            at = min(k, layers - 1)
            layer, part = sums[at], path[min(1 + at, kept)]
            _send(ndf, alpha_x, alpha_y, heights, vertices[k], views, value, cosine)
            if kind == MIRROR and size == 1:
                for j in range(count):
                    value[j] *= throughput[k, 0]
                    path[0, j, 0] += value[j]
                    layer[j, 0] += value[j]
                if kept > 0:
                    for j in range(count):
                        part[j, 0] += value[j]
                continue
            for j in range(count):
                if value[j] <= 0.0:
                    continue
                for w in range(size):
                    row[w] = value[j] * throughput[k, w]
                multiply(kind, fa, fb, table, cosine[j], row)
                for w in range(size):
                    path[0, j, w] += row[w]
                    layer[j, w] += row[w]
                    if kept > 0:
                        part[j, w] += row[w]
        add_squares(path[0], weights, squares[0])
        for p in range(max(low, 1), high + 1):
            add_squares(path[p], weights, squares[p])


@parallel_kernel
def draw(
    ndf, alpha_x, alpha_y, kind, fa, fb, table, heights, limit, least, most, seed,
    tasks, lights, identities, views, weights, sums, squares,
):  # fmt: skip
    """Draw the paths of all tasks of reflecting surfaces.

    Parameters
    ----------
    ndf, alpha_x, alpha_y, kind, fa, fb, table
        Distribution, roughness, and reflectance of W wavelengths as in `fresnel.project.arguments`.
    heights, limit, seed
        As in `trace.reflections`.
    least, most : int
        Lowest and highest bounce order.
    tasks : ndarray (T, 6) of int
        What each does; no two of them write to the same place.
    lights : ndarray (R, 3)
        Unit vectors towards the light, one a row.
    identities : ndarray (R,) of int
        Names of the rows for the random numbers.
    views : ndarray (M, 5)
        Unit vector towards the view, factor of its segment, Lambda.
    weights : ndarray (W, C)
        Projection to channels.
    sums : ndarray (S, P, M, W), squares : ndarray (S, 1 or 1 + P, M, C)
        Added to: the sums over paths by order, order p + 1 in layer p and the rest in the last one, and the sums of
        squares of their total, then, where there is room for them, of each layer; S slots.
    """
    for n in numba.prange(tasks.shape[0]):
        task = tasks[n]
        row, low, high, slot = task[ROW], task[LOW], task[HIGH], task[SLOT]
        serve(
            ndf, alpha_x, alpha_y, kind, fa, fb, table, heights, limit, least, most, seed,
            task, lights[row], identities[row], views[low:high], weights,
            sums[slot, :, low:high], squares[slot, :, low:high],
        )  # fmt: skip
