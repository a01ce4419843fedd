"""The noise-free solver of all bounces on isotropic reflecting Smith surfaces."""

from __future__ import annotations

import numpy as np

from brdftab.models.resolve import Setup
from brdftab.models.smith_multi.volterra.energy import albedo
from brdftab.models.smith_multi.volterra.points import evaluate
from brdftab.models.smith_multi.volterra.settings import FINEST, settings
from brdftab.models.smith_multi.volterra.table import VolterraEvaluator

__all__ = ["FINEST", "VolterraEvaluator", "albedo", "points", "prepare"]


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
    """Evaluate at N pairs of directions (radians); returns (N, P, C) in 1/sr, see `points.evaluate`."""
    return evaluate(setup, theta_i, theta_o, phi, phi_i, orders, settings(setup.ndf, tolerance))


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> VolterraEvaluator:
    """Return the tables of an isotropic reflecting setup at a relative tolerance; `trial` only compiles."""
    return VolterraEvaluator(setup, tolerance, trial, orders)
