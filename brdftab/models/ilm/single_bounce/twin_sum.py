"""The sum that the twin takes, compiled: single bounces with the body integral at fixed nodes."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import GAUSSIAN, SEPARABLE
from brdftab.models._shared.facets.gaussian import gaussian_norm
from brdftab.models._shared.fresnel.interface import body_factor
from brdftab.models.ilm.single_bounce.body import integrand
from brdftab.models.ilm.single_bounce.points import masked, specular
from brdftab.models.ilm.single_bounce.twin_nodes import polar_nodes
from brdftab.models.resolve import Setup


@parallel_kernel
def _bodies(theta_i, theta_o, phi, phi_i, cavity, ndf, ax, ay, n, nodes, out):
    """Fill out (N,) with I (1/sr), unmasked with Smith, of nodes (radius, cosine, sine, weight)."""
    norm = gaussian_norm(ax) if ndf == GAUSSIAN and ax > 0.0 else 1.0
    radius, cosine, sine, weight = nodes
    for k in numba.prange(theta_i.size):
        out[k] = 0.0
        ci, co = math.cos(theta_i[k]), math.cos(theta_o[k])
        if min(ci, co) <= HORIZON:
            continue
        ti, to = math.sin(theta_i[k]) / ci, math.sin(theta_o[k]) / co
        ix, iy = ti * math.cos(phi_i[k]), ti * math.sin(phi_i[k])
        ox, oy = to * math.cos(phi_i[k] + phi[k]), to * math.sin(phi_i[k] + phi[k])
        total = 0.0
        for q in range(radius.size):
            w, x, y = weight[q], ax * radius[q], ay * radius[q]
            if ndf == GAUSSIAN and ax > 0.0:
                tilt = math.sqrt(2.0) * ax * radius[q]
                if tilt >= 0.5 * math.pi:
                    continue
                w *= norm * math.sin(tilt) / tilt
                x = y = math.tan(tilt)
            total += w * integrand(x * cosine[q], y * sine[q], n, ix, iy, ci, ox, oy, co, cavity)
        out[k] = total / math.pi


@kernel
def _mask(theta_i, theta_o, phi, phi_i, ndf, ax, ay, out):
    """Multiply out (N,) by Smith's masking of both directions."""
    for k in range(theta_i.size):
        if out[k] > 0.0 and ax > 0.0:
            si, ci, so, co = math.sin(theta_i[k]), math.cos(theta_i[k]), math.sin(theta_o[k]), math.cos(theta_o[k])
            out[k] *= masked(SEPARABLE, ndf, ax, ay, si, ci, so, co, phi[k], phi_i[k])


def points(
    setup: Setup, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray, tolerance: float
) -> np.ndarray:
    """Evaluate single bounces (N, C) in 1/sr with the twin's nodes for a tolerance; angles (N,) in radians."""
    assert setup.fresnel is not None
    angles = (theta_i, theta_o, phi, phi_i)
    out = specular(setup, *angles)
    cavity = setup.values["masking"] == "torrance-sparrow"
    surface = (setup.ndf, setup.alpha_x, setup.alpha_y)
    nodes = polar_nodes(setup.ndf, tolerance)
    kd, indices = (np.broadcast_to(v, len(setup.channels)) for v in (setup.values["kd"], setup.fresnel.a))
    for c, (k, n) in enumerate(zip(kd, indices, strict=True)):
        body = np.empty(theta_i.size)
        _bodies(*angles, cavity, *surface, n, nodes, body)
        if not cavity:
            _mask(*angles, *surface, body)
        out[:, c] += body_factor(k, n) * body
    return out
