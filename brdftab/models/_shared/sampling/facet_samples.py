"""Sampling of single bounces with Smith masking: normals as the light sees them, then the mirror law.

Beckmann after Heitz and d'Eon (2014), GGX after Heitz (2018), Phong from D cos(theta_m). The density uses the exact
Lambda of the distribution also where the model's masking is another (separable, height-correlated or Walter's
rational fit): that difference is in the weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.codes import PHONG
from brdftab.models._shared.sampling.sampling import (
    angles,
    facet_pdf,
    half_vectors,
    masked,
    reflect,
    unit,
    visible_normals,
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
    return angles(reflect(i, visible_normals(setup, i, n, rng)))


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) of `sample`, 1/sr: D_vis(h) / (4 i.h), or D(h) h_z / (4 i.h) for Phong.

    The factor 1 / (4 i.h) is |dh/do| of the mirror law. It integrates to 1 minus the share of invalid samples.
    Arguments as in `brdftab.pdf`, each (N,).
    """
    i, _, h, i_h = half_vectors(theta_i, theta_o, phi, phi_i)
    return masked(facet_pdf(setup, i, h, visible=setup.ndf != PHONG) / (4.0 * i_h), theta_i, theta_o)
