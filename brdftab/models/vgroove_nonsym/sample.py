"""Sampling of the nonsymmetric V-groove: one ray through one groove of perfect mirrors, exact at all orders.

Facets are independent with g(x) = D(x) sin^2(x), so grooves number g(l) g(r) and cover g(l) g(r) (cot l + cot r) of
the macro-surface (height 1). The first term is D cos sin of the left tilt times P of the right one, the second is
its mirror image; as the azimuth's law has period pi, exchanging the facets and turning the groove by pi carries the
second into the first. So: left facet ~ D cos(theta), right tilt ~ P, ray uniform over the opening.
The density of the outgoing direction is therefore f cos(theta_o) of the model with F = 1, which carries the
Jacobian |ds/do| and the sum over facets and orders that Lee et al. (2018), Section 6 leave out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.sampling.sampling import (
    angles,
    facet_slopes,
    mirror_pdf,
    reflect_in_grooves,
    tangents_beside,
    unit,
)
from brdftab.models.resolve import Setup
from brdftab.models.vgroove_nonsym import kernel
from brdftab.typing import Array


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions.

    Parameters
    ----------
    setup : Setup
        Read for ndf, alpha_x, alpha_y and max_bounces.
    theta_i, phi_i : float
        Direction towards the light, radians.
    n : int
        How many.
    rng : numpy.random.Generator
        Source of the uniforms.

    Returns
    -------
    theta_o, phi_o : ndarray (n,)
        Radians; phi_o absolute, in [0, 2 pi).
    valid : ndarray (n,) of bool
        False where the path has more bounces than `max_bounces`; all true without that cap.
    """
    u, v = facet_slopes(setup, n, rng)
    # alpha along the groove's azimuth: 1/alpha^2 = cos^2/alpha_x^2 + sin^2/alpha_y^2
    alpha = np.hypot(u, v) / np.maximum(np.hypot(u / setup.alpha_x, v / setup.alpha_y), 1e-300)
    beside = alpha * tangents_beside(setup, n, rng)
    ways = reflect_in_grooves(setup, unit(theta_i, phi_i), u, v, beside, rng.random(n))
    return angles(ways)


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) of `sample`, 1/sr: f cos(theta_o) with F = 1; infinite at the mirror direction itself.

    Arguments as in `brdftab.pdf`, each (N,).
    """
    return mirror_pdf(kernel, setup, theta_i, theta_o, phi, phi_i)
