"""Directional albedo of the interreflections, and what a cap of the bounces leaves out of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from brdftab import models
from brdftab.models._shared.codes import GAUSSIAN
from brdftab.models.ilm.interreflection.anisotropic import Cavities
from brdftab.models.ilm.interreflection.exchange import unit_rule
from brdftab.models.ilm.interreflection.isotropic import Modes
from brdftab.models.ilm.interreflection.points import specular_setup
from brdftab.models.ilm.interreflection.rule import rule
from brdftab.models.resolve import Setup, resolve
from brdftab.typing import Array

# polar angles and azimuths of the integral over views; albedos come out to about 1e-4
POLAR, AROUND = 24, 24
COARSE = 1e-2


def albedo_of_bodies(setup: Setup, theta: Array, tolerance: float = 1e-3) -> Array:
    """Return the albedo (T, C) of the paths of two and more hits of which one is a body, for light at azimuth 0.

    Parameters
    ----------
    setup : Setup
        With bounces 2 or inf.
    theta : ndarray (T,)
        Polar angles of the light, radians in [0, pi/2).
    tolerance : float
        Chooses the resolution of isotropic surfaces.
    """
    out = np.zeros((theta.size, len(setup.channels)))
    if max(setup.alpha_x, setup.alpha_y) == 0.0 or not np.any(setup.values["kd"]):
        return out
    x, w = unit_rule(POLAR)
    # theta_o = pi/2 (1 - x^2) crowds towards the horizon
    view, weight = 0.5 * math.pi * (1.0 - x * x), math.pi * x * w
    weight = weight * 2.0 * math.pi * np.cos(view) * np.sin(view)
    if setup.isotropic:
        # only the mean over the azimuth counts
        modes = Modes(setup, replace(rule(tolerance), modes=2)).table(theta, view)
        out += np.einsum("ioc,o->ic", modes[0], weight)
        return out
    around = 2.0 * math.pi * (np.arange(AROUND) + 0.5) / AROUND
    views = np.stack(np.meshgrid(view, around, indexing="ij"), -1).reshape(-1, 2)
    lights = np.stack([theta, np.zeros_like(theta)], axis=1)
    values = Cavities(setup, rule(max(tolerance, COARSE))).table(lights, views)
    out += np.einsum("ioc,o->ic", values, np.repeat(weight / AROUND, AROUND))
    return out


def albedo_of_mirrors(setup: Setup, theta: Array) -> Array:
    """Return the albedo (T, C) of the purely specular paths of two and more bounces, for light at azimuth 0.

    In half vectors, d omega_o = 4 (i.h) d omega_h, where nothing is singular.
    """
    out = np.zeros((theta.size, len(setup.channels)))
    groove = specular_setup(setup)
    if groove is None:
        return out
    for k, angle in enumerate(theta):
        tilt, a, weight = _half_vectors(max(setup.alpha_x, setup.alpha_y), float(angle))
        si, ci, hx, hy, hz = (
            math.sin(angle),
            math.cos(angle),
            np.sin(tilt) * np.cos(a),
            np.sin(tilt) * np.sin(a),
            np.cos(tilt),
        )
        i_h = si * hx + ci * hz
        ox, oy, oz = 2.0 * i_h * hx - si, 2.0 * i_h * hy, 2.0 * i_h * hz - ci
        keep = (i_h > 0.0) & (oz > 0.0)
        view, phi = np.arctan2(np.hypot(ox, oy), oz)[keep], np.arctan2(oy, ox)[keep]
        light = np.full_like(view, angle)
        values = models.kernel("vgroove-sym").points(
            groove, light, view, phi, np.zeros_like(light), orders=1, tolerance=1e-3
        )[:, 1]
        # both halves of the circle are the same
        out[k] += 2.0 * ((4.0 * i_h * oz * weight)[keep, None] * values).sum(axis=0)
    return out


def _half_vectors(alpha: float, theta: float) -> tuple[Array, Array, Array]:
    """Return tilts, azimuths in [0, pi] from the light's, and solid angles of half vectors; views stand above ground.

    Panels end where the first and the last azimuth of a tilt sets, and lie closer there and where facets are likely;
    grazing light sees what turns within its own elevation.
    """
    first, last, low = 0.25 * math.pi - 0.5 * theta, 0.25 * math.pi + 0.5 * theta, 0.5 * math.pi - theta
    steps = 2.0 ** np.arange(-3.0, 4.0)
    ends = np.concatenate(
        [
            [0.0, first, last, 0.5 * theta],
            np.arctan(alpha * steps),
            low * steps,
            first + first * steps,
            last - low * steps,
        ]
    )
    ends = np.unique(np.clip(ends, 0.0, last))
    # 12 nodes leave 2.5e-4 at 89 degrees, 20 3e-5, and 1.2e-4 at 89.8
    x, w = unit_rule(20)
    width = np.diff(ends)
    tilt, wt = (ends[:-1, None] + width[:, None] * x).reshape(-1), (width[:, None] * w).reshape(-1)
    with np.errstate(divide="ignore"):
        limit = math.cos(theta) * (0.5 / np.cos(tilt) - np.cos(tilt)) / (math.sin(theta) * np.sin(tilt))
    top = np.arccos(np.clip(limit, -1.0, 1.0))
    cuts = np.array([0.0, 0.4, 0.7, 0.9, 1.0])
    u, wu = (cuts[:-1, None] + np.diff(cuts)[:, None] * x).reshape(-1), (np.diff(cuts)[:, None] * w).reshape(-1)
    weight = np.outer(wt * np.sin(tilt) * top, wu)
    return np.repeat(tilt, u.size), np.outer(top, u).reshape(-1), weight.reshape(-1)


def energy_left_out(setup: Setup, theta: Array) -> Array | None:
    """Return the albedo (T, C) that a cap of the bounces leaves out, or None where no cavity is followed.

    Parameters
    ----------
    setup : Setup
        Of ilm.
    theta : ndarray (T,)
        Polar angles of the light at azimuth 0, radians in [0, pi/2).
    """
    if setup.max_bounces is None or setup.values["masking"] == "smith" or setup.ndf == GAUSSIAN:
        return None
    free = resolve("ilm", **{**setup.parameters, "bounces": "inf"})
    lost = albedo_of_bodies(free, theta) + albedo_of_mirrors(free, theta)
    if setup.max_bounces == 2:
        lost -= albedo_of_bodies(setup, theta) + albedo_of_mirrors(setup, theta)
    return lost
