"""Azimuth modes of the Beckmann kernel K = F D(h)/4 in closed form.

With d_z = sin(beta), mid = (beta + beta')/2, B = 2 cos(beta) cos(beta'), dz = sin(beta') - sin(beta), X = |d' - d|^2,
the half vector's tan^2 is tan^2(mid) + B (1 - cos phi)/dz^2, so that with kappa = B/(alpha dz)^2

    K = F(X) exp(-tan^2(mid)/alpha^2) exp(-kappa (1 - cos phi)) (X/dz^2)^2/(4 pi alpha^2),
    X/dz^2 = 1/cos^2(mid) + alpha^2 kappa (1 - cos phi).

Its modes K_m = (1/2 pi) int K cos(m phi) dphi follow from exp(-kappa) I_m(kappa) and two derivatives (bessel.py). A
term exp(-y X) of the reflectance is the same kernel with 1/alpha^2 + y dz^2 in place of 1/alpha^2, times exp(-y dz^2).
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models.smith_multi.volterra.beckmann_fit import Fit, fit
from brdftab.models.smith_multi.volterra.bessel import (
    INTEGERS,
    SPLIT,
    debye,
    exponent_series,
    integer_order,
    kept_series,
    miller,
    small,
)

__all__ = ["Fit", "fit", "largest_mode", "modes", "pairs", "reach", "weight"]

# pairs below exp(-FAINTEST) are nothing, and products of three such numbers still are normal numbers
FAINTEST = 200.0
# bounces whose modes a table must hold
BOUNCES = 2.0


@kernel
def _pair(beta_a, beta_b):
    """Return B = 2 cos cos', dz^2 and tan^2(mid) of a pair; dz = 0 where z does not rise."""
    cm = math.cos(0.5 * (beta_a + beta_b))
    dz = 2.0 * cm * math.sin(0.5 * (beta_b - beta_a))
    c2 = cm * cm
    rise = dz * dz if math.sin(beta_b) > math.sin(beta_a) else 0.0
    return 2.0 * math.cos(beta_a) * math.cos(beta_b), rise, (1.0 - c2) / c2


@kernel
def _exponential_term(y, alpha, depth, cross, dz2, tilt, kappa, scale, a2, road):
    """Fill kappa, all factors but the modes, and alpha^2 with exp(-y X) in it.

    road: 0 where the term does not count, 1 where kappa < 25, 2 above.
    """
    wide = 1.0 / (alpha * alpha)
    for b in range(cross.size):
        road[b] = 0
        lost = y * dz2[b]
        narrow = wide + lost
        e = tilt[b] * narrow + lost
        if dz2[b] > 0.0 and lost < depth and e < FAINTEST:
            a2[b] = 1.0 / narrow
            kappa[b] = cross[b] * narrow / dz2[b]
            scale[b] = math.exp(-e) * wide / (4.0 * math.pi)
            road[b] = 2 if kappa[b] >= SPLIT else 1


@kernel
def _add(coefficients, scale, tilt, a2, u0, u1, u2, first, last, out):
    """Add one term of one order to out (W, B)."""
    for b in range(first, last):
        up = 1.0 + tilt[b]
        u0[b] = scale[b] * (up * up * u0[b] + a2[b] * (2.0 * up * u1[b] + a2[b] * u2[b]))
    for w in range(coefficients.size):
        c, row = coefficients[w], out[w]
        for b in range(first, last):
            row[b] += c * u0[b]


@kernel
def _run(orders, tables, bend, road, first, last, kappa, scale, tilt, a2, coefficients, work, out):
    """Add all orders of one term at first:last, which share the road; out (W, M, B)."""
    series, width, lowest = tables
    ratio, rows, u0, u1, u2 = work
    top = rows.shape[0] - 2
    if road == 1 and top >= 0:
        miller(kappa, first, last, top, ratio, rows)
    for i in range(orders.size):
        nu = orders[i]
        while first < last and kappa[first] < lowest[i]:
            first += 1
        while first < last and kappa[last - 1] < lowest[i]:
            last -= 1
        if first == last:
            break
        if road == 1 and nu <= top and nu == int(nu):
            integer_order(int(nu), kappa, first, last, rows, u0, u1, u2)
        elif road == 1 and nu < SPLIT:
            for b in range(first, last):
                u0[b], u1[b], u2[b] = small(nu, kappa[b])
        else:
            debye(nu, series[i], width[i], bend, kappa, first, last, u0, u1, u2)
        _add(coefficients, scale, tilt, a2, u0, u1, u2, first, last, out[:, i])


@kernel
def _fill(cross, dz2, tilt, orders, top, tables, bend, alpha, depth, scales, coefficients, out):
    """Fill out (W, M, B) with all modes of pairs; coefficients (J, W) belong to scales (J,)."""
    size = cross.size
    scratch = np.empty((6, size))
    kappa, scale, a2 = scratch[0], scratch[1], scratch[2]
    work = (np.empty((top + 2, size)), np.empty((top + 2, size)), scratch[3], scratch[4], scratch[5])
    road = np.zeros(size, np.int64)
    for w in range(out.shape[0]):
        for i in range(out.shape[1]):
            for b in range(size):
                out[w, i, b] = 0.0
    for j in range(scales.size):
        _exponential_term(scales[j], alpha, depth, cross, dz2, tilt, kappa, scale, a2, road)
        first = 0
        while first < size:
            last = first + 1
            while last < size and road[last] == road[first]:
                last += 1
            if road[first] > 0:
                _run(orders, tables, bend, road[first], first, last, kappa, scale, tilt, a2, coefficients[j], work, out)
            first = last


@parallel_kernel
def _modes(beta_a, beta_b, orders, top, tables, bend, alpha, depth, scales, coefficients, out):
    count = beta_a.size
    for n in numba.prange(count):
        # threads get blocks of n: even rows first, then odd ones, so that short and long rows are shared evenly
        a = 2 * n if 2 * n < count else 2 * (count - n) - 1
        pair = np.empty((3, beta_b.size))
        for b in range(beta_b.size):
            pair[0, b], pair[1, b], pair[2, b] = _pair(beta_a[a], beta_b[b])
        _fill(pair[0], pair[1], pair[2], orders, top, tables, bend, alpha, depth, scales, coefficients, out[:, :, a])


@parallel_kernel
def _pairs(beta_a, beta_b, orders, top, tables, bend, alpha, depth, scales, coefficients, block, out):
    for n in numba.prange((beta_a.size + block - 1) // block):
        first = np.int64(n) * block
        size = min(block, beta_a.size - first)
        pair = np.empty((3, size))
        for b in range(size):
            pair[0, b], pair[1, b], pair[2, b] = _pair(beta_a[first + b], beta_b[first + b])
        _fill(
            pair[0], pair[1], pair[2], orders, top, tables, bend, alpha, depth, scales, coefficients,
            out[:, :, first : first + size],
        )  # fmt: skip


def _arguments(orders: np.ndarray, alpha: float, fitted: Fit) -> tuple[Any, ...]:
    """Return what the kernels need of orders, roughness and reflectance."""
    whole = orders[(orders < INTEGERS) & (orders == np.floor(orders))]
    top = int(whole.max()) if whole.size else -1
    scales = np.concatenate([[0.0], fitted.scales])
    coefficients = np.concatenate([fitted.constant[None], fitted.coefficients.T])
    bend = tuple(float(c) for c in exponent_series())
    return orders, top, kept_series(orders, fitted.depth), bend, alpha, fitted.depth, scales, coefficients


def modes(
    beta_a: np.ndarray, beta_b: np.ndarray, orders: np.ndarray, alpha: float, fitted: Fit, out: np.ndarray
) -> None:
    """Fill out with the azimuth modes of the kernel between all pairs of two lists of directions.

    Parameters
    ----------
    beta_a, beta_b : ndarray (A,), (B,)
        asin of d_z before and after, radians; fastest where beta_b increases.
    orders : ndarray (M,)
        Real orders >= 0, increasing.
    alpha : float
        Roughness.
    fitted : Fit
        The reflectance.
    out : ndarray (W, M, A, B)
        Where to write K_m, 1/sr; 0 where d_z does not increase.
    """
    _modes(beta_a, beta_b, *_arguments(orders, alpha, fitted), out)


def pairs(
    beta_a: np.ndarray, beta_b: np.ndarray, orders: np.ndarray, alpha: float, fitted: Fit, out: np.ndarray
) -> None:
    """Fill out (W, M, N) with the modes of N listed pairs; otherwise as `modes`."""
    _pairs(beta_a, beta_b, *_arguments(orders, alpha, fitted), 256, out)


def reach(alpha: float, beta_a: np.ndarray, beta_b: np.ndarray, decay: float) -> np.ndarray:
    """Return the order beyond which the modes of light from depression beta_a to elevation beta_b are negligible.

    One bounce has J_m/J_0 <= exp(-m^2/(2 (kappa + m/3))) (Bennett's inequality for the exponent) and 1/kappa = rise^2
    alpha^2/B; BOUNCES that share the rise have that many times its kappa.
    """
    rise = 2.0 * np.sin(0.5 * (beta_a + beta_b)) * np.cos(0.5 * (beta_b - beta_a))
    kappa = BOUNCES * 2.0 * np.cos(beta_a) * np.cos(beta_b) / (alpha * rise) ** 2
    return decay / 3.0 + np.sqrt(decay * decay / 9.0 + 2.0 * decay * kappa)


def largest_mode(alpha: float, beta: float, decay: float) -> float:
    """Return how many azimuth modes a table needs whose smallest elevation is beta (radians)."""
    return float(reach(alpha, np.array(beta), np.array(beta), decay))


def weight(beta: np.ndarray, alpha: float) -> np.ndarray:
    """Return 1/(|d_z| (1 + Lambda(|d_z|))) at asin d_z = beta; finite at the horizon.

    |d_z| (1 + Lambda) = |d_z| (1 + erf v)/2 + alpha cos(beta) exp(-v^2)/(2 sqrt(pi)) with v = tan|beta|/alpha: a sum of
    positive terms (Heitz 2014, Eq. 66, with the factor |d_z|).
    """
    beta = np.abs(np.asarray(beta, dtype=np.float64))
    v = np.tan(beta) / alpha
    erf = np.vectorize(math.erf, otypes=[np.float64])(v)
    gauss = np.exp(-(np.minimum(v, 30.0) ** 2))
    return 1.0 / (0.5 * np.sin(beta) * (1.0 + erf) + 0.5 * alpha / math.sqrt(math.pi) * np.cos(beta) * gauss)
