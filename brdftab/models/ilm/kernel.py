"""Interfaced Lambertian microfacets at listed pairs of directions: single bounces and interreflections."""

from __future__ import annotations

import numpy as np

from brdftab.models._shared.facets.flat import mirror_reflectance
from brdftab.models.ilm.albedo import smooth_albedo
from brdftab.models.ilm.interreflection.energy import energy_left_out
from brdftab.models.ilm.interreflection.points import points_interreflection
from brdftab.models.ilm.interreflection.points import specular_setup as singular_setup
from brdftab.models.ilm.single_bounce.points import parts, specular
from brdftab.models.ilm.single_bounce.table import prepare
from brdftab.models.ilm.single_bounce.twin_sum import points as at_twin_nodes
from brdftab.models.resolve import Setup

__all__ = [
    "at_twin_nodes",
    "energy_left_out",
    "mirror_reflectance",
    "points",
    "prepare",
    "singular_setup",
    "smooth_albedo",
    "specular_points",
]


def specular_points(
    setup: Setup, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray, tolerance: float
) -> np.ndarray:
    """Return what `smooth_albedo` leaves to points (N, C) in 1/sr; angles (N,) in radians.

    Mirror reflections of single bounces, and with a grain those of several.
    """
    angles = (theta_i, theta_o, phi, phi_i)
    single = specular(setup, *angles)
    if setup.max_bounces == 1 or setup.isotropic:
        return single
    return single + points_interreflection(setup, *angles, tolerance)[1]


def points(
    setup: Setup,
    theta_i: np.ndarray,
    theta_o: np.ndarray,
    phi: np.ndarray,
    phi_i: np.ndarray,
    *,
    orders: int,
    tolerance: float,
) -> np.ndarray:
    """Evaluate at N pairs of directions.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    theta_i, theta_o, phi, phi_i : ndarray (N,)
        Radians.
    orders : int
        0 for the total, else the components: specular, body and, unless bounces = 1, interreflection.
    tolerance : float
        Relative error asked of the body integral. The specular part is exact; that of a flat surface (sigma = 0) has
        no value: `mirror_reflectance` tells it.

    Returns
    -------
    ndarray (N, P, C)
        BRDF in 1/sr.
    """
    angles = (theta_i, theta_o, phi, phi_i)
    specular, matte, _ = parts(setup, angles, tolerance)
    layers = [specular, matte]
    if setup.max_bounces != 1:
        mutual, mirrored = points_interreflection(setup, *angles, tolerance)
        layers = [specular + mirrored, matte, mutual]
    if not orders:
        return sum(layers[1:], start=layers[0])[:, None]
    return np.stack(layers, axis=1)
