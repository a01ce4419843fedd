"""Directional albedo of what is smooth: bodies of single bounces on a product rule, and all interreflections.

Quadratures over half vectors, which the glossy part needs, would spend most of their nodes where the body is flat.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.models._shared.facets.masking import smith_lambda
from brdftab.models._shared.fresnel.interface import body_factor
from brdftab.models.ilm.interreflection.energy import albedo_of_bodies, albedo_of_mirrors
from brdftab.models.ilm.interreflection.points import points_interreflection
from brdftab.models.ilm.single_bounce.many_points import Bodies
from brdftab.models.ilm.single_bounce.points import parts
from brdftab.models.ilm.single_bounce.table import CAVITY_LEVELS, SMITH_LEVELS
from brdftab.models.resolve import Setup
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array

# polar angles and azimuths of the view; albedos come out to about 1e-4
POLAR, AROUND = 32, 24
# azimuths of bodies with a grain: 1.1e-5 of the albedo at roughnesses up to a thousand times apart, 24 leave 1.1e-4
AZIMUTHS = 48


def smooth_albedo(setup: Setup, theta: float, phi: float, tolerance: float) -> Array | None:
    """Return the albedo (C,) of everything but `specular_points`, or None where only points serve.

    Parameters
    ----------
    setup : Setup
        Of ilm.
    theta : float
        Polar angle of the light, radians in [0, pi/2).
    phi : float
        Its azimuth, radians.
    tolerance : float
        Relative error asked; the rule itself ends near 1e-4.
    """
    if setup.alpha_x == 0.0 or tolerance < 9e-5:
        return None
    if not setup.isotropic:
        return _all_around(setup, theta, phi, tolerance)
    found = _single(setup, theta, tolerance)
    if setup.max_bounces != 1:
        light = np.array([theta])
        found = found + (albedo_of_bodies(setup, light, min(tolerance, 1e-4)) + albedo_of_mirrors(setup, light))[0]
    return found


def _views() -> tuple[Array, Array]:
    """Return polar angles of the view, crowded towards the horizon, and their weights times cosine and sine."""
    x, w = unit_gauss(POLAR)
    view = 0.5 * math.pi * (1.0 - x * x)
    return view, math.pi * x * w * np.cos(view) * np.sin(view)


def _all_around(setup: Setup, theta: float, phi: float, tolerance: float) -> Array:
    """Return the albedo (C,) of bodies with a grain and of light between facets, point by point."""
    view, weight = _views()
    steps = 2.0 * math.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    to, dp = (a.reshape(-1) for a in np.meshgrid(view, steps, indexing="ij"))
    angles = (np.full_like(to, theta), to, dp, np.full_like(to, phi))
    values = parts(setup, angles, tolerance)[1]
    if setup.max_bounces != 1:
        values = values + points_interreflection(setup, *angles, tolerance)[0]
    return 2.0 * math.pi / AZIMUTHS * np.einsum("v,vac->c", weight, values.reshape(POLAR, AZIMUTHS, -1))


def _single(setup: Setup, theta: float, tolerance: float) -> Array:
    """Return the albedo (C,) of the bodies of single bounces."""
    assert setup.fresnel is not None
    view, weight = _views()
    a, wa = unit_gauss(AROUND)
    cavity = setup.values["masking"] == "torrance-sparrow"
    levels = CAVITY_LEVELS if cavity else tuple((least, (*fine, 0, 0), rough) for least, fine, rough in SMITH_LEVELS)
    sizes = next(fine for least, fine, _ in levels if tolerance >= 0.999 * least or least == levels[-1][0])
    if not cavity:
        masks = [1.0 / (1.0 + smith_lambda(setup.ndf, setup.alpha_x, math.tan(t), False)) for t in (theta, *view)]
        weight = weight * masks[0] * np.array(masks[1:])
    channels = len(setup.channels)
    indices = np.broadcast_to(setup.fresnel.a, channels)
    found = np.zeros(channels)
    surface = (setup.ndf, cavity, setup.alpha_x)
    for n in np.unique(indices):
        axes = (np.array([theta]), np.ascontiguousarray(view), np.ascontiguousarray(math.pi * a))
        bodies = Bodies(*surface, float(n), *axes, sizes, tolerance).block(0, 1, view.size, False)[0]
        # pi I, twice the half circle
        found[indices == n] = 2.0 * float(weight @ (bodies @ wa))
    kd = np.broadcast_to(setup.values["kd"], channels)
    return found * np.array([body_factor(float(k), float(n)) for k, n in zip(kd, indices, strict=True)])
