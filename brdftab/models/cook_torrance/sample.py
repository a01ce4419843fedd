"""Sampling of the Cook-Torrance model: normals of the V-cavity as the light sees them, then the mirror law.

Heitz and d'Eon (2014), Algorithm 3: a point of the surface picks a cavity by its facet m ~ D cos(theta_m); of that
facet and its mirrored twin the light meets one in proportion to the projected areas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.sampling.sampling import (
    angles,
    facet_pdf,
    facet_slopes,
    half_vectors,
    masked,
    normals,
    reflect,
    unit,
)
from brdftab.models.resolve import Setup
from brdftab.typing import Array


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions.

    Parameters
    ----------
    setup : Setup
        Read for ndf, alpha_x and alpha_y.
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
        False where the mirrored direction lies at or below the horizon: light that a second bounce would carry.
    """
    i = unit(theta_i, phi_i)
    m = normals(*facet_slopes(setup, n, rng))
    twin = m * np.array([-1.0, -1.0, 1.0])
    shown, hidden = np.maximum(m @ i, 0.0), np.maximum(twin @ i, 0.0)
    swap = rng.random(n) * (shown + hidden) >= shown
    return angles(reflect(i, np.where(swap[:, None], twin, m)))


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) of `sample`, 1/sr: G1 D(h) / (4 i_z), G1 = min(1, 2 h_z i_z / i.h).

    It integrates to 1 minus the share of invalid samples. Arguments as in `brdftab.pdf`, each (N,).
    """
    i, _, h, i_h = half_vectors(theta_i, theta_o, phi, phi_i)
    # D h_z times the visible part of both facets: i.h / (h_z i_z) capped at 2
    share = np.minimum(i_h / np.maximum(h[:, 2] * i[:, 2], 1e-300), 2.0)
    return masked(facet_pdf(setup, i, h, visible=False) * share / (4.0 * i_h), theta_i, theta_o)
