"""Directions at which models are looked at: corners, either side of the mirror and of the light, the hemisphere."""

from __future__ import annotations

import math

import numpy as np

from brdftab.evaluation.points import singular
from brdftab.models.resolve import Setup
from brdftab.typing import Array

Angles = tuple[Array, Array, Array, Array]
GRAZING = math.radians(89.9)
COUNT = 160
# polar angles of the fixed list, degrees, and how far azimuths stand beside mirror and light, radians
THETAS = (0.0, 1e-8, 45.0, 80.0, 89.999, 90.0)
ASIDE = 1e-9


def directions(setup: Setup, rng: np.random.Generator, count: int = COUNT) -> Angles:
    """Return theta_i, theta_o, phi, phi_i (count,): corners, the whole hemisphere, and the width of the highlight.

    The corners reach from normal incidence to 89.9 degrees and below the horizon; a pair at which a singular model has
    no value is replaced.
    """
    ends = [0.0, 1e-3, 0.6, GRAZING]
    corners = [(i, o, p) for i in ends for o in ends for p in (0.0, 1.3, math.pi)]
    corners += [(0.4, o, 2.0) for o in (0.5 * math.pi, 1.8, math.pi)] + [
        (o, 0.4, 2.0) for o in (0.5 * math.pi, math.pi)
    ]
    rest = count - len(corners)
    assert rest > 60
    ti, to = np.arccos(rng.uniform(math.cos(GRAZING), 1.0, (2, rest)))
    ph, az = rng.uniform(-math.pi, 2.0 * math.pi, rest), rng.uniform(0.0, 2.0 * math.pi, count)
    # half of them: facets of likely slopes, reflected about
    near = rest // 2
    slope = rng.normal(0.0, 1.0, (2, near)) * np.array([[setup.alpha_x], [setup.alpha_y]])
    half = np.stack([-slope[0], -slope[1], np.ones(near)]) / np.sqrt(1.0 + (slope**2).sum(axis=0))
    azimuth = az[len(corners) : len(corners) + near]
    i = np.stack([np.sin(ti[:near]) * np.cos(azimuth), np.sin(ti[:near]) * np.sin(azimuth), np.cos(ti[:near])])
    o = 2.0 * (i * half).sum(axis=0) * half - i
    to[:near] = np.arctan2(np.hypot(o[0], o[1]), o[2])
    ph[:near] = np.arctan2(o[1], o[0]) - azimuth
    angles = [np.concatenate([np.array(c), r]) for c, r in zip(zip(*corners, strict=True), (ti, to, ph), strict=True)]
    ti, to, ph = angles
    bad = singular(setup, ti, to, ph, az)
    to[bad] = 0.3
    ph[bad] = 1.0
    return ti, to, ph, az


def extreme(setup: Setup) -> Angles:
    """Return the fixed list: all pairs of `THETAS`, azimuths at and beside mirror and light; singular ones left out."""
    azimuths = (0.0, ASIDE, 0.5 * math.pi, math.pi - ASIDE, math.pi, math.pi + ASIDE)
    listed = [(math.radians(i), math.radians(o), p) for i in THETAS for o in THETAS for p in azimuths]
    ti, to, phi = np.array(listed).T
    # along either axis, and between
    az = np.tile([0.0, 0.7, 0.5 * math.pi], len(listed) // 3 + 1)[: len(listed)]
    kept = ~singular(setup, ti, to, phi, az)
    return ti[kept], to[kept], phi[kept], az[kept]


def both(setup: Setup, seed: int, thin: int = 1) -> Angles:
    """Return the fixed list and seeded random directions, every `thin`-th of them."""
    rng = np.random.default_rng(seed)
    one, two = extreme(setup), directions(setup, rng)
    joined = [np.ascontiguousarray(np.concatenate([a[::thin], b[::thin]])) for a, b in zip(one, two, strict=True)]
    return joined[0], joined[1], joined[2], joined[3]
