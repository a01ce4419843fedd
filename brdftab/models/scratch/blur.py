"""The BRDF of a traced scratch at pairs of directions, its cone of reflection blurred to a finite width.

f = rho(p_o, p_i; t) k(t_i + t_o) s(t_i) s(t_o) with k(x) = 15/(16 psi) (1 - (x/psi)^2)^2 is reciprocal and keeps the
energy of the cone; s is 1/cos t up to O(psi^2) and bends away near the horizon (`balance`). Fresnel acts at
t = (t_i - t_o)/2, which is the cone's own angle on the cone.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import Fresnel
from brdftab.models.scratch.balance import balanced, strength, strengths
from brdftab.models.scratch.shade import add_path, arguments, groups_of_layers
from brdftab.models.scratch.shoot import CLASSES
from brdftab.models.scratch.trace import Traced
from brdftab.quadrature import gauss
from brdftab.typing import Array

# Gauss nodes over the kernel's width
NODES = 24


@kernel
def kernel_value(x, psi):
    """Return the blur (1/rad) at distance x from the cone; its integral is 1."""
    u = x / psi
    if abs(u) >= 1.0:
        return 0.0
    rest = 1.0 - u * u
    return 0.9375 / psi * rest * rest


@kernel
def coordinates(theta, azimuth):
    """Return the angles along and across the scratch (t, p) of a direction, radians."""
    sine = math.sin(theta)
    t = math.asin(min(max(sine * math.cos(azimuth), -1.0), 1.0))
    return t, math.atan2(sine * math.sin(azimuth), math.cos(theta))


@kernel
def bin_of(p, bins):
    """Return the bin of an angle across the scratch."""
    return min(max(int((p / math.pi + 0.5) * bins), 0), bins - 1)


@parallel_kernel
def _points(theta_i, theta_o, phi, phi_i, psi, table, layers, facts, groups, share, fresnel, weights, out):
    """Fill out (N, P, C): all orders together (P = 1) or apart."""
    bins = share.size
    parts = out.shape[1]
    for n in numba.prange(theta_i.size):
        out[n] = 0.0
        if min(math.cos(theta_i[n]), math.cos(theta_o[n])) <= HORIZON:
            continue
        ti, pi = coordinates(theta_i[n], phi_i[n])
        to, po = coordinates(theta_o[n], phi_i[n] + phi[n])
        blur = kernel_value(ti + to, psi)
        if blur == 0.0:
            continue
        k, j = bin_of(po, bins), bin_of(pi, bins)
        row, total = np.empty(weights.shape[0]), np.zeros((parts, weights.shape[0]))
        along = math.cos(0.5 * (ti - to))
        first = math.cos(0.5 * math.pi / bins * (k - j))
        for layer in range(groups.size):
            mass = layers[layer, k, j]
            if mass > 0.0:
                part = 0 if parts == 1 else (layer + CLASSES - 1) // CLASSES
                add_path(fresnel, along, groups[layer], facts[layer, :, k, j], mass, first, row, total[part])
        scale = blur * strength(ti, psi, table) * strength(to, psi, table) / (share[k] * share[j])
        for part in range(parts):
            for c in range(weights.shape[1]):
                for w in range(row.size):
                    out[n, part, c] += scale * total[part, w] * weights[w, c]


def points(
    scratch: Traced, fresnel: Fresnel, psi: float, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, parts: int
) -> Array:
    """Return f (N, P, C) in 1/sr at N pairs of directions (radians), P = 1 for all orders, 5 for each apart."""
    out = np.empty((theta_i.size, parts, fresnel.weights.shape[1]))
    weights = np.ascontiguousarray(fresnel.weights)
    flux = scratch.layers, scratch.facts, groups_of_layers(), scratch.aperture
    _points(theta_i, theta_o, phi, phi_i, psi, balanced(psi), *flux, arguments(fresnel), weights, out)
    return out


def cone(t_i: float, psi: float) -> tuple[Array, Array]:
    """Return angles t_o along the scratch and weights: the blurred cone of light at t_i, 1 in all."""
    low, high = max(-t_i - psi, -0.5 * math.pi), min(-t_i + psi, 0.5 * math.pi)
    x, w = gauss(NODES)
    t_o = 0.5 * (low + high) + 0.5 * (high - low) * x
    blur = np.array([kernel_value(t_i + t, psi) for t in t_o])
    both = strength(t_i, psi, balanced(psi)) * strengths(t_o[None], psi, balanced(psi))[0]
    return t_o, 0.5 * (high - low) * w * blur * np.cos(t_o) ** 2 * both


def albedo(scratch: Traced, fresnel: Fresnel, psi: float, theta_i: float, phi_i: float) -> Array:
    """Return the directional albedo (C,) of light from one direction (radians)."""
    t_i, p_i = coordinates(theta_i, phi_i)
    j = bin_of(p_i, scratch.bins)
    t_o, weight = cone(t_i, psi)
    # F varies slowly over the blur: its value on the cone and at both ends, as a parabola
    ends = np.array([0.0, 0.5 * psi])
    on, aside = (scratch.reflected(min(max(t_i + e, -0.5 * math.pi), 0.5 * math.pi), fresnel)[j] for e in ends)
    x = (t_i - t_o) * 0.5 - t_i
    below = scratch.reflected(min(max(t_i - ends[1], -0.5 * math.pi), 0.5 * math.pi), fresnel)[j]
    s = x / ends[1]
    value = on + 0.5 * s[:, None] * (aside - below) + 0.5 * (s * s)[:, None] * (aside - 2.0 * on + below)
    return weight @ value
