"""Sampling of Oren-Nayar's lobe: a cosine-weighted hemisphere; f varies slowly, so the weights stay bounded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.sampling.sampling import cosine_hemisphere, cosine_pdf
from brdftab.models.resolve import Setup
from brdftab.typing import Array


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions with density cos(theta_o) / pi.

    Parameters
    ----------
    setup : Setup
        Unused: the density has no parameter.
    theta_i, phi_i : float
        Unused, radians.
    n : int
        How many.
    rng : numpy.random.Generator
        Source of the uniforms.

    Returns
    -------
    theta_o, phi_o : ndarray (n,)
        Radians; phi_o absolute, in [0, 2 pi).
    valid : ndarray (n,) of bool
        All true.
    """
    return cosine_hemisphere(n, rng)


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return cos(theta_o) / pi (N,), 1/sr, 0 at or below the horizon; arguments as in `brdftab.pdf`, each (N,)."""
    return cosine_pdf(theta_o)
