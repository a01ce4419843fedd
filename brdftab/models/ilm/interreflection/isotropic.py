"""Interreflections of isotropic surfaces: Fourier modes in azimuth, joined ring by ring.

f = 1/(cos theta_i cos theta_o) sum_m eps_m cos(m phi) sum over rings k, sets s and eigenfunctions e of
w_k/(2 cos t_k) c_ske a_mske(theta_i) a_mske(theta_o), where a_m is the mean of the light times cos(m azimuth): even
modes carry the even, odd modes the odd distributions of light over both facets. One matrix product a mode makes a
table.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models.ilm.interreflection.light import modes_of_light
from brdftab.models.ilm.interreflection.rule import (
    Channels,
    Rule,
    couplings,
    exchange_of,
    set_count,
    steepness,
    stretched_rings,
)
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# numbers of one block of light, which bounds the memory
BLOCK = 1 << 23


@lru_cache(maxsize=8)
def _transforms(azimuths: int, modes: int) -> tuple[Array, Array]:
    """Return azimuths (Q,) of a quarter circle and weights (2, Q, modes/2) of the cosine coefficients by parity."""
    angle = 0.5 * math.pi * np.arange(azimuths + 1) / azimuths
    weight = np.full(azimuths + 1, 1.0 / azimuths)
    weight[[0, -1]] *= 0.5
    order = np.arange(modes // 2)
    parts = [weight[:, None] * np.cos(angle[:, None] * (2 * order + parity)) for parity in range(2)]
    return angle, np.stack(parts)


class Modes:
    """The Fourier modes of an isotropic setup's interreflections (without the purely specular paths).

    Parameters
    ----------
    setup : Setup
        Isotropic, with max_bounces 2 or None.
    rule : Rule
        The resolution.
    """

    def __init__(self, setup: Setup, rule: Rule) -> None:
        self._rule, self._two = rule, setup.max_bounces == 2
        self._channels = Channels.of(setup)
        slope, self._weight = stretched_rings(setup.ndf, rule.rings)
        self._slope = np.ascontiguousarray(setup.alpha_x * slope)

    def _light(self, theta: Array, n: float, rings: slice) -> Array:
        """Return the light in eigenfunctions, (2, modes/2, U, R S N): parities, modes, polar angles, the rest."""
        rule = self._rule
        _, vectors, steps = exchange_of(self._slope.tobytes(), n, self._two, rule.functions)
        angle, cosines = _transforms(rule.azimuths, rule.modes)
        _, st, ct = steepness(self._slope[rings])
        light = np.empty((2, rule.modes // 2, theta.size, st.size, set_count(self._two), rule.functions))
        modes_of_light(theta, st, ct, angle, cosines, n, self._two, steps, vectors[rings], light)
        return light.reshape(*light.shape[:3], -1)

    def _join(self, theta_i: Array, theta_o: Array, paired: bool) -> Array:
        """Return modes (2, modes/2, I, O, C) of all combinations, or (2, modes/2, P, C) of pairs, without cosines."""
        rule, channels = self._rule, self._channels
        theta, back = np.unique(np.concatenate([theta_i, theta_o]), return_inverse=True)
        i, o = back[: theta_i.size], back[theta_i.size :]
        plain = i.size == o.size == theta.size and bool((i == o).all() and (np.diff(i) == 1).all())
        shape = (theta_i.size,) if paired else (theta_i.size, theta_o.size)
        total = np.zeros((2, rule.modes // 2, *shape, channels.kd.size))
        width = max(theta.size, 2 * theta_i.size if paired else theta.size)
        step = max(1, BLOCK // (set_count(self._two) * rule.functions * width * rule.modes))
        for n in channels.distinct:
            eigenvalues = exchange_of(self._slope.tobytes(), n, self._two, rule.functions)[0]
            for start in range(0, rule.rings, step):
                rings = slice(start, start + step)
                light = self._light(theta, n, rings)
                lights, views = (light, light) if plain else (light[:, :, i], light[:, :, o])
                share = self._weight[rings] / (2.0 * steepness(self._slope[rings])[2])
                for c in channels.sharing(n):
                    join = couplings(eigenvalues[rings], float(channels.kd[c]), n, self._two)
                    join = (join * share[:, None, None]).transpose(2, 1, 0, 3).reshape(2, 1, 1, -1)
                    if paired:
                        total[..., c] += np.einsum("pmuf,pmuf->pmu", lights * join, views)
                    else:
                        total[..., c] += (lights * join) @ views.swapaxes(2, 3)
        return total

    def table(self, theta_i: Array, theta_o: Array, paired: bool = False) -> Array:
        """Return the modes (modes, I, O, C) of all combinations of polar angles, or (modes, P, C) of pairs.

        They are multiplied by eps_m and divided by both cosines; at and below the horizon they are 0.
        """
        total = self._join(theta_i, theta_o, paired)
        modes = total.swapaxes(0, 1).reshape(self._rule.modes, *total.shape[2:])
        modes[1:] *= 2.0
        i, o = (inverse_cosine(np.cos(theta)) for theta in (theta_i, theta_o))
        modes *= (i * o if paired else np.outer(i, o))[None, ..., None]
        return modes


def inverse_cosine(cosine: Array) -> Array:
    """Return 1/cosine above the horizon and 0 elsewhere."""
    above = cosine > HORIZON
    return np.where(above, 1.0 / np.where(above, cosine, 1.0), 0.0)


def synthesis(phi: Array, modes: int) -> Array:
    """Return cos(m phi), (modes, N)."""
    return np.cos(np.arange(modes)[:, None] * phi)


@kernel
def place(theta):
    """Return where a polar angle lies among the knots, in [0, 1]; `knots` is the inverse."""
    return 1.0 - math.sqrt(max(1.0 - theta / (0.5 * math.pi), 0.0))


def knots(count: int) -> Array:
    """Return polar angles (count,) from 0 to just above the horizon, ever closer there."""
    theta = 0.5 * math.pi * (1.0 - (1.0 - np.linspace(0.0, 1.0, count)) ** 2)
    return np.minimum(theta, 0.5 * math.pi - 1e-7)


@kernel
def stencil(position, last, weights):
    """Write the cubic Lagrange weights (4,) at a position in units of the knots 0 ... last; return the first knot."""
    first = min(max(int(position) - 1, 0), last - 3)
    x = position - first
    weights[0] = -(x - 1.0) * (x - 2.0) * (x - 3.0) / 6.0
    weights[1] = x * (x - 2.0) * (x - 3.0) / 2.0
    weights[2] = -x * (x - 1.0) * (x - 3.0) / 2.0
    weights[3] = x * (x - 1.0) * (x - 2.0) / 6.0
    return first


@kernel
def _blend(modes, theta_i, theta_o, phi, out):
    """Sum modes (I, O, M, C) at one point into out (C,)."""
    for ch in range(out.size):
        out[ch] = 0.0
    if min(math.cos(theta_i), math.cos(theta_o)) <= HORIZON:
        return
    wi, wo = np.empty(4), np.empty(4)
    last = modes.shape[0] - 1
    i, o = stencil(last * place(theta_i), last, wi), stencil(last * place(theta_o), last, wo)
    c = 2.0 * math.cos(phi)
    for ch in range(out.size):
        # Clenshaw's recurrence downwards, stable and without a cosine a mode
        before, now = 0.0, 0.0
        for m in range(modes.shape[2] - 1, -1, -1):
            value = 0.0
            for a in range(4):
                for b in range(4):
                    value += wi[a] * wo[b] * modes[i + a, o + b, m, ch]
            if m == 0:
                out[ch] = value + 0.5 * c * now - before
            else:
                before, now = now, value + c * now - before


@parallel_kernel
def interpolate(modes, theta_i, theta_o, phi, out):
    """Sum modes (I, O, M, C), known at `knots`, at N points into out (N, C); 0 at the horizon."""
    for n in numba.prange(phi.size):
        _blend(modes, theta_i[n], theta_o[n], phi[n], out[n])
