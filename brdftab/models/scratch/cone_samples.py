"""Samples of the blurred cone around a scratch."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdftab.models.scratch.blur import bin_of, coordinates, kernel_value
from brdftab.models.scratch.trace import Traced
from brdftab.typing import Array


def draw(
    scratch: Traced, psi: float, theta_i: float, phi_i: float, n: int, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` outgoing directions of a traced scratch; see `sample`."""
    t_i, p_i = coordinates(theta_i, phi_i)
    sums = scratch.cumulative[bin_of(p_i, scratch.bins)]
    u = rng.random(n)
    k = np.clip(np.searchsorted(sums, u, side="right") - 1, 0, scratch.bins - 1)
    sines = np.sin(scratch.phi_edges)
    v = rng.random(n)
    p = np.arcsin(np.clip(sines[k] + v * (sines[k + 1] - sines[k]), -1.0, 1.0))
    # (1 - x^2)^2 is a beta distribution on (-1, 1)
    t = -t_i + psi * (2.0 * rng.beta(3.0, 3.0, n) - 1.0)
    valid = (np.abs(t) < 0.5 * math.pi) & (sums[-1] > 0.0)
    up, across = np.cos(t) * np.cos(p), np.cos(t) * np.sin(p)
    theta_o = np.arccos(np.clip(up, -1.0, 1.0))
    phi_o = np.mod(np.arctan2(across, np.sin(t)), 2.0 * math.pi)
    return theta_o, phi_o, valid & (up > 0.0)


def density(scratch: Traced, psi: float, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return the density (N,) in 1/sr that `draw` has."""
    out = np.zeros(theta_i.size)
    share = np.diff(scratch.cumulative, axis=1)
    for n in range(theta_i.size):
        t_i, p_i = coordinates(theta_i[n], phi_i[n])
        t_o, p_o = coordinates(theta_o[n], phi_i[n] + phi[n])
        if math.cos(theta_o[n]) <= 0.0:
            continue
        k = bin_of(p_o, scratch.bins)
        inside = share[bin_of(p_i, scratch.bins), k] * math.cos(p_o) / scratch.aperture[k]
        out[n] = inside * kernel_value(t_i + t_o, psi) / math.cos(t_o)
    return out
