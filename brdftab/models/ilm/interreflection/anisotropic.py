"""Interreflections of anisotropic surfaces: light and view joined cavity by cavity.

The cavities are nodes in stretched slopes, slope = r (sigma_x cos a, sigma_y sin a), with the rings of the isotropic
rule in r and equal steps of a over half a circle (a cavity and its half turn are the same). Directions repeat in
tables, so each is worked out once.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models.ilm.interreflection.isotropic import inverse_cosine, knots, place, stencil
from brdftab.models.ilm.interreflection.light import everywhere
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
BLOCK = 1 << 22


class Cavities:
    """The cavities of an anisotropic (or isotropic) setup.

    Parameters
    ----------
    setup : Setup
        With max_bounces 2 or None.
    rule : Rule
        The resolution.
    """

    def __init__(self, setup: Setup, rule: Rule) -> None:
        self._rule, self._two = rule, setup.max_bounces == 2
        self._channels = Channels.of(setup)
        slope, weight = stretched_rings(setup.ndf, rule.rings)
        steps = 2 * rule.azimuths
        angle = math.pi * (np.arange(steps) + 0.5) / steps
        x, y = setup.alpha_x * np.cos(angle), setup.alpha_y * np.sin(angle)
        # rounded, so that both halves of the half circle share their tilts
        stretch = np.round(np.hypot(x, y), 15)
        slopes, self._back = np.unique(np.outer(slope, stretch).reshape(-1), return_inverse=True)
        self._slopes = slopes.tobytes()
        _, st, ct = steepness(slopes[self._back])
        self._nodes = np.stack([st, ct, np.tile(np.arctan2(y, x), rule.rings)])
        self._share = np.repeat(weight / steps, steps) / (2.0 * ct)

    def _join(self, light: Array, view: Array, paired: bool) -> Array:
        """Return cos cos f (I, O, C) of all combinations of directions (theta, azimuth) (D, 2), or (P, C) of pairs."""
        rule, channels, sets = self._rule, self._channels, set_count(self._two)
        shape = (len(light),) if paired else (len(light), len(view))
        total = np.zeros((*shape, channels.kd.size))
        count = self._share.size
        step = max(1, BLOCK // (2 * sets * rule.functions * max(len(light), len(view))))
        for n in channels.distinct:
            values, vectors, recurrence = exchange_of(self._slopes, n, self._two, rule.functions)
            for start in range(0, count, step):
                rings = slice(start, start + step)
                at = self._back[rings]
                arms = []
                for directions in (light, view):
                    out = np.empty((len(directions), at.size, sets, 2, rule.functions))
                    nodes = np.ascontiguousarray(self._nodes[:, rings])
                    theta, azimuth = np.ascontiguousarray(directions.T)
                    everywhere(theta, azimuth, nodes, n, self._two, recurrence, vectors[at], out)
                    arms.append(out.reshape(len(directions), -1))
                for c in channels.sharing(n):
                    join = couplings(values[at], float(channels.kd[c]), n, self._two).swapaxes(0, 1)
                    join = (join * self._share[rings, None, None, None]).reshape(-1)
                    if paired:
                        total[:, c] += np.einsum("df,df->d", arms[0] * join, arms[1])
                    else:
                        total[..., c] += (arms[0] * join) @ arms[1].T
        return total

    def table(self, light: Array, view: Array, paired: bool = False) -> Array:
        """Return f (I, O, C) of all combinations of directions (theta, azimuth) (D, 2), or (P, C) of pairs."""
        i, o = inverse_cosine(np.cos(light[:, 0])), inverse_cosine(np.cos(view[:, 0]))
        return self._join(light, view, paired) * (i * o if paired else np.outer(i, o))[..., None]

    def interpolant(self) -> Array:
        """Return f (I, A/4 + 1, O, A, C) at `knots` of both polar angles and equal steps of both azimuths.

        The azimuths of the light span a quarter of the circle: the surface looks the same mirrored about either axis.
        """
        theta = knots(self._rule.knots // 2)
        steps = 4 * (self._rule.knots // 4)
        azimuth = 2.0 * math.pi * np.arange(steps) / steps
        view = np.stack(np.meshgrid(theta, azimuth, indexing="ij"), -1)
        light = view[:, : steps // 4 + 1].reshape(-1, 2)
        values = self.table(light, view.reshape(-1, 2))
        return values.reshape(theta.size, steps // 4 + 1, theta.size, steps, -1)


@kernel
def _blend(values, theta_i, theta_o, phi_i, phi_o, weights, out):
    """Interpolate values at one pair of directions into out (C,); weights (4, 4) is scratch."""
    for ch in range(out.size):
        out[ch] = 0.0
    if min(math.cos(theta_i), math.cos(theta_o)) <= HORIZON:
        return
    last, quarter, steps = values.shape[0] - 1, values.shape[1] - 1, values.shape[3]
    turn = 2.0 * math.pi
    # mirrored about the axes until the light's azimuth lies in the first quarter
    first, second = phi_i - turn * math.floor(phi_i / turn), phi_o
    if first > math.pi:
        first, second = turn - first, -second
    if first > 0.5 * math.pi:
        first, second = math.pi - first, math.pi - second
    second = steps * (second / turn - math.floor(second / turn))
    i, o = stencil(last * place(theta_i), last, weights[0]), stencil(last * place(theta_o), last, weights[1])
    p = stencil(quarter * first / (0.5 * math.pi), quarter, weights[2])
    stencil(1.0 + second - int(second), 3, weights[3])
    q = int(second) - 1 + steps
    # not a constant: written out, these loops take 10 s to compile
    span = weights.shape[1]
    for a in range(span):
        for b in range(span):
            for c in range(span):
                weight = weights[0, a] * weights[2, b] * weights[1, c]
                for d in range(span):
                    at = (q + d) % steps
                    for ch in range(out.size):
                        out[ch] += weight * weights[3, d] * values[i + a, p + b, o + c, at, ch]


@parallel_kernel
def interpolate_azimuths(values, theta_i, theta_o, phi_i, phi_o, out):
    """Interpolate `Cavities.interpolant` at N pairs of directions into out (N, C); 0 at the horizon."""
    for n in numba.prange(theta_i.size):
        _blend(values, theta_i[n], theta_o[n], phi_i[n], phi_o[n], np.empty((4, 4)), out[n])
