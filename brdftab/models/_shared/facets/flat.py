"""Flat interfaces over a matte body: their mirror reflection is a delta, which no value in 1/sr holds.

f = body + R(theta_i) delta(omega_o - omega_m)/cos(theta_i), omega_m the mirror direction and R = F(cos theta_i).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# below this roughness float64 does not resolve the half vectors that carry the highlight: at 1e-9 the albedo is good to
# 3e-7 at 89 degrees and to 2e-5 at 89.99, at 1e-12 it is off by 1e-5 at 85 degrees, at 1e-50 the highlight is lost
FINEST = 1e-9


def resolvable(setup: Setup) -> Setup:
    """Return the setup with roughnesses that float64 resolves: flat below `FINEST`, at least that along either axis."""
    least, most = sorted((setup.alpha_x, setup.alpha_y))
    if most < FINEST:
        return replace(setup, alpha_x=0.0, alpha_y=0.0)
    if least < FINEST:
        return replace(setup, alpha_x=max(setup.alpha_x, FINEST), alpha_y=max(setup.alpha_y, FINEST))
    return setup


def mirror_reflectance(setup: Setup, theta_i: Array) -> Array:
    """Return the share (N, C) of light from polar angles (N,), radians, that a flat interface sends to the mirror.

    That is Fresnel's F of a dielectric; 0 where facets are tilted (their highlight has values), and from the horizon
    on.
    """
    channels = len(setup.channels)
    cosine = np.cos(np.asarray(theta_i, dtype=np.float64))
    if setup.alpha_x > 0.0 or setup.fresnel is None:
        return np.zeros((cosine.size, channels))
    indices, at = np.unique(setup.fresnel.a, return_inverse=True)
    found = np.array([[reflectance(2, n, 0.0, max(c, 0.0)) for n in indices] for c in cosine])
    found[cosine <= 0.0] = 0.0
    return found.reshape(cosine.size, indices.size)[:, np.broadcast_to(at.reshape(-1), channels)]
