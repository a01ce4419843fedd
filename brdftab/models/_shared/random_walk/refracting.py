"""Walks over facets that reflect and refract, as path samplers of `sampling_plan`: one for each refractive index."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.random_walk.estimates import Whole
from brdftab.models._shared.random_walk.layout import vectors
from brdftab.models._shared.random_walk.reflecting import LIMITS, LONGEST, view_terms
from brdftab.models._shared.random_walk.refraction import reflected_vertex, transmitted_vertex
from brdftab.models._shared.random_walk.rows import FIRST, HIGH, LAST, LOW, ROW, SLOT
from brdftab.models._shared.random_walk.sampling_plan import PathSampler
from brdftab.models._shared.random_walk.terms import segment
from brdftab.models._shared.random_walk.trace import COLUMNS, FACTOR, HEIGHT, SIDE, WX, WY, WZ, refractions
from brdftab.models.resolve import Setup
from brdftab.typing import Array


@kernel
def _vertex(ndf, alpha_x, alpha_y, side, ix, iy, iz, ox, oy, oz, n):
    """Return the facet's term of light from i on `side` to o on either side."""
    above = side > 0.0
    if (oz > 0.0) == above:
        return reflected_vertex(ndf, alpha_x, alpha_y, side, ix, iy, iz, ox, oy, oz, n if above else 1.0 / n)
    n_i, n_o = (1.0, n) if above else (n, 1.0)
    return transmitted_vertex(ndf, alpha_x, alpha_y, side, ix, iy, iz, ox, oy, oz, n_i, n_o)


@kernel
def _serve(
    ndf, alpha_x, alpha_y, n, heights, limit, least, most, seed,
    first, last, light, identity, views, sums, squares,
):  # fmt: skip
    """Draw paths `first` to `last` of one row and send light to its views."""
    layers, count, kept = sums.shape[0], views.shape[0], squares.shape[0] - 1
    vertices, throughput, path = np.empty((most, COLUMNS)), np.empty((most, 1)), np.empty((1 + kept, count))
    for number in range(first, last):
        met = refractions(
            ndf, alpha_x, alpha_y, light[0], light[1], light[2], n, heights, limit, most,
            seed, identity, number, vertices, throughput,
        )  # fmt: skip
        if met < least:
            continue
        path[:] = 0.0
        for k in range(least - 1, met):
            layer = min(k, layers - 1)
            x, y, z, side = vertices[k, WX], vertices[k, WY], vertices[k, WZ], vertices[k, SIDE]
            factor, level = vertices[k, FACTOR] * throughput[k, 0], vertices[k, HEIGHT]
            # what lies below a height on one side lies above it on the other
            level_across = math.log(-math.expm1(level)) if heights else 0.0
            for j in range(count):
                oz = views[j, 2]
                value = _vertex(ndf, alpha_x, alpha_y, side, x, y, z, views[j, 0], views[j, 1], oz, n)
                if value <= 0.0:
                    continue
                value *= factor * views[j, 3]
                if heights:
                    value *= math.exp((level if (oz > 0.0) == (side > 0.0) else level_across) * views[j, 4])
                path[0, j] += value
                sums[layer, j, 0] += value
                if kept > 0:
                    path[1 + layer, j] += value
        for p in range(1 + kept):
            for j in range(count):
                squares[p, j, 0] += path[p, j] * path[p, j]


@parallel_kernel
def _draw(ndf, alpha_x, alpha_y, n, heights, limit, least, most, seed, tasks, lights, identities, views, sums, squares):
    """Draw the paths of all tasks; arguments as in `rows.draw`, with one wavelength of index `n` below."""
    for t in numba.prange(tasks.shape[0]):
        task = tasks[t]
        row, low, high, slot = task[ROW], task[LOW], task[HIGH], task[SLOT]
        _serve(
            ndf, alpha_x, alpha_y, n, heights, limit, least, most, seed, task[FIRST], task[LAST],
            lights[row], identities[row], views[low:high], sums[slot, :, low:high], squares[slot, :, low:high],
        )  # fmt: skip


@kernel
def across(a, b):
    """Return B(1 + a, 1 + b): the mean of C1^a (1 - C1)^b over heights, both sides' Lambda being a and b."""
    return math.exp(math.lgamma(1.0 + a) + math.lgamma(1.0 + b) - math.lgamma(2.0 + a + b))


@kernel
def single_bounce(ndf, alpha_x, alpha_y, n, heights, incoming, outgoing):
    """Return the single bounce (N,) of unit vectors (N, 3), 1/sr."""
    out = np.zeros(incoming.shape[0])
    for k in range(out.size):
        ix, iy, iz = incoming[k, 0], incoming[k, 1], incoming[k, 2]
        ox, oy, oz = outgoing[k, 0], outgoing[k, 1], outgoing[k, 2]
        if min(abs(iz), abs(oz)) <= HORIZON:
            continue
        side = 1.0 if iz > 0.0 else -1.0
        weight_i, chance_i = segment(ndf, alpha_x, alpha_y, ix, iy, iz)
        weight_o, chance_o = segment(ndf, alpha_x, alpha_y, ox, oy, oz)
        masking = weight_i * weight_o
        if heights:
            a, b = chance_i / (1.0 - chance_i), chance_o / (1.0 - chance_o)
            # the mean of C1^b, or of (1 - C1)^b across, over the heights that i meets, density (1 + a) C1^a
            masking = 1.0 / (1.0 + a + b) if (oz > 0.0) == (iz > 0.0) else across(a, b)
            masking /= abs(iz * oz)
        out[k] = masking * _vertex(ndf, alpha_x, alpha_y, side, ix, iy, iz, ox, oy, oz, n)
    return out


def _path_sampler(setup: Setup, n: float, heights: bool, least: int) -> PathSampler:
    """Return the path sampler at one index."""
    limit, most = LIMITS[setup.values["roulette"]], min(setup.max_bounces or LONGEST, LONGEST)
    facets = setup.ndf, setup.alpha_x, setup.alpha_y

    def draw(tasks: Whole, lights: Array, names: Whole, views: Array, sums: Array, squares: Array) -> None:
        if most >= least:
            _draw(
                *facets, n, heights, limit, least, most, setup.values["seed"],
                tasks, lights, names, views, sums, squares,
            )  # fmt: skip

    def single(theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        if least < 2:
            return np.zeros((theta_i.size, 0, 1))
        return single_bounce(*facets, n, heights, vectors(theta_i, phi_i), vectors(theta_o, phi_i + phi))[:, None, None]

    return PathSampler(draw, lambda o: view_terms(setup, heights, o), np.ones((1, 1)), single, shared=True, below=n)


def transmitting(setup: Setup, heights: bool, least: int = 2) -> list[PathSampler]:
    """Return the path samplers of path tracing over facets that reflect and refract, one for each channel.

    Directions after a refraction depend on the index, so that channels of different index cannot share walks.

    Parameters
    ----------
    setup : Setup
        Distribution, roughness, index, seed, roulette and cap of the orders.
    heights, least
        As in `reflecting.reflecting`.
    """
    assert setup.fresnel is not None
    return [_path_sampler(setup, float(n), heights, least) for n in setup.fresnel.a]
