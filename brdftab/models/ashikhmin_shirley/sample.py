"""Sampling: the half vector by its own density p(h), then the mirror law; a cosine lobe for the base's share.

The highlight's weight is F min(1, o_z/i_z), at most F.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.sampling.sampling import angles, cosine_hemisphere, cosine_pdf, reflect, unit
from brdftab.models.ashikhmin_shirley.lobe import densities, normal_reflectance
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# the highlight rises at grazing whatever F(1) is: it keeps a tenth
_MOST = 0.9


def _share(setup: Setup) -> float:
    """Return the share of samples for the base."""
    highlight = normal_reflectance(setup)
    matte = float(np.mean(np.maximum(setup.values["kd"] * (1.0 - highlight), 0.0)))
    return min(matte / (matte + float(np.mean(highlight))), _MOST) if matte > 0.0 else 0.0


def _half_vectors(setup: Setup, n: int, rng: np.random.Generator) -> Array:
    """Draw `n` half vectors (n, 3) with density p(h) (Eqs. 9 and 10, all four quadrants at once)."""
    nu, nv = setup.values["nu"], setup.values["nv"]
    turn = 2.0 * np.pi * rng.random(n)
    azimuth = np.arctan2(np.sqrt(nu + 1.0) * np.sin(turn), np.sqrt(nv + 1.0) * np.cos(turn))
    exponent = nu * np.cos(azimuth) ** 2 + nv * np.sin(azimuth) ** 2
    # h_z^(exponent + 1) is uniform in (0, 1]
    log = np.log1p(-rng.random(n)) / (exponent + 1.0)
    s = np.sqrt(-np.expm1(2.0 * log))
    return np.stack([s * np.cos(azimuth), s * np.sin(azimuth), np.exp(log)], axis=-1)


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions.

    Parameters
    ----------
    setup : Setup
        Read for nu, nv, kd and the reflectance at normal incidence.
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
        False where the mirrored direction lies at or below the horizon.
    """
    narrow = angles(reflect(unit(theta_i, phi_i), _half_vectors(setup, n, rng)))
    share = _share(setup)
    if share == 0.0:
        return narrow
    wide = rng.random(n) < share
    broad = cosine_hemisphere(n, rng)
    theta_o, phi_o, valid = (np.where(wide, b, a) for a, b in zip(narrow, broad, strict=True))
    return theta_o, phi_o, valid.astype(bool)


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) of `sample`, 1/sr; arguments as in `brdftab.pdf`, each (N,)."""
    share = _share(setup)
    lobe = np.where(theta_i < 0.5 * np.pi, cosine_pdf(theta_o), 0.0)
    return (1.0 - share) * densities(setup, theta_i, theta_o, phi, phi_i) + share * lobe
