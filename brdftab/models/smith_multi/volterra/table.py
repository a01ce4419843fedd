"""Tables on product grids: single bounce in closed form, all further bounces from the solved modes."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import GGX
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.fresnel.project import arguments
from brdftab.models.resolve import Setup
from brdftab.models.smith_multi.volterra.orders import synthesis
from brdftab.models.smith_multi.volterra.points import evaluate
from brdftab.models.smith_multi.volterra.settings import settings
from brdftab.models.smith_multi.volterra.sources import (
    distribution,
    elevations,
    fitted_fresnel,
    reached,
    solved_sources,
)


@kernel
def _single(ndf, a2, t):
    """Return D/4 at tan^2 theta_h = t."""
    up = 1.0 + t
    if ndf == GGX:
        ratio = up / (a2 + t)
        return 0.25 * a2 / math.pi * ratio * ratio
    return 0.25 * math.exp(-t / a2) * up * up / (math.pi * a2)


@kernel
def _synthesise(values, offset, size, matrix, a, b, count, acc):
    """Fill acc (L, W, F) with the sums over the first orders of a pair of sources."""
    azimuths = matrix.shape[1]
    for n in range(values.shape[0]):
        for w in range(values.shape[1]):
            for f in range(azimuths):
                acc[n, w, f] = 0.0
            s = 0
            while s + 4 <= count:
                c0 = values[n, w, offset[s] + a * size[s] + b]
                c1 = values[n, w, offset[s + 1] + a * size[s + 1] + b]
                c2 = values[n, w, offset[s + 2] + a * size[s + 2] + b]
                c3 = values[n, w, offset[s + 3] + a * size[s + 3] + b]
                for f in range(azimuths):
                    acc[n, w, f] += (
                        c0 * matrix[s, f] + c1 * matrix[s + 1, f] + (c2 * matrix[s + 2, f] + c3 * matrix[s + 3, f])
                    )
                s += 4
            while s < count:
                c0 = values[n, w, offset[s] + a * size[s] + b]
                for f in range(azimuths):
                    acc[n, w, f] += c0 * matrix[s, f]
                s += 1


@kernel
def _combine(surface, beta_a, beta_b, front, lift, acc, weights, row, layered, cells):
    """Fill cells (P, F, C) with single bounce and projected further bounces; return how many sums were below 0."""
    ndf, a2, kind, fa, fb, table, single_weights = surface
    clamped = 0
    tangent = math.tan(0.5 * (beta_a - beta_b))
    up = math.sin(beta_a) + math.sin(beta_b)
    slope = 2.0 * math.cos(beta_a) * math.cos(beta_b) / (up * up)
    channels = single_weights.shape[1]
    for f in range(lift.size):
        t = tangent * tangent + slope * lift[f]
        value = front * _single(ndf, a2, t)
        for w in range(row.size):
            row[w] = value
        multiply(kind, fa, fb, table, 0.5 * up * math.sqrt(1.0 + t), row)
        for c in range(channels):
            total = 0.0
            for w in range(row.size):
                total += row[w] * single_weights[w, c]
            cells[0, f, c] = total
        for n in range(acc.shape[0]):
            at = n + 1 if layered else 0
            for w in range(acc.shape[1]):
                if acc[n, w, f] < 0.0:
                    clamped += 1
                    acc[n, w, f] = 0.0
            for c in range(channels):
                total = 0.0
                for w in range(acc.shape[1]):
                    total += acc[n, w, f] * weights[w, c]
                if layered:
                    cells[at, f, c] = front * total
                else:
                    cells[0, f, c] += front * total
    return clamped


@parallel_kernel
def _fill(rows, columns, square, axes, lowest, solved, matrix, lift, place, surface, weights, out, clamped):
    """Fill out (P, I, O, F, C); rows and columns tell the source of each polar angle, -1 below the horizon."""
    values, offset, size = solved
    source, gain, reached = axes
    layered = out.shape[0] > 1 or values.shape[0] == 0
    azimuths, channels = out.shape[3], out.shape[4]
    for i in numba.prange(rows.size):
        acc = np.empty((values.shape[0], values.shape[1], matrix.shape[1]))
        cells = np.empty((out.shape[0], matrix.shape[1], channels))
        row = np.empty(surface[3].size)
        # long and short rows of the triangle take turns
        at = rows.size - 1 - i
        for o in range(at + 1 if square else columns.size):
            a, b = max(rows[at], columns[o]), min(rows[at], columns[o])
            if b < 0:
                for p in range(out.shape[0]):
                    for f in range(azimuths):
                        for c in range(channels):
                            out[p, at, o, f, c] = 0.0
                            if square:
                                out[p, o, at, f, c] = 0.0
                continue
            count = 0
            while count < offset.size and size[count] > a and lowest[count] < reached[a, b]:
                count += 1
            _synthesise(values, offset, size, matrix, a, b, count, acc)
            clamped[at] += _combine(
                surface, source[a], source[b], gain[a] * gain[b], lift, acc, weights, row, layered, cells
            )
            for p in range(out.shape[0]):
                for f in range(azimuths):
                    for c in range(channels):
                        out[p, at, o, f, c] = cells[p, place[f], c]
                        if square:
                            out[p, o, at, f, c] = cells[p, place[f], c]


class VolterraEvaluator:
    """An isotropic reflecting setup, ready for points and product grids.

    Attributes
    ----------
    clamped : int
        Sums over modes below 0 that the last `fill` set to 0.
    """

    def __init__(self, setup: Setup, tolerance: float, trial: bool = False, orders: int = 0) -> None:
        self._setup, self._orders = setup, orders
        self._setting = settings(setup.ndf, tolerance, trial)
        self.clamped = 0

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians); returns (N, P, C) in 1/sr."""
        return evaluate(self._setup, theta_i, theta_o, phi, phi_i, self._orders, self._setting)

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (P, I, O, F, C), float32 or float64, on a product grid of radians, in 1/sr.

        A square grid (both polar axes identical) is computed half and mirrored; at the horizon and below it is 0.
        """
        setup, setting = self._setup, self._setting
        assert setup.fresnel is not None
        source, (rows, columns) = elevations(theta_i, theta_o)
        fitted, weights = fitted_fresnel(setup, setting)
        lift, place = np.unique(np.round(2.0 * np.cos(0.5 * phi) ** 2, 14), return_inverse=True)
        forward = 2.0 * np.arccos(np.sqrt(0.5 * lift))
        if source.size == 0 or phi.size == 0:
            out[:] = 0.0
            return
        layers = max(0, self._orders - 1)
        needed = reached(setup, setting, source)
        solved, chosen = solved_sources(setup, setting, source, layers, needed, float(needed.max()), fitted)
        matrix = synthesis(chosen, forward)
        surface = (setup.ndf, setup.alpha_x**2, *arguments(setup.fresnel, setting.tolerance), setup.fresnel.weights)
        clamped = np.zeros(theta_i.size, np.int64)
        axes = (source, distribution(setup).weight(source, setup.alpha_x), needed)
        modes = (solved.values, solved.offset, solved.size)
        azimuths = (matrix, lift, place)
        _fill(rows, columns, square, axes, chosen.lowest, modes, *azimuths, surface, weights, out, clamped)
        self.clamped = int(clamped.sum())
