"""Sampling of smith-walk: walks with heights (Heitz et al. 2016).

Directions follow f |cos(theta_o)| of F = 1 exactly (of a dielectric: of its own F), all bounces included. Their density
has no closed form: `pdf` approximates it, and the weight of a sample is the throughput of its walk.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.random_walk.drawing import density, draw
from brdftab.models.resolve import Setup
from brdftab.typing import Array


def walk(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """Draw `n` outgoing directions; returns theta_o, phi_o, valid (n,) and weight (n, C), see `walk.drawing.draw`."""
    return draw(setup, True, theta_i, phi_i, n, rng)


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions; returns theta_o, phi_o and valid, each (n,), see `walk.drawing.draw`."""
    return draw(setup, True, theta_i, phi_i, n, rng)[:3]


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return an approximate density (N,), 1/sr, see `walk.drawing.density`; arguments as in `brdftab.pdf`."""
    return density(setup, True, theta_i, theta_o, phi, phi_i)
