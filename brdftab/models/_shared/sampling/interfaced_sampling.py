"""Sampling of surfaces with an interface over a matte body: the mirror law at visible normals, or a cosine lobe.

A path is specular with the share R_s/(R_s + R_b) of a flat interface, R_s = r_e and R_b = (1 - r_e)^2 kappa averaged
over channels (Meneveaux et al. 2018, Sec. 4.1), whatever is between facets. The density is that of the mixture, so
weights stay bounded where one lobe covers the other. A flat surface (sigma = 0) has no specular density: these
functions draw its body alone, and `mirror_mass` tells how often to take the mirror direction instead.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdftab.models._shared.codes import GAUSSIAN
from brdftab.models._shared.facets.flat import mirror_reflectance
from brdftab.models._shared.fresnel.interface import body_factor, external_reflectance, transmission
from brdftab.models._shared.sampling.sampling import (
    angles,
    cosine_hemisphere,
    cosine_pdf,
    facet_pdf,
    half_vectors,
    masked,
    normals,
    reflect,
    unit,
    visible_normals,
)
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# interreflections leave in all directions, also from a black body
MOST_SPECULAR = 0.9


def specular_share(setup: Setup) -> float:
    """Return the probability of the specular lobe, in [0, 1]."""
    if setup.alpha_x == 0.0:
        return 0.0
    assert setup.fresnel is not None
    kd, n = np.broadcast_arrays(setup.values["kd"], setup.fresnel.a)
    outside = np.array([external_reflectance(float(x)) for x in n])
    body = np.array([body_factor(float(k), float(x)) for k, x in zip(kd, n, strict=True)]) * (1.0 - outside) ** 2
    total = float(outside.mean() + body.mean())
    share = float(outside.mean()) / total if total > 0.0 else 0.0
    return share if setup.values.get("bounces", "1") == "1" else min(share, MOST_SPECULAR)


def mirror_mass(setup: Setup, theta_i: Array) -> Array:
    """Return the probability (N,) with which light from polar angles (N,), radians, is to take the mirror direction.

    R/(R + B) averaged over channels, B = kappa T(i) (1 - r_e) the albedo of a flat body; 0 where facets are tilted.
    """
    if setup.alpha_x > 0.0:
        return np.zeros(theta_i.size)
    assert setup.fresnel is not None
    mirrored = mirror_reflectance(setup, theta_i).mean(axis=1)
    kd, n = np.broadcast_arrays(setup.values["kd"], setup.fresnel.a)
    body = np.zeros(theta_i.size)
    for k, x in zip(kd.tolist(), n.tolist(), strict=True):
        through = np.array([transmission(x, max(c, 0.0)) for c in np.cos(theta_i)])
        body += body_factor(k, x) * (1.0 - external_reflectance(x)) * through / n.size
    total = mirrored + body
    return np.where(total > 0.0, mirrored / np.where(total > 0.0, total, 1.0), 0.0)


def _most_tilted(sigma: float) -> float:
    """Return the share of a Rayleigh distribution of the tilt that lies below 90 degrees."""
    return -math.expm1(-0.5 * (0.5 * math.pi / sigma) ** 2)


def _tilted_normals(setup: Setup, n: int, rng: np.random.Generator) -> Array:
    """Draw `n` normals (n, 3) of Gaussian facets: the tilt has the density t exp(-t^2/(2 sigma^2)) on (0, pi/2)."""
    sigma = setup.alpha_x
    tilt = sigma * np.sqrt(-2.0 * np.log1p(-rng.random(n) * _most_tilted(sigma)))
    azimuth = 2.0 * np.pi * rng.random(n)
    slope = np.tan(np.minimum(tilt, 0.5 * np.pi * (1.0 - 1e-12)))
    return normals(slope * np.cos(azimuth), slope * np.sin(azimuth))


def _tilted_pdf(sigma: float, h: Array) -> Array:
    """Return the density (N,), 1/sr, of `_tilted_normals` at normals h (N, 3)."""
    sine = np.hypot(h[:, 0], h[:, 1])
    tilt = np.arctan2(sine, h[:, 2])
    over = np.where(sine > 0.0, tilt / np.where(sine > 0.0, sine, 1.0), 1.0)
    return np.exp(-0.5 * (tilt / sigma) ** 2) * over / (2.0 * np.pi * sigma * sigma * _most_tilted(sigma))


def sample(
    setup: Setup, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions.

    Parameters
    ----------
    setup : Setup
        Of a model with `kd` and a dielectric; interreflections are left to the weights.
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
    theta, phi, valid = cosine_hemisphere(n, rng)
    mirrored = rng.random(n) < specular_share(setup)
    count = int(mirrored.sum())
    if count:
        i = unit(theta_i, phi_i)
        m = _tilted_normals(setup, count, rng) if setup.ndf == GAUSSIAN else visible_normals(setup, i, count, rng)
        theta[mirrored], phi[mirrored], valid[mirrored] = angles(reflect(i, m))
    return theta, phi, valid


def pdf(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) of `sample`, 1/sr: the mixture of D_vis(h)/(4 i.h) and cos(theta_o)/pi.

    The factor 1/(4 i.h) is |dh/do| of the mirror law (Eq. 27). It integrates to 1 minus the share of invalid samples.
    Arguments as in `brdftab.pdf`, each (N,).
    """
    share = specular_share(setup)
    density = (1.0 - share) * cosine_pdf(theta_o)
    if share > 0.0:
        i, _, h, i_h = half_vectors(theta_i, theta_o, phi, phi_i)
        facets = _tilted_pdf(setup.alpha_x, h) if setup.ndf == GAUSSIAN else facet_pdf(setup, i, h, visible=True)
        density = density + share * facets / (4.0 * i_h)
    return masked(density, theta_i, theta_o)
