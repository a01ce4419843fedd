"""Fast isotropic product-grid tables of the single-bounce models.

The azimuths of a pair of polar angles are one row (single_rows.py). The reflectance of each channel is a polynomial of
a Moebius map of i.h (reflectance_fit.py). A square grid is computed for o <= i, and each row is written twice, past the
cache. Against exact evaluation of gold a float32 table is good to 7e-7 and a float64 one to 5e-13, relative; what the
reflectance adds for other parameters is at most 1.5e-6 in float32 (tests/test_single_table.py).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import BECKMANN, GGX, V_CAVITY, WALTER
from brdftab.models._shared.facets.masking import smith_g2, smith_lambda
from brdftab.models._shared.fresnel.reflectance_fit import Fit, fit
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models._shared.single_bounce.single_rows import (
    beckmann_row,
    ggx_row,
    horner_more,
    horner_start,
    interleave,
    map_row,
    phong_row,
)
from brdftab.models._shared.single_bounce.streaming import finish, put, stream_phase
from brdftab.models.resolve import Setup

# rows are padded so that the vectorised loops have no remainder
LANES = 16
# errors of the reflectance asked for in float64 and in float32, and the largest one allowed in float32
FINE, SINGLE, ROUNDING = 2e-13, 5e-7, 1.5e-6
# below this tolerance a float32 table is computed in float64
SINGLE_TOLERANCE = 1e-5


@kernel
def _axis(masking, ndf, alpha, theta):
    """Return theta, its sine and cosine (0 at the horizon) and Smith's Lambda, (N, 4)."""
    axis = np.empty((theta.size, 4))
    for n in range(theta.size):
        s, c = math.sin(theta[n]), math.cos(theta[n])
        axis[n, 0], axis[n, 1] = theta[n], s
        axis[n, 2] = c if c > HORIZON else 0.0
        axis[n, 3] = smith_lambda(ndf, alpha, s / c, masking == WALTER) if c > HORIZON and masking != V_CAVITY else 0.0
    return axis


@kernel
def _pair(masking, scale, lights, i, views, o):
    """Return tan^2, slope, u, v and half of c_i + c_o of a pair of polar angles; u = v = 0 below the horizon."""
    ci, co = lights[i, 2], views[o, 2]
    tangent = math.tan(0.5 * (lights[i, 0] - views[o, 0]))
    first, slope, u, v, up = tangent * tangent, 0.0, 0.0, 0.0, ci + co
    if ci > 0.0 and co > 0.0:
        slope = 2.0 * lights[i, 1] * views[o, 1] / (up * up)
        u = scale / (4.0 * ci * co)
        if masking == V_CAVITY:
            v = scale / (up * max(ci, co))
        else:
            v = math.inf
            u *= smith_g2(masking, lights[i, 3], views[o, 3])
    return first, slope, u, v, 0.5 * up


@kernel
def _pairs(masking, scale, starts, lights, i, views, stop):
    """Return `_pair` of light i with the first views, (stop, 5), and the zones of the reflectance that hold them."""
    pairs, zones = np.empty((stop, 5)), np.empty(stop, np.int64)
    for o in range(stop):
        first, slope, u, v, half = _pair(masking, scale, lights, i, views, o)
        pairs[o, 0], pairs[o, 1], pairs[o, 2], pairs[o, 3], pairs[o, 4] = first, slope, u, v, half
        # the smallest i.h of the row, at phi = 180 degrees
        low = half * math.sqrt(1.0 + first)
        zones[o] = 0
        for zone in range(1, starts.size):
            if starts[zone] <= low:
                zones[o] = zone
    return pairs, zones


@kernel
def _rows(i, stop, mirrored, model, lights, views, squares, squares64, zones, phase, count, out):
    """Write the rows (i, o) for o < stop, and their mirror images (o, i)."""
    masking, ndf, scale, shape = model
    starts, degrees, maps, coefficients = zones
    channels = coefficients.shape[1]
    weight, x = np.empty_like(squares), np.empty_like(squares)
    row = np.empty(11, squares.dtype)
    colours = np.empty((channels, squares.size), squares.dtype)
    cells = np.empty(squares.size * channels, out.dtype)
    size = count * channels
    row[0], row[1] = 1.0, shape
    pairs, held = _pairs(masking, scale, starts, lights, i, views, stop)
    # nothing in this loop may count references: streamed stores would stop for it
    for o in range(stop):
        first, slope, u, v = pairs[o, 0], pairs[o, 1], pairs[o, 2], pairs[o, 3]
        zone = held[o]
        row[2], row[3], row[4], row[5], row[6] = first, slope, u, v, pairs[o, 4]
        for j in range(4):
            row[7 + j] = maps[zone, j]
        if ndf == GGX:
            ggx_row(row, squares, weight, x)
        else:
            if ndf == BECKMANN:
                beckmann_row(shape, first, slope, u, v, squares64, weight, x)
            else:
                phong_row(shape, first, slope, u, v, squares64, weight, x)
            map_row(row, x)
        for c in range(channels):
            horner_start(coefficients, zone, c, x, colours)
            for at in range(5, degrees[zone] + 1, 4):
                horner_more(coefficients, zone, c, at, x, colours)
        interleave(weight, colours, cells)
        put(phase, cells, size, out, (i * views.shape[0] + o) * size)
        if mirrored and o != i:
            put(phase, cells, size, out, (o * views.shape[0] + i) * size)
    finish(phase)


@parallel_kernel
def _fill(theta_i, theta_o, alpha, mirrored, model, squares, squares64, zones, phase, count, out):
    masking, ndf = model[0], model[1]
    lights = _axis(masking, ndf, alpha, theta_i)
    views = _axis(masking, ndf, alpha, theta_o)
    size = theta_i.size
    # a long and a short row of the triangle together make equal shares for any number of threads
    for index in numba.prange((size + 1) // 2):
        low = np.int64(index)
        high = size - 1 - low
        for side in range(1 if low == high else 2):
            i = high if side == 0 else low
            stop = i + 1 if mirrored else theta_o.size
            _rows(i, stop, mirrored, model, lights, views, squares, squares64, zones, phase, count, out)


class SingleBounceEvaluator:
    """A prepared isotropic single-bounce setup (see `build`)."""

    def __init__(self, setup: Setup, masking: int, tolerance: float) -> None:
        assert setup.fresnel is not None
        self._setup, self._masking, self._tolerance = setup, masking, tolerance
        self._fits: dict[type, Fit] = {}
        a2 = setup.alpha_x * setup.alpha_x
        exponent = 2.0 / a2 - 2.0
        scale, shape = {
            0: (1.0 / (math.pi * a2), 1.0 / a2),
            1: (a2 / math.pi, a2),
            2: ((exponent + 2.0) / (2.0 * math.pi), 0.5 * exponent),
        }[setup.ndf]
        self._model = (masking, setup.ndf, scale, shape)

    def _fit(self, dtype: type) -> Fit:
        if dtype not in self._fits:
            assert self._setup.fresnel is not None
            target = FINE if dtype is np.float64 else SINGLE
            self._fits[dtype] = fit(self._setup.fresnel, target, dtype)
        return self._fits[dtype]

    def _single(self) -> bool:
        """Tell whether tolerance and reflectance allow arithmetic in float32."""
        return self._tolerance >= SINGLE_TOLERANCE and self._fit(np.float32).error <= ROUNDING

    def holds(self) -> bool:
        """Tell whether polynomials hold the reflectance to 0.02 of the tolerance and to 1.5e-6."""
        return self._single() or self._fit(np.float64).error <= min(0.02 * self._tolerance, ROUNDING)

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians), exactly; returns (N, 1, C) in 1/sr."""
        return evaluate_points(self._setup, self._masking, theta_i, theta_o, phi, phi_i)

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (1, I, O, F, C), float32 or float64 in C order, on a product grid of radians.

        A square grid (both polar axes identical) is computed half and mirrored; at the horizon and below it is 0.
        """
        assert out.flags.c_contiguous
        work: type = np.float32 if out.dtype == np.float32 and self._single() else np.float64
        half = np.cos(0.5 * phi)
        squares64 = np.zeros(-(-phi.size // LANES) * LANES)
        squares64[: phi.size] = 2.0 * half * half
        _fill(
            theta_i,
            theta_o,
            self._setup.alpha_x,
            square,
            self._model,
            squares64.astype(work),
            squares64,
            self._fit(work).arrays(work),
            stream_phase(out),
            phi.size,
            out.reshape(-1),
        )


def build(setup: Setup, masking: int, tolerance: float) -> SingleBounceEvaluator | None:
    """Return a prepared table where the setup is isotropic and polynomials hold its reflectance, else None.

    Parameters
    ----------
    setup : Setup
        A single-bounce microfacet setup.
    masking : int
        A Smith code of masking.py, or V_CAVITY.
    tolerance : float
        Relative error asked for; below 1e-5 a float32 table is computed in float64.
    """
    if not setup.isotropic or setup.fresnel is None:
        return None
    table = SingleBounceEvaluator(setup, masking, tolerance)
    return table if table.holds() else None
