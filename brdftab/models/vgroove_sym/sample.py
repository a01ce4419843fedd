"""Sampling of the symmetric V-groove: one ray through one groove of perfect mirrors, exact at all orders.

A point of the macro-surface is uniform; the groove that it belongs to has its left facet s ~ D(s) cos(theta_s), and
where the ray crosses the groove's opening is uniform. The ray is then followed to its end.
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
    unit,
)
from brdftab.models.resolve import Setup
from brdftab.models.vgroove_sym import kernel
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
    ways = reflect_in_grooves(setup, unit(theta_i, phi_i), u, v, np.hypot(u, v), rng.random(n))
    return angles(ways)


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) of `sample`, 1/sr: f cos(theta_o) with F = 1; infinite at the mirror direction itself.

    Arguments as in `brdftab.pdf`, each (N,).
    """
    return mirror_pdf(kernel, setup, theta_i, theta_o, phi, phi_i)
