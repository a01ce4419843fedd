"""Values of a traced scratch at listed pairs of directions."""

from __future__ import annotations

import numpy as np

from brdftab.models.resolve import Setup
from brdftab.models.scratch import blur
from brdftab.models.scratch.shoot import ORDERS
from brdftab.models.scratch.surface import surface


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
    """Evaluate at N pairs of directions (radians); returns (N, P, C) in 1/sr.

    With orders > 0 the layers are the bounce orders 1 to 4 and the rest. `tolerance` chooses the rays, unless the setup
    says how many.
    """
    assert setup.fresnel is not None
    scratch = surface(setup, tolerance)
    angles = theta_i, theta_o, phi, phi_i
    return blur.points(scratch, setup.fresnel, setup.values["psi"], *angles, ORDERS if orders else 1)


def albedo(setup: Setup, theta_i: np.ndarray, phi_i: float, tolerance: float) -> np.ndarray:
    """Return the directional albedo (N, C) of light from N polar angles (radians) at one azimuth."""
    assert setup.fresnel is not None
    scratch = surface(setup, tolerance)
    rows = [blur.albedo(scratch, setup.fresnel, setup.values["psi"], float(t), phi_i) for t in theta_i]
    return np.array(rows)
