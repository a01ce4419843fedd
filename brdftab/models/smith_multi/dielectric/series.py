"""From solved azimuth modes to values: all bounces beyond the first, as a cosine series in phi.

Low modes are solved one by one. Higher ones concern grazing or narrow lobes and are smooth in the (real) order: they
are solved at a few Chebyshev nodes an octave, and the interpolation is folded into the cosines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from brdftab.models.smith_multi.dielectric.solve import System, multiple
from brdftab.quadrature import lagrange
from brdftab.typing import Array, Index

# no table angle needs modes beyond this to three digits; cosines made at a time
TOP, BLOCK = 1 << 17, 1 << 22


@dataclass(frozen=True)
class Part:
    """Solved modes of some range.

    Attributes
    ----------
    start, stop : int
        Modes start .. stop - 1.
    orders : float64 (K,)
        Orders that were solved: all of them, or Chebyshev nodes.
    lights, views : int64
        Which lights and views the modes concern.
    values : float64 (layers, K, lights, views)
    """

    start: int
    stop: int
    orders: Array
    lights: Index
    views: Index
    values: Array

    def reversed(self) -> Part:
        """Return the part with every path reversed: lights for views and views for lights."""
        return replace(self, lights=self.views, views=self.lights, values=self.values.transpose(0, 1, 3, 2))

    def cosines(self, phi: Array) -> Array:
        """Return (K, F): what each solved order contributes at azimuths phi (radians), straight through at pi."""
        total = np.zeros((self.orders.size, phi.size))
        exact = self.orders.size == self.stop - self.start
        step = max(BLOCK // max(phi.size, 1), 1)
        for low in range(self.start, self.stop, step):
            m = np.arange(low, min(low + step, self.stop))
            # light goes on in the direction opposite to where it came from
            waves = np.cos(m[:, None] * (phi - math.pi)) * np.where(m == 0, 1.0, 2.0)[:, None]
            if exact:
                total[m - self.start] = waves
            else:
                total += lagrange(self.orders, m.astype(np.float64)).T @ waves
        return total


def chebyshev(low: float, high: float, count: int) -> Array:
    """Return Chebyshev nodes on (low, high), increasing."""
    x = -np.cos(math.pi * (np.arange(count) + 0.5) / count)
    return 0.5 * (low + high) + 0.5 * (high - low) * x


def _solve(system: System, lights: Index, views: Index, layers: int, most: float, start: int, stop: int) -> list[Part]:
    """Return the parts of one range of low modes, chunk by chunk."""
    level = system.level
    weights = system.above.weights, system.below.weights
    parts = []
    for first, count in system.chunks(start, stop):
        values = multiple(system.matrices(first, count), weights, lights, views, layers, most, level.sweep)
        orders = np.arange(first, first + count, dtype=np.float64)
        parts.append(Part(first, first + count, orders, np.arange(lights.size), np.arange(views.size), values))
    return parts


def solve(system: System, lights: Index, views: Index, layers: int, most: float) -> list[Part]:
    """Return all modes of bounce orders 2 and above between directions of a system.

    Parameters
    ----------
    system : System
        States and directions.
    lights, views : int64
        Numbers of the directions that send and receive.
    layers : int
        Orders 2, 3, ... apart, the last one with all higher ones.
    most : float
        Highest bounce order, inf for all.
    """
    level = system.level
    parts = _solve(system, lights, views, layers, most, 0, level.modes)
    top = int(min(system.limits[np.concatenate([lights, views])].max(initial=0.0), TOP)) + 1
    start = level.modes
    while start < top:
        stop = min(2 * start, top)
        if stop - start <= level.octave:
            orders = np.arange(start, stop, dtype=np.float64)
        else:
            orders = chebyshev(start - 0.5, stop - 0.5, level.octave)
        matrices, weights, kept = system.high(orders)
        # numbers among the kept directions of the lights and views that are kept
        mine, theirs = (np.flatnonzero(np.isin(some, kept)) for some in (lights, views))
        if mine.size and theirs.size:
            a, b = np.searchsorted(kept, lights[mine]), np.searchsorted(kept, views[theirs])
            values = multiple(matrices, weights, a, b, layers, most, level.sweep)
            parts.append(Part(start, stop, orders, mine, theirs, values))
        start = stop
    return parts


def evaluate(parts: list[Part], rows: slice, views: int, phi: Array) -> Array:
    """Return (layers, I, O, F) for a range of the lights, all views and azimuths phi (F,)."""
    total = np.zeros((parts[0].values.shape[0], rows.stop - rows.start, views, phi.size))
    for part in parts:
        kept = np.flatnonzero((part.lights >= rows.start) & (part.lights < rows.stop))
        values = part.values[:, :, kept].transpose(0, 2, 3, 1)
        total[:, (part.lights[kept] - rows.start)[:, None], part.views] += values @ part.cosines(phi)
    return total


def evaluate_pairs(parts: list[Part], lights: Index, views: Index, phi: Array) -> Array:
    """Return (layers, N) at pairs of a light, a view (numbers) and an azimuth."""
    total = np.zeros((parts[0].values.shape[0], phi.size))
    for part in parts:
        light_at, view_at = np.full(lights.max() + 1, -1), np.full(views.max() + 1, -1)
        light_at[part.lights], view_at[part.views] = np.arange(part.lights.size), np.arange(part.views.size)
        a, b = light_at[lights], view_at[views]
        kept = np.flatnonzero((a >= 0) & (b >= 0))
        values = part.values[:, :, a[kept], b[kept]]
        total[:, kept] += np.einsum("lkn,kn->ln", values, part.cosines(phi[kept]))
    return total
