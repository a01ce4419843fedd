"""Sampling by walks: directions in which light leaves, their throughput, and an approximate density."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brdftab.jit import kernel
from brdftab.materials.fresnel import mirror
from brdftab.models._shared.codes import CORRELATED, SEPARABLE
from brdftab.models._shared.random_walk.exits import walks
from brdftab.models._shared.random_walk.layout import vectors
from brdftab.models._shared.random_walk.normals import visible_normal
from brdftab.models._shared.random_walk.refracting import across, single_bounce
from brdftab.models._shared.random_walk.refraction import fresnel, refract
from brdftab.models._shared.random_walk.terms import segment
from brdftab.models._shared.sampling.sampling import angles, unit
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# points of the lattice that finds how much light leaves after one bounce: good to some 1e-4
_POINTS = 4096
# powers of the root of x^4 = x + 1, whose multiples fill the cube evenly
_STEPS = tuple(1.2207440846057596**-k for k in (1, 2, 3))


def draw(
    setup: Setup, heights: bool, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """Draw `n` directions in which light leaves.

    Parameters
    ----------
    setup : Setup
        Read for distribution, roughness, reflectance and max_bounces.
    heights : bool
        Walks with heights or position-free, see `trace`.
    theta_i, phi_i : float
        Direction towards the light, radians.
    n : int
        How many.
    rng : numpy.random.Generator
        Gives the seed of the walks.

    Returns
    -------
    theta_o, phi_o : ndarray (n,)
        Radians; theta_o beyond pi/2 below a dielectric, phi_o absolute, in [0, 2 pi).
    valid : ndarray (n,) of bool
        False where `max_bounces` ended the walk; all true without that cap.
    weight : ndarray (n, C)
        Throughput: the product of F over the bounces, projected to channels, 0 where not valid. For a dielectric 1: F
        has chosen between reflection and refraction (several indices take turns, and weigh as many in their channel).
    """
    directions, weight, bounces = walks(setup, theta_i, phi_i, heights, n, int(rng.integers(1 << 62)))
    theta_o, phi_o, _ = angles(directions)
    valid = bounces > 0
    weight[~valid] = 0.0
    return theta_o, phi_o, valid, weight


@kernel
def _leaves(heights, chance_i, chance_o, same_side):
    """Return the chance that light leaves right after one bounce, from the chances to meet a facet both ways."""
    if not heights:
        return 1.0 - chance_o
    a, b = chance_i / (1.0 - chance_i), chance_o / (1.0 - chance_o)
    return (1.0 + a) / (1.0 + a + b) if same_side else (1.0 + a) * across(a, b)


@kernel
def _kept(ndf, alpha_x, alpha_y, x, y, z, index, heights):
    """Return the shares of light from (x, y, z) that leave after one bounce on its own side and on the other."""
    side = 1.0 if z > 0.0 else -1.0
    x, y, z = side * x, side * y, side * z
    eta = index if side > 0.0 else 1.0 / index
    chance_i = segment(ndf, alpha_x, alpha_y, x, y, z)[1]
    near, far = 0.0, 0.0
    for k in range(_POINTS):
        a, b, c = (0.5 + k * _STEPS[0]) % 1.0, (0.5 + k * _STEPS[1]) % 1.0, (0.5 + k * _STEPS[2]) % 1.0
        # 0 itself has no logarithm
        mx, my, mz = visible_normal(ndf, alpha_x, alpha_y, x, y, z, a, max(b, 1e-9), c)
        cosine = max(x * mx + y * my + z * mz, 0.0)
        share = fresnel(cosine, eta) if index > 0.0 else 1.0
        dz = 2.0 * cosine * mz - z
        if dz > 0.0:
            dx, dy = 2.0 * cosine * mx - x, 2.0 * cosine * my - y
            near += share * _leaves(heights, chance_i, segment(ndf, alpha_x, alpha_y, dx, dy, dz)[1], True)
        if share < 1.0:
            p = cosine / eta - refract(cosine, eta)
            dx, dy, dz = p * mx - x / eta, p * my - y / eta, p * mz - z / eta
            if dz < 0.0:
                chance_o = segment(ndf, alpha_x, alpha_y, dx, dy, dz)[1]
                far += (1.0 - share) * _leaves(heights, chance_i, chance_o, False)
    return near / _POINTS, far / _POINTS


def _density(
    setup: Setup, index: float, heights: bool, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array
) -> Array:
    """Return the density (N,) at one index, 0 for facets that only reflect."""
    facets = setup.ndf, setup.alpha_x, setup.alpha_y
    if index:
        f = single_bounce(*facets, index, heights, vectors(theta_i, phi_i), vectors(theta_o, phi_i + phi))
    else:
        bare = replace(setup, fresnel=mirror(), channels=("Y",))
        f = evaluate_points(bare, CORRELATED if heights else SEPARABLE, theta_i, theta_o, phi, phi_i)[:, 0, 0]
    cosine = np.abs(np.cos(theta_o))
    out = f * cosine
    if setup.max_bounces == 1:
        return out
    lights, which = np.unique(np.stack([theta_i, phi_i * (not setup.isotropic)]), axis=1, return_inverse=True)
    shares = np.array([_kept(*facets, *unit(*light), index, heights) for light in lights.T])
    missing = np.maximum(1.0 - shares.sum(axis=1), 0.0)
    split = shares / np.maximum(shares.sum(axis=1), 1e-300)[:, None]
    same = (theta_o < 0.5 * np.pi) == (theta_i < 0.5 * np.pi)
    which = which.reshape(-1)
    return out + missing[which] * np.where(same, split[which, 0], split[which, 1]) * cosine / np.pi


def density(setup: Setup, heights: bool, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return an approximate density (N,) of `draw`, 1/sr.

    That of one bounce is exact, F = 1 or, for a dielectric, both lobes; further bounces are taken for diffuse, cos/pi
    on either side in the proportion of the first bounce (Wang et al. 2022, Sec. 4.3; Heitz et al. 2016). It
    integrates to 1, and lacks the share of one bounce only where `max_bounces` is 1.
    """
    assert setup.fresnel is not None
    indices = setup.fresnel.a if setup.transmits else (0.0,)
    return np.mean([_density(setup, float(n), heights, theta_i, theta_o, phi, phi_i) for n in indices], axis=0)
