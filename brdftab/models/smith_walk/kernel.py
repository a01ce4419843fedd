"""Random walks with heights on Smith microfacets (Heitz et al. 2016): values with standard errors.

The single bounce is the height-correlated F D G2/(4 cos cos) in closed form, which the walk has as its expectation
(transmission: G2 = B(1 + Lambda_i, 1 + Lambda_o)); the walks estimate the further orders.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdftab.models._shared.random_walk.estimates import Estimates
from brdftab.models._shared.random_walk.exits import mean_exit, split_exit
from brdftab.models._shared.random_walk.reflecting import reflecting
from brdftab.models._shared.random_walk.refracting import transmitting
from brdftab.models._shared.random_walk.sampling_plan import PathSampler, at_points, on_grid
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# standard error of albedos by walks
_NOISE = 1e-3


def _path_samplers(setup: Setup, tolerance: float) -> list[PathSampler]:
    return transmitting(setup, heights=True) if setup.transmits else [reflecting(setup, tolerance, heights=True)]


def stochastic(setup: Setup) -> bool:
    """Tell that values carry a statistical error."""
    return True


def estimates(
    setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, *, orders: int, tolerance: float
) -> Estimates:
    """Estimate at N pairs of directions (radians): values (N, P, C), standard_error (N, C), samples (N,)."""
    return at_points(setup, _path_samplers(setup, tolerance), (theta_i, theta_o, phi, phi_i), orders, tolerance)


def points(
    setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, *, orders: int, tolerance: float
) -> Array:
    """Return the values (N, P, C) of `estimates`, 1/sr."""
    return estimates(setup, theta_i, theta_o, phi, phi_i, orders=orders, tolerance=tolerance).values


def estimate_table(
    setup: Setup,
    axes: dict[str, Array],
    *,
    orders: int,
    tolerance: float,
    progress: Callable[[float], None] | None = None,
) -> Estimates:
    """Estimate on a product grid; walks from each direction of light serve all of its views.

    Square tables are drawn half, so that they are exactly reciprocal. Returns values (P, *shape, C), standard_error
    (*shape, C) and samples (*shape).
    """
    return on_grid(setup, _path_samplers(setup, tolerance), axes, orders, tolerance, progress)


def albedo(setup: Setup, theta_i: Array, phi_i: float, tolerance: float) -> Array:
    """Return the directional albedo (N, C) of all bounces, transmitted light included: mean weight of walks that left.

    Walks are drawn until the standard error is `tolerance` or 1e-3.
    """
    return np.array([mean_exit(setup, float(theta), phi_i, True, max(tolerance, _NOISE)) for theta in theta_i])


def split_albedo(setup: Setup, theta_i: Array, phi_i: float, tolerance: float) -> tuple[Array, Array]:
    """Return what a dielectric reflects and what it transmits, (N, C) each; light from either side, as `albedo`."""
    both = np.array([split_exit(setup, float(theta), phi_i, True, max(tolerance, _NOISE)) for theta in theta_i])
    return both[:, 0], both[:, 1]
