"""Bidirectional path tracing with the balance heuristic over all splits (Wang et al. 2022, Sec. 4.2).

Walks start from the light and from the view, and every pair of their prefixes is connected. With kappa_j the facet term
of vertex j times the segment terms on both of its sides, and e_i the chance to meet a facet along direction i (r_i
along its opposite), the contribution of a path that could have been connected at any of its vertices is

    prod F / sum_j [ 1/kappa_j prod_{i < j} 1/e_i prod_{i > j + 1} 1/r_i ]:

each term is the reciprocal of what the split at j would give alone, so that the sum is never larger than the least of
them. Its parts belong to one walk each and are carried along, which leaves a few operations a connection.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.codes import SEPARABLE
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.project import arguments, thinned
from brdftab.models._shared.random_walk.estimates import Whole
from brdftab.models._shared.random_walk.normals import visible_normal
from brdftab.models._shared.random_walk.reflecting import LONGEST
from brdftab.models._shared.random_walk.rng import uniforms
from brdftab.models._shared.random_walk.rows import add_squares
from brdftab.models._shared.random_walk.sampling_plan import PathSampler
from brdftab.models._shared.random_walk.terms import facet, segment
from brdftab.models._shared.random_walk.trace import thin_out
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# throughput below which walks end at random
LIMITS = {"off": 1e-2, "on": 0.2}
# columns of a walk: direction back to where it came from, 1/(|z| (1 + Lambda)), products of 1/e up to the direction
# before and including this one, and the sum over the splits inside the walk
X, Y, Z, WEIGHT, BEFORE, UP_TO, INSIDE = range(7)
_COLUMNS = 7
# blocks of random numbers of the walk from the view
_SECOND = 1 << 30


@kernel
def _walk(ndf, alpha_x, alpha_y, x, y, z, kind, fa, fb, table, limit, most, seed, cell, path, base, walk, product):
    """Follow a walk that arrives from (x, y, z); fill walk (most, 7) and products of F (most, W); return its length."""
    size = product.shape[1]
    for w in range(size):
        product[0, w] = 1.0
    weight = segment(ndf, alpha_x, alpha_y, x, y, z)[0]
    before, inside, up_to = 1.0, 0.0, 1.0
    for k in range(most):
        walk[k, X], walk[k, Y], walk[k, Z], walk[k, WEIGHT] = x, y, z, weight
        walk[k, BEFORE], walk[k, UP_TO], walk[k, INSIDE] = before, up_to, inside
        if k > 0 and not thin_out(product[k], 1.0 / up_to, limit, seed, cell, path, base + k):
            return k
        if k + 1 == most:
            break
        a, b, c, _ = uniforms(seed, cell, path, base + k)
        mx, my, mz = visible_normal(ndf, alpha_x, alpha_y, x, y, z, a, b, c)
        cosine = max(x * mx + y * my + z * mz, 0.0)
        for w in range(size):
            product[k + 1, w] = product[k, w]
        multiply(kind, fa, fb, table, cosine, product[k + 1])
        dx, dy, dz = 2.0 * cosine * mx - x, 2.0 * cosine * my - y, 2.0 * cosine * mz - z
        s = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * s, dy * s, dz * s
        onward, chance = segment(ndf, alpha_x, alpha_y, dx, dy, dz)
        split = before / (facet(ndf, alpha_x, alpha_y, x + dx, y + dy, z + dz) * weight * onward)
        before = up_to
        if dz > 0.0:
            up_to = up_to / chance
            inside = inside + split
        else:
            inside = inside / chance + split
        x, y, z, weight = -dx, -dy, -dz, onward
    return most


@kernel
def _connect(ndf, alpha_x, alpha_y, one, other, lengths, products, kind, fa, fb, table, least, most, path, sums):
    """Add every connection of two walks to path (1 or 1 + P, W), all and by layer, and to sums (P, W)."""
    size, kept = path.shape[1], path.shape[0] - 1
    row = np.empty(size)
    for i in range(lengths[0]):
        ix, iy, iz, weight = one[i, X], one[i, Y], one[i, Z], one[i, WEIGHT]
        before, up_to, inside = one[i, BEFORE], one[i, UP_TO], one[i, INSIDE]
        for j in range(max(0, least - 1 - i), min(lengths[1], most - i)):
            hx, hy, hz = ix + other[j, X], iy + other[j, Y], iz + other[j, Z]
            here = facet(ndf, alpha_x, alpha_y, hx, hy, hz) * weight * other[j, WEIGHT]
            if here <= 0.0:
                continue
            value = 1.0 / (before * other[j, BEFORE] / here + inside * other[j, UP_TO] + up_to * other[j, INSIDE])
            for w in range(size):
                row[w] = value * products[0, i, w] * products[1, j, w]
            if kind != MIRROR:
                multiply(kind, fa, fb, table, 0.5 * math.sqrt(hx * hx + hy * hy + hz * hz), row)
            layer = min(i + j, sums.shape[0] - 1)
            for w in range(size):
                path[0, w] += row[w]
                sums[layer, w] += row[w]
                if kept > 0:
                    path[1 + layer, w] += row[w]


@kernel
def _serve(
    ndf, alpha_x, alpha_y, kind, fa, fb, table, limit, least, most, seed,
    first, last, light, identity, view, weights, sums, squares,
):  # fmt: skip
    """Draw paths `first` to `last` of one cell."""
    size = weights.shape[0]
    one, other, products = np.empty((most, _COLUMNS)), np.empty((most, _COLUMNS)), np.empty((2, most, size))
    path = np.empty((squares.shape[0], size))
    lengths = np.empty(2, dtype=np.int64)
    for number in range(first, last):
        lengths[0] = _walk(
            ndf, alpha_x, alpha_y, light[0], light[1], light[2], kind, fa, fb, table, limit, most,
            seed, identity, number, 0, one, products[0],
        )  # fmt: skip
        lengths[1] = _walk(
            ndf, alpha_x, alpha_y, view[0], view[1], view[2], kind, fa, fb, table, limit, most,
            seed, identity, number, _SECOND, other, products[1],
        )  # fmt: skip
        path[:] = 0.0
        _connect(ndf, alpha_x, alpha_y, one, other, lengths, products, kind, fa, fb, table, least, most, path, sums)
        add_squares(path, weights, squares)


@parallel_kernel
def _draw(
    ndf, alpha_x, alpha_y, kind, fa, fb, table, limit, least, most, seed,
    tasks, lights, identities, views, weights, sums, squares,
):  # fmt: skip
    """Draw the paths of all tasks, each of one cell; arguments as in `walk.rows.draw`."""
    for n in numba.prange(tasks.shape[0]):
        row, first, last, cell, slot = tasks[n, 0], tasks[n, 1], tasks[n, 2], tasks[n, 3], tasks[n, 5]
        if views[cell, 3] > 0.0:
            _serve(
                ndf, alpha_x, alpha_y, kind, fa, fb, table, limit, least, most, seed,
                first, last, lights[row], identities[row], views[cell], weights,
                sums[slot, :, cell], squares[slot, :, cell],
            )  # fmt: skip


def path_sampler(setup: Setup, tolerance: float, least: int, known: Callable[..., Array]) -> PathSampler:
    """Return the path sampler of connections of order `least` and above; `known` gives the components before them."""
    fresnel = thinned(setup, 0.1 * tolerance)
    term = arguments(fresnel, 0.1 * tolerance)
    weights = np.ascontiguousarray(fresnel.weights, dtype=np.float64)
    limit, most = LIMITS[setup.values["roulette"]], min(setup.max_bounces or LONGEST, LONGEST)

    def draw(tasks: Whole, lights: Array, names: Whole, views: Array, sums: Array, squares: Array) -> None:
        if most >= least:
            _draw(
                setup.ndf, setup.alpha_x, setup.alpha_y, *term, limit, least, most, setup.values["seed"],
                tasks, lights, names, views, weights, sums, squares,
            )  # fmt: skip

    def views(directions: Array) -> Array:
        return np.concatenate([directions, np.ones((len(directions), 1))], axis=1)

    return PathSampler(draw, views, weights, known, shared=False)


def path_samplers(setup: Setup, tolerance: float) -> list[PathSampler]:
    """Return how paths are drawn: orders two and above, all wavelengths together."""

    def single(theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        return evaluate_points(setup, SEPARABLE, theta_i, theta_o, phi, phi_i)

    return [path_sampler(setup, tolerance, 2, single)]
