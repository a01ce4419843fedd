"""Fixed nodes for the body integral: what the twin sums."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from brdftab.models._shared.codes import GGX
from brdftab.quadrature import gauss

# radial nodes and azimuths, by the relative error asked
COUNTS = ((1e-2, 3, 8), (1e-3, 8, 16), (1e-4, 16, 32), (1e-5, 32, 64), (0.0, 64, 128))
GGX_COUNTS = ((1e-2, 6, 12), (1e-3, 12, 24), (1e-4, 24, 48), (1e-5, 48, 96), (0.0, 96, 192))


MOST_NODES = {0: 64 * 128, 1: 96 * 192, 3: 64 * 128}


@cache
def radial_nodes(ndf: int, tolerance: float) -> tuple[np.ndarray, int]:
    """Return squared stretched radii and weights (2, K), and the number of azimuths, for a tolerance.

    Beckmann (and the Gaussian, whose tilt is sqrt(2) sigma times the radius): Gauss-Laguerre in the squared radius.
    GGX: Gauss-Legendre in the arc tangent of the radius. Weights sum to 1.
    """
    count, steps = next((k, m) for least, k, m in (GGX_COUNTS if ndf == GGX else COUNTS) if tolerance >= least)
    if ndf == GGX:
        x, w = gauss(count)
        angle = 0.25 * math.pi * (1.0 + x)
        weight = w * np.sin(2.0 * angle)
        nodes = np.stack([np.tan(angle) ** 2, weight / weight.sum()])
    else:
        x, w = np.polynomial.laguerre.laggauss(min(count, 64))
        nodes = np.stack([x, w])[:, w > 1e-18 * w.max()]
    nodes.setflags(write=False)
    return nodes, steps


@cache
def polar_nodes(ndf: int, tolerance: float) -> tuple[np.ndarray, ...]:
    """Return radius, cosine and sine of the azimuth, and weight of all nodes, each (Q,); odd rings are turned."""
    nodes, steps = radial_nodes(ndf, tolerance)
    azimuth = 2.0 * math.pi * (np.arange(steps) + 0.5 * (np.arange(nodes.shape[1]) % 2)[:, None]) / steps
    radius = np.broadcast_to(np.sqrt(nodes[0])[:, None], azimuth.shape).reshape(-1)
    weight = np.broadcast_to(nodes[1][:, None] / steps, azimuth.shape).reshape(-1)
    return radius.copy(), np.cos(azimuth).reshape(-1), np.sin(azimuth).reshape(-1), weight.copy()
