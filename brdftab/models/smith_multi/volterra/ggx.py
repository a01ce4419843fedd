"""Azimuth modes of the GGX scattering kernel in closed form, for real orders.

With X = |d' - d|^2 = u + 2 s s' (1 - cos phi), u = 4 sin^2((beta' - beta)/2), the kernel F D/4 is
a^2/(4 pi) F(X) X^2/(X - b)^2, b = (1 - a^2) (d'_z - d_z)^2 = u (1 - a^2) cos^2((beta' + beta)/2). Partial fractions of
F = f0 + sum f_j/(X + x_j) leave Poisson kernels, whose modes are exp(-m eta)/S and its derivative:

    K_m = a^2/(4 pi) [f0 delta_m0 + exp(-m eta) (G/S + A (m/S^2 + C/S^3))
          + sum_j f_j (x_j/(x_j + b))^2 exp(-m eta_j)/S_j],
    A = b^2 F(b), G = 2 b F(b) + b^2 F'(b), c = u - b, C = c + 2 s s', S^2 = c (c + 4 s s'),
    eta = 2 asinh(sqrt(c/(s s'))/2), and S_j, eta_j the same with u + x_j in place of c.

Here K = sum_m (2 - delta_m0) K_m cos(m psi), psi = 0 where d and d' have the same azimuth.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.single_bounce.single_rows import exponential, log_one_plus
from brdftab.models.smith_multi.volterra.poles import Fit, fit

__all__ = ["Fit", "fit", "modes", "pairs", "reach", "weight"]

# exponents are cut here: exp(-200) is nothing, and products of three such numbers still are normal numbers
DEEPEST = 200.0
# a pole's own modes end here, relative to 1
POLE_DEPTH = 45.0
# above alpha = 1 b is negative: a pole nearer to -b than this part of it is replaced by two at either side
NEAR = 0.002
# listed pairs in a row of the kernel
BLOCK = 64
# half a difference of angles is taken as at least this, so that equal directions give 0 and not 0/0
LEAST = 1e-120


@kernel
def _decay(c, ss):
    """Return eta = 2 asinh(sqrt(c/ss)/2), without cancellation; vectorises."""
    y = 0.5 * math.sqrt(c / ss)
    return 2.0 * log_one_plus(y + y * y / (1.0 + math.sqrt(1.0 + y * y)))


@kernel
def _frame(a2, sine, mean, ss, count, g):
    """Fill rows u, b, c, ss, eta and S of g from sin((b' - b)/2), sin((b' + b)/2) and s s'."""
    for n in range(count):
        u = 4.0 * max(sine[n], LEAST) ** 2
        flat = mean[n] * mean[n]
        up = 1.0 - flat
        c = u * (flat + a2 * up)
        p = max(ss[n], 1e-300)
        g[0, n], g[1, n], g[2, n], g[3, n] = u, u * (1.0 - a2) * up, c, p
        g[4, n] = _decay(c, p)
        g[5, n] = math.sqrt(c * (c + 4.0 * p))


@kernel
def _aside(x, g, count, shift):
    """Write how far to move a pole that all but cancels b to either side, so that partial fractions keep digits."""
    for n in range(count):
        shift[n] = 2.0 * NEAR * x if abs(g[1, n] + x) < NEAR * x else 0.0


@kernel
def _main_terms(a2, constant, coefficients, scales, count, g, p, q, value, slope, shift):
    """Fill p, q (W, count): the main part of K_m is exp(-m eta) (p + m q)."""
    front = a2 / (4.0 * math.pi)
    sides = 2 if a2 > 1.0 else 1
    for n in range(count):
        shift[n] = 0.0
    for w in range(constant.size):
        for n in range(count):
            value[n], slope[n] = constant[w], 0.0
        for j in range(scales.size):
            f, x = coefficients[w, j] / sides, scales[j]
            if sides == 2:
                _aside(x, g, count, shift)
            for side in range(sides):
                sign = 1.0 - 2.0 * side
                for n in range(count):
                    r = 1.0 / (g[1, n] + x + sign * shift[n])
                    value[n] += f * r
                    slope[n] -= f * r * r
        for n in range(count):
            b, one = g[1, n], 1.0 / g[5, n]
            big = b * b * value[n]
            wide = g[2, n] + 2.0 * g[3, n]
            p[w, n] = front * one * (2.0 * b * value[n] + b * b * slope[n] + big * wide * one * one)
            q[w, n] = front * big * one * one


@kernel
def _pole(a2, orders, coefficients, x, count, g, sign, part, value, out):
    """Add the modes of one pole, with coefficients (W,), moved by sign times part[2]."""
    front, least = a2 / (4.0 * math.pi), math.inf
    for n in range(count):
        moved = x + sign * part[2, n]
        c = g[0, n] + moved
        ratio = moved / (moved + g[1, n])
        part[0, n] = _decay(c, g[3, n])
        part[1, n] = front * ratio * ratio / math.sqrt(c * (c + 4.0 * g[3, n]))
    for n in range(count):
        least = min(least, part[0, n])
    for k in range(orders.size):
        m = orders[k]
        if m * least > POLE_DEPTH:
            break
        for n in range(count):
            value[n] = part[1, n] * exponential(-min(m * part[0, n], DEEPEST))
        for w in range(coefficients.size):
            f = coefficients[w]
            for n in range(count):
                out[w, k, n] += f * value[n]


@kernel
def _row(a2, orders, constant, coefficients, scales, count, g, p, q, part, value, slope, out):
    """Fill out (W, M, count) with all modes of a row of pairs whose frame is g."""
    front = a2 / (4.0 * math.pi)
    _main_terms(a2, constant, coefficients, scales, count, g, p, q, value, slope, part[2])
    for k in range(orders.size):
        m = orders[k]
        for n in range(count):
            value[n] = exponential(-min(m * g[4, n], DEEPEST))
        for w in range(constant.size):
            add = front * constant[w] if m == 0.0 else 0.0
            for n in range(count):
                out[w, k, n] = value[n] * (p[w, n] + m * q[w, n]) + add
    for n in range(count):
        part[2, n] = 0.0
    for j in range(scales.size):
        if a2 > 1.0:
            _aside(scales[j], g, count, part[2])
            half = 0.5 * coefficients[:, j]
            _pole(a2, orders, half, scales[j], count, g, 1.0, part, value, out)
            _pole(a2, orders, half, scales[j], count, g, -1.0, part, value, out)
        else:
            _pole(a2, orders, 1.0 * coefficients[:, j], scales[j], count, g, 0.0, part, value, out)


@kernel
def _scratch(size, count):
    """Return the working rows of `_row`."""
    rows = np.empty((6, count)), np.empty((size, count)), np.empty((size, count)), np.empty((3, count))
    return rows[0], rows[1], rows[2], rows[3], np.empty(count), np.empty(count)


@parallel_kernel
def _modes(half_a, half_b, paired, a2, orders, constant, coefficients, scales, out):
    """Fill out (W, M, A, B); the directions are (4, A, 1) and (4, 1, B), or all (4, A, B) if they are paired."""
    count = half_b.shape[2]
    size = constant.size
    # pairs and lists of directions share this kernel, as it takes long to compile
    for i in numba.prange(half_a.shape[1]):
        row = np.int64(i) if paired else np.int64(0)
        first = 0
        if not paired:
            # the betas increase, so that those above d_z come last
            while first < count and half_b[2, 0, first] <= half_a[2, i, 0]:
                first += 1
        left = count - first
        for w in range(size):
            for k in range(orders.size):
                for n in range(first):
                    out[w, k, i, n] = 0.0
        if left == 0:
            continue
        sine, mean, ss = np.empty(left), np.empty(left), np.empty(left)
        sa, ca, ra = half_a[0, i, 0], half_a[1, i, 0], half_a[3, i, 0]
        for n in range(left):
            if paired:
                sa, ca, ra = half_a[0, i, n], half_a[1, i, n], half_a[3, i, n]
            sb, cb = half_b[0, row, first + n], half_b[1, row, first + n]
            sine[n] = sb * ca - cb * sa
            mean[n] = sb * ca + cb * sa
            ss[n] = ra * half_b[3, row, first + n]
        g, p, q, part, value, slope = _scratch(size, left)
        _frame(a2, sine, mean, ss, left, g)
        _row(a2, orders, constant, coefficients, scales, left, g, p, q, part, value, slope, out[:, :, i, first:])


def _halves(beta: np.ndarray) -> np.ndarray:
    """Return sine and cosine of beta/2, sine and cosine of beta, (4, N)."""
    return np.stack([np.sin(0.5 * beta), np.cos(0.5 * beta), np.sin(beta), np.cos(beta)])


def modes(
    beta_a: np.ndarray, beta_b: np.ndarray, orders: np.ndarray, alpha: float, fitted: Fit, out: np.ndarray
) -> None:
    """Fill out with the azimuth modes of the kernel between all pairs of two lists of directions.

    Parameters
    ----------
    beta_a, beta_b : ndarray (A,), (B,)
        asin of d_z before and after, radians; beta_b increasing.
    orders : ndarray (M,)
        Real orders >= 0, increasing.
    alpha : float
        Roughness.
    fitted : Fit
        The reflectance.
    out : ndarray (W, M, A, B)
        Where to write K_m, 1/sr; 0 where d_z does not increase.
    """
    surface = (alpha * alpha, orders, fitted.constant, fitted.coefficients, fitted.scales)
    _modes(_halves(beta_a)[:, :, None], _halves(beta_b)[:, None], False, *surface, out)


def pairs(
    beta_a: np.ndarray, beta_b: np.ndarray, orders: np.ndarray, alpha: float, fitted: Fit, out: np.ndarray
) -> None:
    """Fill out (W, M, N) with the modes of N listed pairs, beta_b > beta_a; otherwise as `modes`."""
    surface = (alpha * alpha, orders, fitted.constant, fitted.coefficients, fitted.scales)
    rows = -(-beta_a.size // BLOCK)
    # padded by repeating the last pair
    place = np.minimum(np.arange(rows * BLOCK), beta_a.size - 1).reshape(rows, BLOCK)
    found = np.empty((*out.shape[:2], rows, BLOCK))
    _modes(_halves(beta_a[place]), _halves(beta_b[place]), True, *surface, found)
    out[:] = found.reshape(*out.shape[:2], -1)[:, :, : beta_a.size]


def reach(alpha: float, beta_a: np.ndarray, beta_b: np.ndarray, decay: float) -> np.ndarray:
    """Return the order beyond which K_m from depression beta_a to elevation beta_b is below exp(-decay)."""
    u = 4.0 * np.sin(0.5 * (beta_a + beta_b)) ** 2
    flat = np.sin(0.5 * (beta_b - beta_a)) ** 2
    c = u * (flat + alpha * alpha * (1.0 - flat))
    ss = np.maximum(np.cos(beta_a) * np.cos(beta_b), 1e-300)
    return decay / (2.0 * np.arcsinh(0.5 * np.sqrt(c / ss)))


def weight(beta: np.ndarray, alpha: float) -> np.ndarray:
    """Return 1/(|d_z| (1 + Lambda(|d_z|))) at asin d_z = beta; finite at the horizon."""
    t = np.abs(np.sin(beta))
    return 2.0 / (t + np.hypot(t, alpha * np.cos(beta)))
