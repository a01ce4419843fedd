"""A distant light seen in the cone of reflection (Raymond et al. 2016, Sec. 5.2, with the norm and exact bounds).

The light is widened to K(psi) = (1 - (psi/Psi)^2)^2 over its integral, psi the angle to its direction; a scratch
reflects int rho(p_o, p) cos(p) K dp over the part of the cone t = -t_o that lies inside.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import Fresnel
from brdftab.models.scratch.blur import bin_of, coordinates
from brdftab.models.scratch.shade import add_path, arguments, groups_of_layers
from brdftab.models.scratch.trace import Traced
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array

NODES = 8
# leave 1e-16 at 90 degrees
TERMS = 12


@kernel
def norm(width):
    """Return the integral (sr) of (1 - (psi/width)^2)^2 over the cap of that half angle, up to 90 degrees.

    The series of sin psi under the integral: its closed form loses all digits to cancellation below a degree.
    """
    w2 = width * width
    term, total = 1.0, 0.0
    for k in range(TERMS):
        total += term / ((k + 1.0) * (k + 2.0) * (k + 3.0))
        term *= -w2 / ((2.0 * k + 2.0) * (2.0 * k + 3.0))
    return 2.0 * math.pi * w2 * total


@parallel_kernel
def _lit(theta_l, theta_o, phi, phi_l, width, layers, facts, groups, share, fresnel, weights, gauss, out):
    """Fill out (N, C), 1/sr."""
    bins = share.size
    step = math.pi / bins
    scale = 1.0 / norm(width)
    for n in numba.prange(theta_l.size):
        out[n] = 0.0
        if min(math.cos(theta_l[n]), math.cos(theta_o[n])) <= HORIZON:
            continue
        tl, pl = coordinates(theta_l[n], phi_l[n])
        to, po = coordinates(theta_o[n], phi_l[n] + phi[n])
        along = math.cos(to) * math.cos(tl)
        straight = -math.sin(to) * math.sin(tl)
        # cos(psi) = straight + along cos(p - p_l) >= cos(width)
        reach = (math.cos(width) - straight) / along
        if reach >= 1.0:
            continue
        half = math.acos(max(reach, -1.0))
        low, high = max(pl - half, -0.5 * math.pi), min(pl + half, 0.5 * math.pi)
        k = bin_of(po, bins)
        row, total = np.empty(weights.shape[0]), np.empty(weights.shape[0])
        for j in range(bin_of(low, bins), bin_of(high, bins) + 1):
            a, b = max(low, j * step - 0.5 * math.pi), min(high, (j + 1) * step - 0.5 * math.pi)
            if b <= a:
                continue
            part = 0.0
            for g in range(gauss.shape[1]):
                p = a + (b - a) * gauss[0, g]
                # 1 - cos psi without cancellation
                x = math.sin(0.5 * (p - pl))
                y = math.sin(0.5 * (tl + to))
                psi = 2.0 * math.asin(min(math.sqrt(y * y + along * x * x), 1.0)) / width
                rest = max(1.0 - psi * psi, 0.0)
                part += gauss[1, g] * (b - a) * math.cos(p) * rest * rest
            total[:] = 0.0
            first = math.cos(0.5 * step * (k - j))
            for layer in range(groups.size):
                mass = layers[layer, k, j]
                if mass > 0.0:
                    add_path(fresnel, math.cos(to), groups[layer], facts[layer, :, k, j], mass, first, row, total)
            for c in range(weights.shape[1]):
                for w in range(row.size):
                    out[n, c] += scale * part / (share[k] * share[j]) * total[w] * weights[w, c]


def lit(
    scratch: Traced, fresnel: Fresnel, width: float, theta_l: Array, theta_o: Array, phi: Array, phi_l: Array
) -> Array:
    """Return what N views see of a light (N, C), in 1/sr: radiance over the irradiance on a surface that faces it.

    Parameters
    ----------
    scratch : Traced
        The scratch.
    fresnel : Fresnel
        Its reflectance.
    width : float
        Half angle Psi of the kernel around the light, radians.
    theta_l, phi_l : ndarray (N,)
        Direction of the light, radians.
    theta_o, phi : ndarray (N,)
        Direction of the view, phi = phi_o - phi_l, radians.
    """
    weights = np.ascontiguousarray(fresnel.weights)
    out = np.empty((theta_l.size, weights.shape[1]))
    flux = scratch.layers, scratch.facts, groups_of_layers(), scratch.aperture
    gauss = np.ascontiguousarray(unit_gauss(NODES))
    _lit(theta_l, theta_o, phi, phi_l, width, *flux, arguments(fresnel), weights, gauss, out)
    return out
