"""Sampling of a traced scratch: exit bin by its flux, position in it by the cosine, angle along by the blur."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.sampling.sampling import PDF_TOLERANCE
from brdftab.models.resolve import Setup
from brdftab.models.scratch.cone_samples import density, draw
from brdftab.models.scratch.surface import surface
from brdftab.typing import Array


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions in proportion to what mirror walls would send there.

    Parameters
    ----------
    setup : Setup
        Of the model scratch.
    theta_i, phi_i : float
        The light, radians.
    n : int
        How many.
    rng : numpy.random.Generator
        Source of the uniforms.

    Returns
    -------
    theta_o, phi_o : ndarray (n,)
        Radians; phi_o absolute, in [0, 2 pi).
    valid : ndarray (n,) of bool
        False where the blur leads beyond the scratch's direction.
    """
    return draw(surface(setup, PDF_TOLERANCE), setup.values["psi"], theta_i, phi_i, n, rng)


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) in 1/sr of `sample`; arguments as in `brdftab.pdf`, each (N,)."""
    return density(surface(setup, PDF_TOLERANCE), setup.values["psi"], theta_i, theta_o, phi, phi_i)
