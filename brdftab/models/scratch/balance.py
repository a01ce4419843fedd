"""The factor that keeps the light of a blurred cone: f = rho k(t_i + t_o) s(t_i) s(t_o), reciprocal and without loss.

Light along t_i comes back whole where s(t_i) int s(t_o) k(t_i + t_o) cos(t_o)^2 dt_o = 1. Away from the horizon
s = C^(-1/2)/cos t with C = int k(x) cos x dx solves that exactly, for any width; within some widths of the horizon the
cone is cut, and s is found by iteration. There 1/cos t would return several times the light.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from brdftab.jit import kernel
from brdftab.quadrature import gauss
from brdftab.typing import Array

# widths from the horizon within which s is tabulated, knots a width, Gauss nodes over a cone, and rounds: what is left
# halves in each
REACH, KNOTS, NODES, ROUNDS = 12, 64, 24, 40
# terms of C: leave 1e-17 at 20 degrees
TERMS = 8


def far(psi: float) -> float:
    """Return C^(-1/2) of a half width (radians)."""
    # int (15/16) (1 - x^2)^2 x^(2 k) dx = 15/((2k + 1)(2k + 3)(2k + 5))
    total = sum(
        (-1.0) ** k * psi ** (2 * k) / math.factorial(2 * k) * 15.0 / ((2 * k + 1) * (2 * k + 3) * (2 * k + 5))
        for k in range(TERMS)
    )
    return 1.0 / math.sqrt(total)


@kernel
def strength(t, psi, table):
    """Return s at an angle along the scratch (radians); the last of the table is C^(-1/2)."""
    above = max(0.5 * math.pi - abs(t), 0.0)
    place = above / psi * KNOTS
    count = table.size - 1
    if place >= count - 1:
        return table[count] / math.sin(above)
    start = min(max(int(place) - 1, 0), count - 4)
    x = place - start
    a, b, c, d = table[start], table[start + 1], table[start + 2], table[start + 3]
    # the cubic through four knots
    value = (
        -a * (x - 1.0) * (x - 2.0) * (x - 3.0) / 6.0
        + b * x * (x - 2.0) * (x - 3.0) / 2.0
        - c * x * (x - 1.0) * (x - 3.0) / 2.0
        + d * x * (x - 1.0) * (x - 2.0) / 6.0
    )
    return value / math.hypot(math.sin(above), psi)


@kernel
def strengths(t, psi, table):
    """Return `strength` of angles (N, M)."""
    out = np.empty(t.shape)
    for n in range(t.shape[0]):
        for m in range(t.shape[1]):
            out[n, m] = strength(t[n, m], psi, table)
    return out


@lru_cache(maxsize=16)
def balanced(psi: float) -> Array:
    """Return the table (K + 1,) that `strength` reads: s hypot(cos t, psi) at knots from the horizon up, and C^(-1/2).

    Measured: the light that comes back is 1 to 1e-6 at any angle, for widths of .01 to 20 degrees.
    """
    count = min(REACH, math.ceil(0.5 * math.pi / psi)) * KNOTS + 1
    above = np.arange(count) / KNOTS * psi
    # knots beyond the normal repeat those before it
    t = np.abs(0.5 * math.pi - above)
    scale = np.hypot(np.cos(t), psi)
    table = np.append(far(psi) * scale / np.maximum(np.cos(t), 0.5 * psi), far(psi))
    x, w = gauss(NODES)
    low, high = np.maximum(-t - psi, -0.5 * math.pi), np.minimum(-t + psi, 0.5 * math.pi)
    half = 0.5 * (high - low)
    others = 0.5 * (low + high)[:, None] + half[:, None] * x
    rest = np.maximum(1.0 - ((t[:, None] + others) / psi) ** 2, 0.0)
    weight = half[:, None] * w * 0.9375 / psi * rest * rest * np.cos(others) ** 2
    for _ in range(ROUNDS):
        back = (weight * strengths(others, psi, table)).sum(axis=1)
        table[:-1] = np.sqrt(table[:-1] * scale / back)
    return table
