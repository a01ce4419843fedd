"""The energy that single bounces lack, and tables with the lobe that returns it."""

from __future__ import annotations

import math

import numpy as np

from brdftab.models._shared.codes import MASKINGS
from brdftab.models._shared.single_bounce.albedo import average_albedo, average_reflectance, missing
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models._shared.single_bounce.single_table import SingleBounceEvaluator, build
from brdftab.models.resolve import Setup


def strength(setup: Setup, tolerance: float = 0.0) -> np.ndarray:
    """Return F_ms/(pi (1 - E_avg)) (C,): the lobe is this times 1 - E of both directions."""
    assert setup.fresnel is not None
    average = average_albedo(MASKINGS[setup.values["masking"]], setup.ndf, setup.alpha_x, tolerance)
    f = average_reflectance(setup.fresnel)
    lobe = f * f * average / (1.0 - f * (1.0 - average)) / (math.pi * (1.0 - average))
    return np.asarray(lobe @ setup.fresnel.weights)


def lacking(setup: Setup, theta: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
    """Return 1 - E (N,), the energy that single bounces miss at each polar angle; 0 at the horizon and below."""
    return missing(setup, MASKINGS[setup.values["masking"]], theta, tolerance)


class CompensatedEvaluator:
    """Fast product-grid tables: those of the single bounce, and the lobe on top."""

    def __init__(self, setup: Setup, single: SingleBounceEvaluator, tolerance: float) -> None:
        self._setup, self._single, self._tolerance = setup, single, tolerance
        self._strength = strength(setup, tolerance)

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians); returns (N, 1, C) in 1/sr."""
        return points(self._setup, theta_i, theta_o, phi, phi_i, orders=0, tolerance=self._tolerance)

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (1, I, O, F, C) on a product grid of radians."""
        self._single.fill(theta_i, theta_o, phi, square, out)
        product = np.outer(*(lacking(self._setup, theta, self._tolerance) for theta in (theta_i, theta_o)))
        out += (product[:, :, None, None] * self._strength).astype(out.dtype)


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
    """Evaluate at N pairs of directions (radians); returns (N, P, C) in 1/sr, to 1e-9 below a tolerance of 1e-4."""
    first = evaluate_points(setup, MASKINGS[setup.values["masking"]], theta_i, theta_o, phi, phi_i)
    product = lacking(setup, theta_i, tolerance) * lacking(setup, theta_o, tolerance)
    lobe = product[:, None, None] * strength(setup, tolerance)
    return np.concatenate([first, lobe], axis=1) if orders else first + lobe


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> CompensatedEvaluator | None:
    """Return the fast product-grid tables, or None where only `points` holds the tolerance."""
    single = build(setup, MASKINGS[setup.values["masking"]], tolerance)
    return None if orders or single is None else CompensatedEvaluator(setup, single, tolerance)
