"""Fast isotropic product-grid tables of the single-bounce models.

The azimuths of a pair of polar angles are one row (single_rows.py); the reflectance of each channel is one polynomial of
a Moebius map of i.h; a square grid is computed for o <= i, and each row is written twice, past the cache.
Against exact evaluation a float32 table is good to 3e-6 and a float64 one to 1e-12, relative
(tests/test_single_table.py).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import Fresnel, reflectance
from brdftab.models.microfacet.masking import smith_g2, smith_lambda
from brdftab.models.microfacet.single import HORIZON, evaluate_points
from brdftab.models.microfacet.single_rows import (
    beckmann_row,
    cosine_row,
    ggx_row,
    interleave,
    phong_row,
    reflect,
)
from brdftab.models.microfacet.streaming import can_stream, finish, put
from brdftab.models.setup import Setup

# rows are padded so that the vectorised loops have no remainder
LANES = 32
# largest errors of a reflectance polynomial, and of its evaluation in float32
FINE, SINGLE, ROUNDING = 2e-13, 2e-7, 1.5e-6
# below this tolerance a float32 table is computed in float64
SINGLE_TOLERANCE = 1e-5
# poles of the map (1 + b) c/(c + b) that suit metals and dielectrics; inf is the plain cosine, which suits Schlick
POLES = (0.5, 1.0, 0.3, 0.8, 2.0, math.inf)
DEGREES = (12, 18, 24, 30, 36, 42, 48)
DARK = 1e-3


@kernel
def _axis(masking, ndf, alpha, theta):
    """Return theta, its sine and cosine (0 at the horizon) and Smith's Lambda, (N, 4)."""
    axis = np.empty((theta.size, 4))
    for n in range(theta.size):
        s, c = math.sin(theta[n]), math.cos(theta[n])
        axis[n, 0], axis[n, 1] = theta[n], s
        axis[n, 2] = c if c > HORIZON else 0.0
        axis[n, 3] = smith_lambda(ndf, alpha, s / c, masking == 2) if c > HORIZON and masking != 10 else 0.0
    return axis


@kernel
def _pair(masking, scale, light, view):
    """Return tan^2, slope, u, v and half of c_i + c_o of a pair of polar angles; u = v = 0 below the horizon."""
    ci, co = light[2], view[2]
    if ci == 0.0 or co == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    up = ci + co
    tangent = math.tan(0.5 * (light[0] - view[0]))
    slope = 2.0 * light[1] * view[1] / (up * up)
    u = scale / (4.0 * ci * co)
    v = math.inf
    if masking == 10:
        v = scale / (up * max(ci, co))
    else:
        u *= smith_g2(masking, light[3], view[3])
    return tangent * tangent, slope, u, v, 0.5 * up


@kernel
def _rows(i, stop, mirrored, model, lights, views, squares, squares64, constants, coefficients, streaming, count, out):
    """Write the rows (i, o) for o < stop, and their mirror images (o, i)."""
    masking, ndf, scale, shape = model
    channels = coefficients.shape[0]
    padded = squares.size
    weight, x = np.empty_like(squares), np.empty_like(squares)
    pair = np.empty(5, squares.dtype)
    colours = np.empty((channels, padded), squares.dtype)
    cells = np.empty(count * channels, out.dtype)
    for o in range(stop):
        first, slope, u, v, half = _pair(masking, scale, lights[i], views[o])
        pair[0], pair[1], pair[2], pair[3], pair[4] = first, slope, u, v, half
        if ndf == 1:
            ggx_row(constants, pair, squares, weight, x)
        elif ndf == 0:
            beckmann_row(shape, first, slope, u, v, squares64, weight, x)
        else:
            phong_row(shape, first, slope, u, v, squares64, weight, x)
        cosine_row(constants, pair, x)
        reflect(coefficients, x, colours)
        interleave(weight, colours, count, cells)
        put(streaming, cells, out, (i * views.shape[0] + o) * cells.size)
        if mirrored and o != i:
            put(streaming, cells, out, (o * views.shape[0] + i) * cells.size)
    finish(streaming)


@parallel_kernel
def _fill(theta_i, theta_o, alpha, mirrored, model, squares, squares64, constants, coefficients, streaming, count, out):
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
            _rows(
                i, stop, mirrored, model, lights, views, squares, squares64, constants, coefficients, streaming, count, out
            )


def _map(pole: float) -> tuple[float, float, float, float]:
    """Return (m1, m0, d1, d0) of x = (m1 c + m0)/(d1 c + d0), which takes [0, 1] to [-1, 1]."""
    if math.isinf(pole):
        return 2.0, -1.0, 0.0, 1.0
    return 1.0 + 2.0 * pole, -pole, 1.0, pole


def _horner(coefficients: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Evaluate polynomials (C, K), highest power first, in the type of x (N,); returns (N, C)."""
    value = np.zeros((x.size, coefficients.shape[0]), x.dtype)
    for column in coefficients.astype(x.dtype).T:
        value = value * x[:, None] + column
    return value


def fit(fresnel: Fresnel, target: float, dtype: type) -> tuple[np.ndarray, np.ndarray, float]:
    """Fit each channel's reflectance by a polynomial of a Moebius map of the cosine.

    Parameters
    ----------
    fresnel : Fresnel
        The reflectance; its projection to channels is part of the polynomial.
    target : float
        Relative error that ends the search for a pole and a degree.
    dtype : type
        Type in which the error is measured, and in which the kernels will evaluate.

    Returns
    -------
    coefficients : float64 (C, K)
        Highest power first, K = 13 + 6 j.
    map : float64 (4,)
        m1, m0, d1, d0 of x = (m1 c + m0)/(d1 c + d0).
    error : float
        Largest error relative to the channel, or to a thousandth of the brightest one where that is larger.
    """
    cosine = np.concatenate([np.linspace(0.0, 1.0, 1501), np.geomspace(1e-6, 1e-2, 200)])
    exact = reflectance(fresnel, cosine) @ fresnel.weights
    size = np.maximum(np.abs(exact), DARK * np.abs(exact).max(axis=1, keepdims=True))
    size = np.maximum(size, np.finfo(np.float64).tiny)
    best: tuple[np.ndarray, np.ndarray, float] | None = None
    for degree in DEGREES:
        nodes = np.cos(np.pi * (np.arange(4 * degree) + 0.5) / (4 * degree))
        basis = np.polynomial.chebyshev.chebvander(nodes, degree)
        for pole in POLES:
            m1, m0, d1, d0 = _map(pole)
            at = (nodes * d0 - m0) / (m1 - nodes * d1)
            # on these nodes the Chebyshev polynomials are orthogonal
            series = basis.T @ (reflectance(fresnel, at) @ fresnel.weights) / (2 * degree)
            series[0] *= 0.5
            coefficients = np.zeros((series.shape[1], degree + 1))
            for row, column in zip(coefficients, series.T, strict=True):
                powers = np.polynomial.chebyshev.cheb2poly(column)
                row[degree + 1 - powers.size :] = powers[::-1]
            x = ((m1 * cosine + m0) / (d1 * cosine + d0)).astype(dtype)
            error = float((np.abs(_horner(coefficients, x) - exact) / size).max())
            if best is None or error < best[2]:
                best = coefficients, np.array([m1, m0, d1, d0]), error
        assert best is not None
        if best[2] <= target:
            break
    return best


class SingleBounceTable:
    """A prepared isotropic single-bounce setup (see `build`)."""

    def __init__(self, setup: Setup, masking: int, tolerance: float) -> None:
        assert setup.fresnel is not None
        self._setup, self._masking, self._tolerance = setup, masking, tolerance
        self._fits: dict[type, tuple[np.ndarray, np.ndarray, float]] = {}
        a2 = setup.alpha_x * setup.alpha_x
        exponent = 2.0 / a2 - 2.0
        scale, shape = {
            0: (1.0 / (math.pi * a2), 1.0 / a2),
            1: (a2 / math.pi, a2),
            2: ((exponent + 2.0) / (2.0 * math.pi), 0.5 * exponent),
        }[setup.ndf]
        self._model = (masking, setup.ndf, scale, shape)

    def _fit(self, dtype: type) -> tuple[np.ndarray, np.ndarray, float]:
        if dtype not in self._fits:
            assert self._setup.fresnel is not None
            target = FINE if dtype is np.float64 else ROUNDING
            self._fits[dtype] = fit(self._setup.fresnel, target, dtype)
        return self._fits[dtype]

    def _single(self) -> bool:
        """Tell whether tolerance and reflectance allow arithmetic in float32."""
        return self._tolerance >= SINGLE_TOLERANCE and self._fit(np.float32)[2] <= ROUNDING

    def holds(self) -> bool:
        """Tell whether polynomials hold the reflectance to 0.02 of the tolerance, and to 2e-7 in float64."""
        return self._single() or self._fit(np.float64)[2] <= min(0.02 * self._tolerance, SINGLE)

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians), exactly; returns (N, 1, C) in 1/sr."""
        return evaluate_points(self._setup, self._masking, theta_i, theta_o, phi, phi_i)

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (I, O, P, C), float32 or float64 in C order, on a product grid of radians.

        A square grid (both polar axes identical) is computed half and mirrored; at the horizon and below it is 0.
        """
        work: type = np.float32 if out.dtype == np.float32 and self._single() else np.float64
        coefficients, mapping, _ = self._fit(work)
        half = np.cos(0.5 * phi)
        squares64 = np.zeros(-(-phi.size // LANES) * LANES)
        squares64[: phi.size] = 2.0 * half * half
        constants = np.array([1.0, self._model[3], *mapping], dtype=work)
        _fill(
            theta_i,
            theta_o,
            self._setup.alpha_x,
            square,
            self._model,
            squares64.astype(work),
            squares64,
            constants,
            coefficients.astype(work),
            can_stream(out, phi.size * len(self._setup.channels)),
            phi.size,
            out.reshape(-1),
        )


def build(setup: Setup, masking: int, tolerance: float) -> SingleBounceTable | None:
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
    table = SingleBounceTable(setup, masking, tolerance)
    return table if table.holds() else None
