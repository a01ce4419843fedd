"""Interreflections of interfaced Lambertian facets in V-cavities, without noise (Meneveaux et al. 2018, Sec. 3.3).

The paper follows paths through the cavity by Monte Carlo. Here light that meets a body at least once is the solution of
the cavity's radiosity (cavity_light.py, cavity_exchange.py), and light that is only mirrored the closed form of the
symmetric V-groove of the registry (Lee et al. 2018).
"""

from __future__ import annotations

import json
from functools import lru_cache

import numpy as np

from brdftab import models
from brdftab.models.ilm.interreflection.anisotropic import Cavities, interpolate_azimuths
from brdftab.models.ilm.interreflection.isotropic import Modes, interpolate, knots, synthesis
from brdftab.models.ilm.interreflection.rule import Rule, rule
from brdftab.models.resolve import Setup, resolve
from brdftab.typing import Array

# pairs of directions up to which each is worked out by itself; more are interpolated
DIRECT = 512
# smaller slopes never send light from facet to facet
SMOOTH = 1e-4


def specular_setup(setup: Setup) -> Setup | None:
    """Return the V-groove whose orders from two on are the purely specular paths, or None where there are none."""
    assert setup.fresnel is not None
    if setup.max_bounces == 1 or max(setup.alpha_x, setup.alpha_y) < SMOOTH or float(np.max(setup.fresnel.a)) <= 1.0:
        return None
    alpha = (
        {"alpha": setup.alpha_x}
        if setup.isotropic
        else {"alpha_x": setup.alpha_x, "alpha_y": max(setup.alpha_y, SMOOTH)}
    )
    ior = [float(n) for n in np.unique(setup.fresnel.a)] if np.ptp(setup.fresnel.a) == 0.0 else setup.fresnel.a.tolist()
    return resolve("vgroove-sym", ndf=setup.parameters["ndf"], **alpha, ior=ior, max_bounces=setup.max_bounces)


def points_specular(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, tolerance: float) -> Array:
    """Return the purely specular paths of two and more bounces (N, C), 1/sr; arguments as `points_interreflection`."""
    out = np.zeros((theta_i.size, len(setup.channels)))
    groove = specular_setup(setup)
    if groove is not None:
        kernel = models.kernel("vgroove-sym")
        out += kernel.points(groove, theta_i, theta_o, phi, phi_i, orders=1, tolerance=tolerance)[:, 1]
    return out


def points_body(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, tolerance: float) -> Array:
    """Return the paths of two and more hits of which one is a body (N, C); arguments as `points_interreflection`."""
    if setup.max_bounces == 1 or max(setup.alpha_x, setup.alpha_y) == 0.0 or not np.any(setup.values["kd"]):
        return np.zeros((theta_i.size, len(setup.channels)))
    fine = rule(tolerance)
    if setup.isotropic:
        pairs, at = np.unique(np.stack([theta_i, theta_o], axis=1), axis=0, return_inverse=True)
        if len(pairs) <= DIRECT:
            modes = Modes(setup, fine).table(pairs[:, 0], pairs[:, 1], paired=True)
            return np.einsum("mnc,mn->nc", modes[:, at.reshape(-1)], synthesis(phi, fine.modes))
        return interpolated(setup, theta_i, theta_o, phi, phi_i, fine)
    light, view = np.stack([theta_i, phi_i], axis=1), np.stack([theta_o, phi_i + phi], axis=1)
    if theta_i.size <= DIRECT:
        return Cavities(setup, fine).table(light, view, paired=True)
    lights, i = np.unique(light, axis=0, return_inverse=True)
    views, o = np.unique(view.round(14), axis=0, return_inverse=True)
    if len(lights) * len(views) <= 4 * theta_i.size and len(lights) + len(views) <= 2 * DIRECT:
        return Cavities(setup, fine).table(lights, views)[i.reshape(-1), o.reshape(-1)]
    return interpolated(setup, theta_i, theta_o, phi, phi_i, fine)


def interpolated(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, fine: Rule) -> Array:
    """Return `points_body` at many unrelated directions by interpolation, to the error of the rule."""
    out = np.empty((theta_i.size, len(setup.channels)))
    values = _interpolant(json.dumps(setup.parameters), fine)
    if setup.isotropic:
        interpolate(values, theta_i, theta_o, phi, out)
    else:
        interpolate_azimuths(values, theta_i, theta_o, phi_i, phi_i + phi, out)
    return out


@lru_cache(maxsize=4)
def _interpolant(parameters: str, fine: Rule) -> Array:
    """Return what `interpolate` or `interpolate_azimuths` reads, for the parameters of a setup as JSON."""
    setup = resolve("ilm", **json.loads(parameters))
    if not setup.isotropic:
        return Cavities(setup, fine).interpolant()
    theta = knots(fine.knots)
    return np.ascontiguousarray(Modes(setup, fine).table(theta, theta).transpose(1, 2, 0, 3))


def points_interreflection(
    setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, tolerance: float
) -> tuple[Array, Array]:
    """Return what more than one hit in the cavity adds to the BRDF.

    Parameters
    ----------
    setup : Setup
        Of ilm with Torrance-Sparrow masking; bounces 1 give zeros.
    theta_i, theta_o, phi, phi_i : ndarray (N,)
        Radians, phi = phi_o - phi_i.
    tolerance : float
        Relative error asked of the whole BRDF; below 1e-5 the error stays near 1e-5 (docs/ilm-interreflections.md).

    Returns
    -------
    tuple of ndarray (N, C)
        In 1/sr: paths with at least one body among two or more hits, and purely specular paths of two or more.
    """
    ti, to, p, az = (np.ascontiguousarray(a, dtype=np.float64) for a in (theta_i, theta_o, phi, phi_i))
    return points_body(setup, ti, to, p, az, tolerance), points_specular(setup, ti, to, p, az, tolerance)
