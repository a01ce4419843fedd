"""Half vectors that reflect light upwards: nodes and weights of integrals over all views."""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.typing import Array

# shares of the largest tilt of a half vector at which it is split
CUTS = np.array([0.0, 0.5, 0.75, 0.9, 0.97, 1.0])


@kernel
def reflecting_half_vectors(
    theta_i: float, azimuth: Array, weight_a: Array, scales: Array, x: Array, w: Array, found: Array
) -> int:
    """Write theta_o, phi and weight of all half vectors that reflect the light upwards, and return how many."""
    si, ci, count, own = math.sin(theta_i), math.cos(theta_i), 0, scales.size
    edges = np.empty(own + CUTS.size + 2)
    for a in range(azimuth.size):
        ca, sa = math.cos(azimuth[a]), math.sin(azimuth[a])
        tilt = math.atan2(si * ca, ci)
        top = 0.5 * (0.5 * math.pi + tilt)
        edges[:own] = scales
        edges[own : own + CUTS.size] = top * CUTS
        edges[-2], edges[-1] = tilt, 0.5 * tilt
        edges = np.sort(np.minimum(np.maximum(edges, 0.0), top))
        for panel in range(edges.size - 1):
            width = edges[panel + 1] - edges[panel]
            if width <= 0.0:
                continue
            for k in range(x.size):
                theta_h = edges[panel] + width * x[k]
                sh, ch = math.sin(theta_h), math.cos(theta_h)
                i_h = si * ca * sh + ci * ch
                # o = 2 (i.h) h - i in the light's frame
                ox, oy, oz = 2.0 * i_h * sh * ca - si, 2.0 * i_h * sh * sa, 2.0 * i_h * ch - ci
                weight = weight_a[a] * width * w[k] * 4.0 * i_h * sh * oz
                if i_h > 0.0 and oz > 0.0 and weight > 0.0:
                    found[0, count] = math.atan2(math.sqrt(ox * ox + oy * oy), oz)
                    found[1, count] = math.atan2(oy, ox)
                    found[2, count] = weight
                    count += 1
    return count
