"""Values of an isotropic rough dielectric, light and view on either side: first bounce plus the cosine series."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.directions import HORIZON
from brdftab.jit import parallel_kernel
from brdftab.models._shared.random_walk.refraction import single_bounce, weight
from brdftab.models.resolve import Setup, component_names
from brdftab.models.smith_multi.dielectric.levels import further, level
from brdftab.models.smith_multi.dielectric.pairs import solve_pairs
from brdftab.models.smith_multi.dielectric.series import Part, evaluate, evaluate_pairs, solve
from brdftab.models.smith_multi.dielectric.solve import System
from brdftab.typing import Array, Index

# values of the series held at a time
BLOCK = 1 << 24


@parallel_kernel
def _write(theta_i, theta_o, phi, places_i, places_o, first, twins, surface, series, channels, out):
    """Write cells of the lights `first`, first + 1, ... into out (P, I, O, F, C).

    `twins` gives the number of a light among the views and of a view among the lights, -1 if it is none: a cell
    whose reverse is in the table, too, is made once and copied.
    """
    ndf, alpha, n = surface
    layers, rows, columns, steps = series.shape
    parts = out.shape[0]
    for cell in numba.prange(rows * columns):
        row, b = cell // columns, cell % columns
        a = first + row
        view_of_a, light_of_b = twins[0][a], twins[1][b]
        mirrored = view_of_a >= 0 and light_of_b >= 0
        if mirrored and light_of_b > a:
            continue
        ti, to = theta_i[a], theta_o[b]
        n_i = n if ti > 0.5 * math.pi else 1.0
        n_o = n if to > 0.5 * math.pi else 1.0
        w = weight(ndf, alpha, math.sin(ti), math.cos(ti)) * weight(ndf, alpha, math.sin(to), math.cos(to)) * n_o / n_i
        back = (n_i / n_o) ** 2
        for f in range(steps):
            value = single_bounce(ndf, alpha, alpha, ti, to, phi[f], 0.0, n)
            for p in range(parts):
                # modes of tiny values leave rounding of either sign
                if p > 0:
                    value = 0.0
                if parts == 1 or p > 0:
                    layer = max(p - 1, 0)
                    if layer < layers:
                        value += w * max(series[layer, row, b, f], 0.0)
                for c in channels:
                    out[p, places_i[a], places_o[b], f, c] = value
                    if mirrored:
                        out[p, places_i[light_of_b], places_o[view_of_a], f, c] = value * back


@parallel_kernel
def _write_pairs(theta_i, theta_o, phi, surface, series, channels, out):
    """Write N pairs into out (N, P, C)."""
    ndf, alpha, n = surface
    parts = out.shape[1]
    for k in numba.prange(theta_i.size):
        ti, to = theta_i[k], theta_o[k]
        if min(abs(math.cos(ti)), abs(math.cos(to))) <= HORIZON:
            continue
        n_i = n if ti > 0.5 * math.pi else 1.0
        n_o = n if to > 0.5 * math.pi else 1.0
        w = weight(ndf, alpha, math.sin(ti), math.cos(ti)) * weight(ndf, alpha, math.sin(to), math.cos(to)) * n_o / n_i
        value = single_bounce(ndf, alpha, alpha, ti, to, phi[k], 0.0, n)
        for p in range(parts):
            if p > 0:
                value = 0.0
            if parts == 1 or p > 0:
                layer = max(p - 1, 0)
                if layer < series.shape[0]:
                    value += w * max(series[layer, k], 0.0)
            for c in channels:
                out[k, p, c] = value


def _seen(theta: Array) -> Index:
    """Return the numbers of the polar angles that are not on the horizon."""
    return np.flatnonzero(np.abs(np.cos(theta)) > HORIZON)


class DielectricEvaluator:
    """An isotropic dielectric ready for points and product grids.

    Parameters
    ----------
    setup : Setup
        The surface.
    tolerance : float
        Relative error asked.
    orders : int
        0 for the total alone.
    """

    def __init__(self, setup: Setup, tolerance: float, orders: int = 0) -> None:
        assert setup.fresnel is not None
        self._setup = setup
        self._level, self._further = level(tolerance, setup.alpha_x), further(tolerance, setup.alpha_x)
        self._layers = len(component_names(setup, orders)) if orders else 1
        index = np.broadcast_to(setup.fresnel.a, len(setup.channels))
        # channels of the same index share everything
        self._groups = [(float(n), np.flatnonzero(index == n)) for n in np.unique(index)]
        self._most = math.inf if setup.max_bounces is None else float(setup.max_bounces)

    def _solve(self, theta: Array, n: float, lights: Index, views: Index) -> list[Part]:
        """Return the solved modes between directions, none if there are single bounces only."""
        if self._most < 2:
            return []
        system = System(theta, n, self._setup.ndf, self._setup.alpha_x, self._level)
        layers = max(self._layers - 1, 1)
        if lights.size <= views.size:
            return solve(system, lights, views, layers, self._most)
        # reversed paths weigh the same, so that the fewer directions may send
        return [part.reversed() for part in solve(system, views, lights, layers, self._most)]

    def points(self, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Evaluate at N pairs of directions (radians); returns (N, P, C) in 1/sr, 0 on the horizon.

        Each pair of polar angles has panels of its own, so that no value depends on what else is asked.
        """
        out = np.zeros((theta_i.size, self._layers, len(self._setup.channels)))
        seen = np.flatnonzero((np.abs(np.cos(theta_i)) > HORIZON) & (np.abs(np.cos(theta_o)) > HORIZON))
        if seen.size == 0:
            return out
        ti, to, ph = (np.ascontiguousarray(x[seen], dtype=np.float64) for x in (theta_i, theta_o, phi))
        # reversed paths weigh the same
        pairs, place = np.unique(np.sort(np.stack([ti, to], axis=1), axis=1), axis=0, return_inverse=True)
        part = np.zeros((seen.size, *out.shape[1:]))
        levels, layers = (self._level, self._further), max(self._layers - 1, 1)
        for n, channels in self._groups:
            series = np.zeros((0, ti.size))
            if self._most >= 2:
                parts = solve_pairs(pairs, n, self._setup.ndf, self._setup.alpha_x, levels, layers, self._most)
                series = evaluate_pairs(parts, place.reshape(-1), np.zeros(ti.size, np.int64), ph)
            _write_pairs(ti, to, ph, self._surface(n), series, channels, part)
        out[seen] = part
        return out

    def _surface(self, n: float) -> tuple[int, float, float]:
        return self._setup.ndf, self._setup.alpha_x, n

    def fill(self, theta_i: Array, theta_o: Array, phi: Array, square: bool, out: NDArray[np.floating]) -> None:
        """Fill out (P, I, O, F, C), float32 or float64, on a product grid of radians, in 1/sr; 0 on the horizon.

        The polar axes may lie on one side of pi/2 or on both. A cell whose reverse is in the grid, too, is made once:
        f(i, o)/n_o^2 = f(o, i)/n_i^2 exactly. `square` adds nothing to what the axes tell.
        """
        out[...] = 0.0
        places = _seen(theta_i), _seen(theta_o)
        ti, to = (np.ascontiguousarray(x[k], dtype=np.float64) for x, k in zip((theta_i, theta_o), places, strict=True))
        phi = np.ascontiguousarray(phi, dtype=np.float64)
        if min(ti.size, to.size, phi.size) == 0:
            return
        theta = np.unique(np.concatenate([ti, to]))
        lights, views = np.searchsorted(theta, ti), np.searchsorted(theta, to)
        twins = _twins(ti, to), _twins(to, ti)
        for n, channels in self._groups:
            parts = self._solve(theta, n, lights, views)
            size = max(1, BLOCK // (max(self._layers - 1, 1) * to.size * phi.size))
            for first in range(0, ti.size, size):
                rows = slice(first, min(first + size, ti.size))
                series = np.zeros((0, rows.stop - first, to.size, phi.size))
                if parts:
                    series = evaluate(parts, rows, to.size, phi)
                _write(ti, to, phi, *places, first, twins, self._surface(n), series, channels, out)


def _twins(some: Array, others: Array) -> Index:
    """Return where each angle is found among the others, -1 if nowhere or if angles repeat."""
    if min(np.unique(x).size - x.size for x in (some, others)) < 0:
        return np.full(some.size, -1)
    order = np.argsort(others)
    at = np.minimum(np.searchsorted(others, some, sorter=order), others.size - 1)
    return np.where(others[order[at]] == some, order[at], -1)


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> DielectricEvaluator:
    """Return the tables of an isotropic dielectric.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`, estimator solver.
    tolerance : float
        Relative error asked of every cell.
    trial : bool
        Prepared only to compile the kernels: as coarse as it gets.
    orders : int
        0 for the total, else the number of bounce orders kept apart.
    """
    return DielectricEvaluator(setup, 1.0 if trial else tolerance, orders)


def points(
    setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array, *, orders: int, tolerance: float
) -> Array:
    """Evaluate at N pairs of directions (radians); returns (N, P, C) in 1/sr, see `DielectricEvaluator.points`."""
    return DielectricEvaluator(setup, tolerance, orders).points(theta_i, theta_o, phi, phi_i)
