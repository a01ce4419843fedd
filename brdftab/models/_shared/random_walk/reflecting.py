"""Walks over facets that reflect, as a path sampler of `sampling_plan`."""

from __future__ import annotations

import numpy as np

from brdftab.jit import kernel
from brdftab.models._shared.codes import CORRELATED, SEPARABLE
from brdftab.models._shared.fresnel.project import arguments, thinned
from brdftab.models._shared.random_walk import rows
from brdftab.models._shared.random_walk.estimates import Whole
from brdftab.models._shared.random_walk.sampling_plan import PathSampler
from brdftab.models._shared.random_walk.terms import segment
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# throughput below which walks end at random; at the lower one the variance stays the same to four digits
LIMITS = {"off": 1e-2, "on": 0.3}
# no walk gets here: each reflection raises the direction of travel, and dim walks have ended long before
LONGEST = 512


@kernel
def _fill_views(ndf, alpha_x, alpha_y, heights, views):
    for n in range(views.shape[0]):
        z = views[n, 2]
        weight, chance = segment(ndf, alpha_x, alpha_y, views[n, 0], views[n, 1], z)
        views[n, 3] = 1.0 / abs(z) if heights else weight
        views[n, 4] = chance / (1.0 - chance)


def view_terms(setup: Setup, heights: bool, directions: Array) -> Array:
    """Return unit vectors (M, 3), the factor of the last segment without its height, and Lambda, together (M, 5)."""
    views = np.concatenate([directions, np.zeros((len(directions), 2))], axis=1)
    _fill_views(setup.ndf, setup.alpha_x, setup.alpha_y, heights, views)
    return views


def reflecting(setup: Setup, tolerance: float, heights: bool, least: int = 2) -> PathSampler:
    """Return the path sampler of path tracing with next event estimation over facets that reflect.

    Parameters
    ----------
    setup : Setup
        Distribution, roughness, reflectance, seed, roulette and cap of the orders.
    tolerance : float
        Of which a tenth may come from carrying fewer wavelengths (orders two and above).
    heights : bool
        Walks with heights (Heitz et al. 2016), or position-free ones (Wang et al. 2022).
    least : int
        1 or 2: lowest order that paths estimate; the single bounce is otherwise known exactly.
    """
    fresnel = thinned(setup, 0.1 * tolerance)
    term = arguments(fresnel, 0.1 * tolerance)
    weights = np.ascontiguousarray(fresnel.weights, dtype=np.float64)
    limit, most = LIMITS[setup.values["roulette"]], min(setup.max_bounces or LONGEST, LONGEST)
    masking = CORRELATED if heights else SEPARABLE

    def draw(tasks: Whole, lights: Array, names: Whole, views: Array, sums: Array, squares: Array) -> None:
        if most >= least:
            rows.draw(
                setup.ndf, setup.alpha_x, setup.alpha_y, *term, heights, limit, least, most, setup.values["seed"],
                tasks, lights, names, views, weights, sums, squares,
            )  # fmt: skip

    def single(theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        if least > 1:
            return evaluate_points(setup, masking, theta_i, theta_o, phi, phi_i)
        return np.zeros((theta_i.size, 0, len(setup.channels)))

    return PathSampler(draw, lambda o: view_terms(setup, heights, o), weights, single, shared=True)
