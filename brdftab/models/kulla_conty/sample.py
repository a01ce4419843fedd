"""Sampling: the single bounce, or with the share of energy that it misses a cosine lobe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.sampling import facet_samples
from brdftab.models._shared.sampling.sampling import cosine_hemisphere, cosine_pdf
from brdftab.models.kulla_conty.compensation import lacking
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# both lobes keep at least this share, so that no weight runs away
_LEAST = 0.02


def _share(setup: Setup, theta_i: Array) -> Array:
    """Return the share (N,) of samples from the cosine lobe."""
    return np.clip(lacking(setup, theta_i), _LEAST, 1.0 - _LEAST)


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions; arguments and results as in `facet_samples.sample`."""
    wide = rng.random(n) < float(_share(setup, np.array([theta_i]))[0])
    narrow = facet_samples.sample(setup, theta_i, phi_i, n, rng)
    broad = cosine_hemisphere(n, rng)
    theta_o, phi_o, valid = (np.where(wide, b, a) for a, b in zip(narrow, broad, strict=True))
    return theta_o, phi_o, valid.astype(bool)


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) of `sample`, 1/sr; arguments as in `brdftab.pdf`, each (N,)."""
    share = _share(setup, theta_i)
    lobe = np.where(theta_i < 0.5 * np.pi, cosine_pdf(theta_o), 0.0)
    return (1.0 - share) * facet_samples.pdf(setup, theta_i, theta_o, phi, phi_i) + share * lobe
