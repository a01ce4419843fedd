"""Walks until they leave the surface: what sampling and albedos are made of (Wang et al. 2022, Sec. 4.3)."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import DIELECTRIC
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.project import arguments
from brdftab.models._shared.random_walk.normals import visible_normal
from brdftab.models._shared.random_walk.reflecting import LONGEST
from brdftab.models._shared.random_walk.rng import uniforms
from brdftab.models._shared.random_walk.trace import arrive, crossed, scatter
from brdftab.models._shared.sampling.sampling import unit
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# walks of an albedo: at first, and at most
FIRST_WALKS, MOST_WALKS = 1 << 14, 1 << 22
# blocks of random numbers that say which side light takes
_CHOICE = 1 << 30


@kernel
def _meets(ndf, alpha_x, alpha_y, x, y, z, heights, level, u):
    """Tell whether light that travels along (x, y, z), z > 0 upwards on its side, meets a facet; and log C1 there."""
    _, chance, there = arrive(ndf, alpha_x, alpha_y, x, y, z, heights, level, u)
    return (there < 0.0 if heights else u < chance), there


@kernel
def _leave(ndf, alpha_x, alpha_y, x, y, z, index, kind, fa, fb, table, heights, most, seed, path, row):
    """Follow one walk until it leaves; multiplies `row` by F of every bounce (unless index > 0 and F chooses a side).

    Returns its direction and the number of bounces, 0 where the cap ends it.
    """
    level = 0.0
    side = 1.0 if z > 0.0 else -1.0
    dx, dy, dz = -x, -y, -z
    for k in range(most + 1):
        a, b, c, d = uniforms(seed, 0, path, k)
        met, level = _meets(ndf, alpha_x, alpha_y, dx, dy, side * dz, heights, level, d)
        if not met:
            return dx, dy, dz, k
        if k == most:
            break
        x, y, z = -dx, -dy, -dz
        if index > 0.0:
            choice = uniforms(seed, 0, path, _CHOICE + k)[0]
            dx, dy, dz, new = scatter(ndf, alpha_x, alpha_y, side, x, y, z, index, a, b, c, choice)
            if new != side:
                side, level = new, (crossed(level) if heights else 0.0)
            continue
        mx, my, mz = visible_normal(ndf, alpha_x, alpha_y, x, y, z, a, b, c)
        cosine = max(x * mx + y * my + z * mz, 0.0)
        multiply(kind, fa, fb, table, cosine, row)
        dx, dy, dz = 2.0 * cosine * mx - x, 2.0 * cosine * my - y, 2.0 * cosine * mz - z
        s = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * s, dy * s, dz * s
    return dx, dy, dz, 0


@parallel_kernel
def _leave_all(
    ndf, alpha_x, alpha_y, light, kind, fa, fb, table, heights, most, seed, first, directions, rows, bounces
):
    """Follow walks `first` and on; fills directions (n, 3), products of F (n, W) and bounces (n,).

    Dielectrics (kind 2) take turns with their indices: walk p has index p modulo W, a weight of W there, 0 elsewhere.
    """
    size = rows.shape[1]
    for n in numba.prange(directions.shape[0]):
        own = (first + n) % size
        index = fa[own] if kind == DIELECTRIC else 0.0
        for w in range(size):
            rows[n, w] = 1.0 if kind != DIELECTRIC else (float(size) if w == own else 0.0)
        x, y, z, k = _leave(
            ndf, alpha_x, alpha_y, light[0], light[1], light[2], index, kind, fa, fb, table, heights, most, seed,
            first + n, rows[n],
        )  # fmt: skip
        directions[n, 0], directions[n, 1], directions[n, 2], bounces[n] = x, y, z, k


def walks(
    setup: Setup, theta_i: float, phi_i: float, heights: bool, n: int, seed: int, first: int = 0
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Follow `n` walks of light from one direction until they leave.

    Parameters
    ----------
    setup : Setup
        Distribution, roughness, reflectance, cap of the bounces.
    theta_i, phi_i : float
        Direction towards the light, radians; theta_i beyond pi/2 below a dielectric.
    heights : bool
        Walks with heights or position-free, see `trace`.
    n, seed, first : int
        How many, and which random numbers: walks `first` and on of `seed`.

    Returns
    -------
    directions : ndarray (n, 3)
        In which they leave.
    weight : ndarray (n, C)
        Products of F, projected to channels; a dielectric's are 1 a channel on average: reflection or refraction was
        drawn by F.
    bounces : ndarray (n,) of int
        0 where the cap ended the walk; direction and weight then mean nothing.
    """
    assert setup.fresnel is not None
    term = arguments(setup.fresnel, 1e-4)
    light = unit(theta_i, phi_i)
    directions, rows = np.empty((n, 3)), np.empty((n, setup.fresnel.a.size))
    bounces = np.empty(n, dtype=np.int64)
    most = min(setup.max_bounces or LONGEST, LONGEST)
    _leave_all(
        setup.ndf, setup.alpha_x, setup.alpha_y, light, *term, heights, most, seed, first, directions, rows, bounces
    )
    return directions, rows @ setup.fresnel.weights, bounces


def mean_exit(setup: Setup, theta_i: float, phi_i: float, heights: bool, tolerance: float) -> Array:
    """Return the share of light (C,) that leaves, to a standard error of `tolerance` or after 2^22 walks."""
    return _mean(setup, theta_i, phi_i, heights, tolerance, False)[0]


def split_exit(setup: Setup, theta_i: float, phi_i: float, heights: bool, tolerance: float) -> Array:
    """Return the shares of light (2, C) that leave on the light's own side and on the other one, as `mean_exit`."""
    return _mean(setup, theta_i, phi_i, heights, tolerance, True)


def _mean(setup: Setup, theta_i: float, phi_i: float, heights: bool, tolerance: float, split: bool) -> Array:
    """Return mean weights (1, C) of walks that leave, or (2, C) by side."""
    sides = 2 if split else 1
    total, squares = np.zeros((sides, len(setup.channels))), np.zeros((sides, len(setup.channels)))
    first, last = 0, FIRST_WALKS
    while True:
        directions, weight, bounces = walks(setup, theta_i, phi_i, heights, last - first, 0, first)
        weight[bounces == 0] = 0.0
        own = (directions[:, 2] > 0.0) == (theta_i < 0.5 * math.pi)
        for side, part in enumerate((weight[own], weight[~own]) if split else (weight,)):
            total[side] += part.sum(axis=0)
            squares[side] += (part * part).sum(axis=0)
        mean = total / last
        spread = np.sqrt(np.maximum(squares / last - mean * mean, 0.0) / last)
        if spread.max() <= tolerance or last >= MOST_WALKS:
            return mean
        first, last = last, 2 * last
