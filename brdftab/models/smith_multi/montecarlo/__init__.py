"""Estimators of the multiple bounces between Smith microfacets, with standard errors."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from brdftab.models._shared.random_walk.estimates import Estimates
from brdftab.models._shared.random_walk.exits import mean_exit, split_exit
from brdftab.models._shared.random_walk.sampling_plan import PathSampler, at_points, on_grid
from brdftab.models.resolve import Setup
from brdftab.typing import Array

__all__ = ["Estimates", "albedo", "estimate_table", "estimates", "points", "split_albedo"]


def _path_samplers(setup: Setup, tolerance: float) -> list[PathSampler]:
    """Return how the setup's estimator draws its paths; only its own kernels are imported."""
    module: Any = importlib.import_module(f"{__name__}.{setup.values['estimator']}")
    found: list[PathSampler] = module.path_samplers(setup, tolerance)
    return found


def estimates(
    setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, *, orders: int, tolerance: float
) -> Estimates:
    """Estimate at N pairs of directions (radians), each with paths of its own.

    Parameters
    ----------
    setup : Setup
        A smith-multi setup whose estimator is pt, bdpt or hybrid.
    theta_i, theta_o, phi, phi_i : ndarray (N,)
        Radians; phi = phi_o - phi_i.
    orders : int
        0 for the total, else bounce orders up to it are kept apart.
    tolerance : float
        Relative standard error where `samples` is not set; see `random_walk.estimates.estimate`.

    Returns
    -------
    Estimates
        values (N, P, C) in 1/sr, standard_error (N, C), component_errors (N, P, C), samples (N,).
    """
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
    """Estimate on a product grid; pt walks from each direction of light serve all of its views.

    Where both direction lists are identical, one half is drawn and both hold the same estimate: the table is exactly
    reciprocal.

    Parameters
    ----------
    setup, orders, tolerance
        As in `estimates`.
    axes : dict of ndarray
        theta_i, theta_o, phi or theta_i, phi_i, theta_o, phi_o in radians, in this order.
    progress : callable, optional
        Called with the finished share of the work.

    Returns
    -------
    Estimates
        values (P, *shape, C) in 1/sr, standard_error (*shape, C), component_errors as values, samples (*shape).
    """
    return on_grid(setup, _path_samplers(setup, tolerance), axes, orders, tolerance, progress)


def albedo(setup: Setup, theta_i: Array, phi_i: float, tolerance: float) -> Array:
    """Return the directional albedo (N, C) of all bounces, transmitted light included: mean weight of walks that left.

    Walks are drawn until the standard error is `tolerance`, or 2^22 of them.
    """
    return np.array([mean_exit(setup, float(theta), phi_i, False, tolerance) for theta in theta_i])


def split_albedo(setup: Setup, theta_i: Array, phi_i: float, tolerance: float) -> tuple[Array, Array]:
    """Return what a dielectric reflects and what it transmits, (N, C) each; light from either side, as `albedo`."""
    both = np.array([split_exit(setup, float(theta), phi_i, False, tolerance) for theta in theta_i])
    return both[:, 0], both[:, 1]
