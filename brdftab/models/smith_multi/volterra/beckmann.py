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
from brdftab.models.smith_multi.volterra.beckmann_fit import Fit, fit, local
from brdftab.models.smith_multi.volterra.beckmann_terms import global_term, local_term, local_values, pair
from brdftab.models.smith_multi.volterra.bessel import (
    INTEGERS,
    SPLIT,
    debye,
    exponent_series,
    integer_order,
    miller,
    order_series,
    small,
)

__all__ = ["Fit", "fit", "largest_mode", "modes", "pairs", "reach", "weight"]

# bounces whose modes a table must hold
BOUNCES = 2.0
# listed pairs that a thread takes at a time
BLOCK = 256


@kernel
def _add(front, tilt, a2, u0, u1, u2, first, last, out):
    """Add one term of one order to out (W, B)."""
    for b in range(first, last):
        up = 1.0 + tilt[b]
        u0[b] = up * up * u0[b] + a2[b] * (2.0 * up * u1[b] + a2[b] * u2[b])
    for w in range(out.shape[0]):
        factor, row = front[w], out[w]
        for b in range(first, last):
            row[b] += factor[b] * u0[b]


@kernel
def _run(orders, tables, bend, branch, first, last, kappa, tilt, a2, front, work, out):
    """Add all orders of one term at first:last, which share the branch; out (W, M, B)."""
    series, width, lowest = tables
    ratio, rows, u0, u1, u2 = work
    top = rows.shape[0] - 2
    if branch == 1 and top >= 0:
        miller(kappa, first, last, top, ratio, rows)
    for i in range(orders.size):
        nu = orders[i]
        while first < last and kappa[first] < lowest[i]:
            first += 1
        while first < last and kappa[last - 1] < lowest[i]:
            last -= 1
        if first == last:
            break
        if branch == 1 and nu <= top and nu == int(nu):
            integer_order(int(nu), kappa, first, last, rows, u0, u1, u2)
        elif branch == 1 and nu < SPLIT:
            for b in range(first, last):
                u0[b], u1[b], u2[b] = small(nu, kappa[b])
        else:
            debye(nu, series[i], width[i], bend, kappa, first, last, u0, u1, u2)
        _add(front, tilt, a2, u0, u1, u2, first, last, out[:, i])


@kernel
def _fill(cross, dz2, tilt, orders, top, tables, bend, alpha, depth, spread, near, out):
    """Fill out (W, M, B) with the modes of pairs; `spread`, `near`: its exponentials for all X or from `local`."""
    size, waves = cross.size, out.shape[0]
    scales, coefficients = spread
    rates, times, matrix, kind, fa, fb = near
    scratch = np.empty((5, size))
    kappa, a2 = scratch[0], scratch[1]
    work = (np.empty((top + 2, size)), np.empty((top + 2, size)), scratch[2], scratch[3], scratch[4])
    branch = np.zeros(size, np.int64)
    front, values = np.empty((waves, size)), np.empty((times.size, waves, size))
    for w in range(waves):
        for i in range(out.shape[1]):
            for b in range(size):
                out[w, i, b] = 0.0
    local_values(times, kind, fa, fb, alpha, cross, dz2, tilt, values)
    for j in range(max(rates.size, scales.size)):
        if rates.size > 0:
            local_term(rates[j], matrix[j], alpha, cross, dz2, tilt, values, kappa, a2, branch, front)
        else:
            global_term(scales[j], coefficients[j], alpha, depth, cross, dz2, tilt, kappa, a2, branch, front)
        last = 0
        while last < size:
            first = last
            while last < size and branch[last] == branch[first]:
                last += 1
            if branch[first] > 0:
                _run(orders, tables, bend, branch[first], first, last, kappa, tilt, a2, front, work, out)


@parallel_kernel
def _modes(beta_a, beta_b, block, orders, top, tables, bend, alpha, depth, spread, near, out):
    """Fill out (W, M, R, N) for pairs beta_a, beta_b (R, N), `block` pairs of a row at a time."""
    rows, blocks = beta_a.shape[0], (beta_a.shape[1] + block - 1) // block
    for n in numba.prange(rows * blocks):
        # threads get blocks of n: even rows first, then odd ones, so that short and long rows are shared evenly
        r = n // blocks
        r = 2 * r if 2 * r < rows else 2 * (rows - r) - 1
        first = (n % blocks) * block
        last = min(first + block, beta_a.shape[1])
        seen = np.empty((3, last - first))
        for b in range(last - first):
            seen[0, b], seen[1, b], seen[2, b] = pair(beta_a[r, first + b], beta_b[r, first + b])
        _fill(
            seen[0], seen[1], seen[2], orders, top, tables, bend, alpha, depth, spread, near, out[:, :, r, first:last]
        )


def _arguments(orders: np.ndarray, alpha: float, fitted: Fit) -> tuple[Any, ...]:
    """Return what the kernels need of orders, roughness and reflectance."""
    whole = orders[(orders < INTEGERS) & (orders == np.floor(orders))]
    top = int(whole.max()) if whole.size else -1
    bend = tuple(float(c) for c in exponent_series())
    close = local(fitted, alpha)
    near = (close.rates, close.times, close.matrix, fitted.kind, fitted.a, fitted.b)
    scales, coefficients = np.zeros(0), np.zeros((0, fitted.constant.size))
    if close.rates.size == 0:
        scales = np.concatenate([[0.0], fitted.scales])
        coefficients = np.concatenate([fitted.constant[None], fitted.coefficients.T])
    tables = order_series(tuple(orders.tolist()), fitted.depth)
    return orders, top, tables, bend, alpha, fitted.depth, (scales, coefficients), near


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
    before, after = np.repeat(beta_a[:, None], beta_b.size, axis=1), np.repeat(beta_b[None], beta_a.size, axis=0)
    _modes(before, after, max(beta_b.size, 1), *_arguments(orders, alpha, fitted), out)


def pairs(
    beta_a: np.ndarray, beta_b: np.ndarray, orders: np.ndarray, alpha: float, fitted: Fit, out: np.ndarray
) -> None:
    """Fill out (W, M, N) with the modes of N listed pairs; otherwise as `modes`."""
    lists = np.ascontiguousarray(beta_a)[None], np.ascontiguousarray(beta_b)[None]
    _modes(*lists, BLOCK, *_arguments(orders, alpha, fitted), out[:, :, None])


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
