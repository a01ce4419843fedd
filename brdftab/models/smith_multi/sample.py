"""Sampling of smith-multi: position-free walks that leave with probability G1 (Wang et al. 2022, Sec. 4.3).

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
    return draw(setup, False, theta_i, phi_i, n, rng)


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions; returns theta_o, phi_o and valid, each (n,), see `walk.drawing.draw`."""
    return draw(setup, False, theta_i, phi_i, n, rng)[:3]


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return an approximate density (N,), 1/sr, see `walk.drawing.density`; arguments as in `brdftab.pdf`."""
    return density(setup, False, theta_i, theta_o, phi, phi_i)
