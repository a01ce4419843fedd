"""Cook-Torrance: the shared single-bounce kernel with V-cavity masking."""

from __future__ import annotations

import numpy as np

from brdftab.models._shared.codes import V_CAVITY
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models._shared.single_bounce.single_table import SingleBounceEvaluator, build
from brdftab.models.resolve import Setup


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
    """Evaluate at N pairs of directions (radians); returns (N, 1, C) in 1/sr, exact for any `tolerance`."""
    return evaluate_points(setup, V_CAVITY, theta_i, theta_o, phi, phi_i)


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> SingleBounceEvaluator | None:
    """Return the fast product-grid table of an isotropic setup, or None where only `points` holds the tolerance."""
    return None if orders else build(setup, V_CAVITY, tolerance)
