"""All bounces of Smith microfacets: which backend serves a setup.

volterra/: the noise-free solver of reflecting surfaces; dielectric/: that of dielectrics; montecarlo/: the estimators.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from brdftab.models.resolve import Setup

# directions are solved together, and how many there are turns the last bits: blocks have one size, whatever the time
JOINT = True
# standard error of albedos by walks
_NOISE = 1e-3


def _backend(setup: Setup) -> Any:
    """Return the package that evaluates a setup; the others are not loaded."""
    name = "montecarlo" if stochastic(setup) else ("dielectric" if setup.transmits else "volterra")
    return importlib.import_module(f"brdftab.models.smith_multi.{name}")


def points(
    setup: Setup,
    theta_i: np.ndarray,
    theta_o: np.ndarray,
    phi: np.ndarray,
    phi_i: np.ndarray,
    *,
    orders: int,
    tolerance: float,
) -> np.ndarray:
    """Evaluate at N pairs of directions (radians); returns (N, P, C) in 1/sr."""
    return _backend(setup).points(setup, theta_i, theta_o, phi, phi_i, orders=orders, tolerance=tolerance)


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> Any:
    """Return the solver's product-grid tables, or None for the estimators."""
    return None if stochastic(setup) else _backend(setup).prepare(setup, tolerance, orders, trial)


def albedo(setup: Setup, theta_i: np.ndarray, phi_i: float, tolerance: float) -> np.ndarray:
    """Return the directional albedo (N, C) of all bounces, transmitted light included.

    Estimators draw walks, to a standard error of `tolerance` or 1e-3.
    """
    if stochastic(setup):
        return _backend(setup).albedo(setup, theta_i, phi_i, max(tolerance, _NOISE))
    return _backend(setup).albedo(setup, theta_i, tolerance)


def split_albedo(setup: Setup, theta_i: np.ndarray, phi_i: float, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what a dielectric reflects and what it transmits, (N, C) each; light from either side, as `albedo`."""
    if stochastic(setup):
        return _backend(setup).split_albedo(setup, theta_i, phi_i, max(tolerance, _NOISE))
    return _backend(setup).split_albedo(setup, theta_i, tolerance)


def stochastic(setup: Setup) -> bool:
    """Tell whether values carry a statistical error."""
    return bool(setup.values["estimator"] != "solver")


def estimates(setup: Setup, *angles: np.ndarray, orders: int, tolerance: float) -> Any:
    """Return values with standard errors at N pairs of directions, see `montecarlo.estimates`."""
    return _backend(setup).estimates(setup, *angles, orders=orders, tolerance=tolerance)


def estimate_table(setup: Setup, axes: dict[str, np.ndarray], **options: Any) -> Any:
    """Return values with standard errors on a product grid, see `montecarlo.estimate_table`."""
    return _backend(setup).estimate_table(setup, axes, **options)


def finest(setup: Setup) -> float:
    """Return the tolerance of the solver's finest rule; tighter ones are served by the same."""
    return float(_backend(setup).FINEST)
