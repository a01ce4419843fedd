"""The factor that returns what single bounces lack, and tables with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brdftab.models._shared.codes import MASKINGS
from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models._shared.single_bounce.albedo import missing
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models._shared.single_bounce.single_table import SingleBounceEvaluator, build
from brdftab.models.resolve import Setup


def weighted(setup: Setup) -> Setup:
    """Return the setup whose single bounce carries F0 of each wavelength once more."""
    fresnel = setup.fresnel
    assert fresnel is not None
    f0 = np.array([reflectance(fresnel.kind, a, b, 1.0) for a, b in zip(fresnel.a, fresnel.b, strict=True)])
    return replace(setup, fresnel=replace(fresnel, weights=f0[:, None] * fresnel.weights))


def excess(setup: Setup, theta_o: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
    """Return (1 - E)/E (N,) at the views."""
    lost = missing(setup, MASKINGS[setup.values["masking"]], theta_o, tolerance, divided=False)
    return lost / (1.0 - lost)


class CompensatedEvaluator:
    """Fast product-grid tables: two single bounces, of which one is scaled by the view."""

    def __init__(
        self, setup: Setup, first: SingleBounceEvaluator, more: SingleBounceEvaluator, tolerance: float
    ) -> None:
        self._setup, self._first, self._more, self._tolerance = setup, first, more, tolerance

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians); returns (N, 1, C) in 1/sr."""
        return points(self._setup, theta_i, theta_o, phi, phi_i, orders=0, tolerance=self._tolerance)

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (1, I, O, F, C) on a product grid of radians."""
        same = bool(np.array_equal(theta_i, theta_o))
        more = np.empty(out.shape, dtype=out.dtype)
        self._first.fill(theta_i, theta_o, phi, same, out)
        self._more.fill(theta_i, theta_o, phi, same, more)
        out += more * excess(self._setup, theta_o, self._tolerance).astype(out.dtype)[:, None, None]


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
    masking = MASKINGS[setup.values["masking"]]
    first = evaluate_points(setup, masking, theta_i, theta_o, phi, phi_i)
    more = evaluate_points(weighted(setup), masking, theta_i, theta_o, phi, phi_i)
    more *= excess(setup, theta_o, tolerance)[:, None, None]
    return np.concatenate([first, more], axis=1) if orders else first + more


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> CompensatedEvaluator | None:
    """Return the fast product-grid tables, or None where only `points` holds the tolerance."""
    masking = MASKINGS[setup.values["masking"]]
    first, more = build(setup, masking, tolerance), build(weighted(setup), masking, tolerance)
    return None if orders or first is None or more is None else CompensatedEvaluator(setup, first, more, tolerance)
