"""Scaled modified Bessel functions of real order and their first two derivatives, for rows of arguments.

J = exp(-kappa) I_nu(kappa), u1 = -kappa J' and u2 = kappa^2 J'': the azimuth modes of exp(-kappa (1 - cos phi)) times
1, kappa (1 - cos phi) and its square. All three are computed without the cancellation of I - I' (they differ in the
digit 1/kappa), so that kappa may be 1e12 and more. By hand, for SciPy's ive cancels there and is no part of a kernel.

Two ways, split at kappa = 25:
- the uniform (Debye) expansion in 1/r, r = sqrt(nu^2 + kappa^2) (NIST DLMF 10.41.3 with 10.41.10), as a series of its
  logarithm; it holds for kappa >= 25 at any order and for nu >= 25 at any kappa. At a fixed order its sums depend on
  1/r alone: three polynomials an order;
- integer orders at kappa < 25: the continued fraction of I_m/I_{m-1} from above (Miller; all terms positive), with the
  sum of all modes = 1 as norm; other orders at kappa < 25, nu < 25: the power series (DLMF 10.25.2).
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache

import numpy as np

from brdftab.jit import kernel
from brdftab.models._shared.single_bounce.single_rows import exponential

ROOT = 1.0 / math.sqrt(2.0 * math.pi)
SPLIT = 25.0
DEPTH = 36.0
INTEGERS = 32
TERMS = 14
DEGREE = 10
NODES = 26
STEEPEST = 0.8


@lru_cache(maxsize=1)
def _log_debye() -> np.ndarray:
    """Return T (TERMS + 1, TERMS + 1): log of the Debye sum = sum_k rho^k sum_j T[k, j] q^j, q = (nu rho)^2."""
    sums: list[dict[int, Fraction]] = [{0: Fraction(1)}]
    for _ in range(TERMS):
        grown: dict[int, Fraction] = {}
        for e, c in sums[-1].items():
            for power, x in ((e + 1, c * e / 2 + c / (8 * (e + 1))), (e + 3, -c * e / 2 - 5 * c / (8 * (e + 3)))):
                grown[power] = grown.get(power, Fraction(0)) + x
        sums.append(grown)
    logs: list[dict[int, Fraction]] = [{}]
    for k in range(1, TERMS + 1):
        total = dict(sums[k])
        for j in range(1, k):
            for e, c in logs[j].items():
                for f, d in sums[k - j].items():
                    total[e + f] = total.get(e + f, Fraction(0)) - c * d * Fraction(j, k)
        logs.append(total)
    table = np.zeros((TERMS + 1, TERMS + 1))
    for k, series in enumerate(logs):
        for e, c in series.items():
            table[k, (e - k) // 2] = float(c)
    return table


def decay(nu: np.ndarray | float, kappa: np.ndarray | float) -> np.ndarray:
    """Return E = r - kappa - nu asinh(nu/kappa) <= 0: J is about exp(E)/sqrt(2 pi r)."""
    tau = nu / (kappa + np.hypot(nu, kappa))
    return nu * (tau - 2.0 * np.arctanh(tau))


def _monomials(series: np.ndarray) -> np.ndarray:
    """Return coefficients in x of Chebyshev series on 0 <= x <= 1, along the last axis."""
    size = series.shape[-1]
    turn = np.zeros((size, size))
    for n in range(size):
        poly = np.polynomial.Chebyshev.basis(n, domain=[0.0, 1.0]).convert(kind=np.polynomial.Polynomial)
        turn[n, : n + 1] = poly.coef
    return series @ turn


@lru_cache(maxsize=1)
def exponent_series() -> np.ndarray:
    """Return P, a polynomial in tau^2, with E = -nu tau P(tau^2) and tau = nu/(kappa + r) up to STEEPEST.

    Weighted by the effect on exp(E) at the orders >= 25 that reach so far: 6e-16.
    """
    x = 0.5 * (1.0 - np.cos(np.pi * (np.arange(400) + 0.5) / 400))
    tau = STEEPEST * np.sqrt(x)
    exact = 2.0 * np.arctanh(tau) / tau - 1.0
    depth = np.maximum(SPLIT * tau * exact, 1.0)
    weight = depth * np.exp(-depth)
    basis = np.polynomial.chebyshev.chebvander(2.0 * x - 1.0, 12)
    found = np.linalg.lstsq(basis * weight[:, None], exact * weight, rcond=None)[0]
    return _monomials(found) / STEEPEST ** (2.0 * np.arange(13))


def lowest_kappa(nu: np.ndarray, depth: float = DEPTH) -> np.ndarray:
    """Return the kappa below which exp(E) < exp(-depth), so that the order counts as zero; 0 for order 0."""
    nu = np.asarray(nu, dtype=np.float64)
    safe = np.maximum(nu, 1e-300)
    limit = np.where(nu < SPLIT, 1.0 - 1e-9, STEEPEST)
    low, high = np.zeros_like(safe), limit.copy()
    for _ in range(60):
        tau = 0.5 * (low + high)
        inside = safe * (2.0 * np.arctanh(tau) - tau) < depth
        low, high = np.where(inside, tau, low), np.where(inside, high, tau)
    found = safe * (1.0 - low * low) / (2.0 * low)
    return np.where((nu < SPLIT) & (low > 0.99 * limit), 0.0, found)


@lru_cache(maxsize=64)
def order_series(orders: tuple[float, ...], depth: float = DEPTH) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what `debye` needs of each order; kept, since a table asks for the same orders again and again.

    Parameters
    ----------
    orders : tuple of float (M,)
        Real orders >= 0.
    depth : float
        exp(-depth) counts as zero.

    Returns
    -------
    series : float64 (M, 3, DEGREE + 1)
        C = log of the Debye sum, G = -kappa dC/dkappa and H = kappa dG/dkappa, each divided by t = width/r, as
        polynomials in t.
    width : float64 (M,)
        The smallest r of the order.
    lowest : float64 (M,)
        The smallest kappa at which the order counts.
    """
    nu = np.array(orders, dtype=np.float64)
    lowest = lowest_kappa(nu, depth)
    start = np.where(nu < SPLIT, SPLIT, lowest)
    width = np.hypot(nu, start)
    x = 0.5 * (1.0 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES))
    rho = x / width[:, None]
    q = np.minimum((nu[:, None] * rho) ** 2, 1.0)
    kappa = np.sqrt(1.0 - q) / rho
    table = _log_debye()
    k = np.arange(TERMS + 1)
    slope = 2.0 * k + k[:, None]
    powers_q, powers_rho = q[..., None] ** k, rho[..., None] ** k
    c, w, z = (np.sum((powers_q @ t.T) * powers_rho, axis=-1) for t in (table, table * slope, table * slope**2))
    g, h = (1.0 - q) * w, 2.0 * q * (1.0 - q) * w - (1.0 - q) ** 2 * z
    # digits where the order is all but gone serve nobody
    weight = np.exp(0.8 * np.maximum(decay(nu[:, None], np.maximum(kappa, 1e-3 * start[:, None])), -depth))
    powers = x[:, None] * np.polynomial.chebyshev.chebvander(2.0 * x - 1.0, DEGREE)
    basis, upper = np.linalg.qr(powers * weight[..., None])
    sides = np.swapaxes(basis, 1, 2) @ (np.stack([c, g, h], axis=-1) * weight[..., None])
    return _monomials(np.swapaxes(np.linalg.solve(upper, sides), 1, 2)), width, lowest


@kernel
def _sum_11(c, t):
    return ((((((((((c[10] * t + c[9]) * t + c[8]) * t + c[7]) * t + c[6]) * t + c[5]) * t + c[4]) * t + c[3]) * t
            + c[2]) * t + c[1]) * t + c[0])  # fmt: skip


@kernel
def _eleven(c):
    return c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10]


@kernel
def debye(nu, series, width, bend, kappa, first, last, u0, u1, u2):
    """Write J, u1, u2 of one order at kappa[first:last] by the uniform expansion.

    `series`, `width` are the order's part of `order_series`, `bend` is `exponent_series()` as a tuple. The loop has
    neither branches nor calls into a library, so that it vectorises.
    """
    c, g, h = _eleven(series[0]), _eleven(series[1]), _eleven(series[2])
    for b in range(first, last):
        ka = kappa[b]
        r = math.sqrt(nu * nu + ka * ka)
        rho = 1.0 / r
        tau = nu / (ka + r)
        x = tau * tau
        depth = nu * tau
        bent = _sum_11(bend[:11], x)
        x2 = x * x
        x4 = x2 * x2
        bent += (bend[12] * x + bend[11]) * (x4 * x4 * x2 * x)
        t = width * rho
        e = exponential(max(t * _sum_11(c, t) - depth * bent, -300.0)) * math.sqrt(rho) * ROOT
        share = (nu * rho) * (nu * rho)
        rest = (ka * rho) * (ka * rho)
        steep = t * _sum_11(g, t) + 0.5 * rest - depth
        u0[b] = e
        u1[b] = e * steep
        u2[b] = e * (steep * steep + steep - depth * (ka * rho) - share * rest - t * _sum_11(h, t))


@kernel
def miller(kappa, first, last, top, ratio, rows):
    """Write rows[m, first:last] = J_m for m = 0 .. top + 1 at 0 <= kappa < 25; `ratio` is scratch of the same shape.

    I_m/I_(m-1) = kappa/(2 m + kappa I_(m+1)/I_m) from so far above that the start does not count.
    """
    most = 0.0
    for b in range(first, last):
        most = max(most, kappa[b])
        ratio[0, b] = 0.0
        rows[0, b] = 0.0
    start = max(int(14.0 + 9.0 * math.sqrt(most)), top + 2)
    for m in range(start, 0, -1):
        keep = min(m, top + 1)
        above = 0 if m > top else m + 1
        for b in range(first, last):
            r = kappa[b] / (2.0 * m + kappa[b] * ratio[above, b])
            rows[0, b] = r * (1.0 + rows[0, b])
            ratio[0, b] = r
            ratio[keep, b] = r
    for b in range(first, last):
        rows[0, b] = 1.0 / (1.0 + 2.0 * rows[0, b])
    for m in range(1, top + 2):
        for b in range(first, last):
            rows[m, b] = rows[m - 1, b] * ratio[m, b]


@kernel
def integer_order(m, kappa, first, last, rows, u0, u1, u2):
    """Write J, u1, u2 of an integer order at kappa[first:last] < 25 from the rows of `miller`."""
    below, above = abs(m - 1), m + 1
    for b in range(first, last):
        ka = kappa[b]
        u0[b] = rows[m, b]
        u1[b] = ka * (rows[m, b] - 0.5 * (rows[below, b] + rows[above, b]))
        # Bessel's equation; loses kappa^2 units in the last place, 1e-13 here
        u2[b] = (2.0 * ka + 1.0) * u1[b] - (ka - m * m) * u0[b]


@kernel
def small(nu, ka):
    """Return J, u1, u2 of a real order at 0 <= kappa < 25 by the power series."""
    if ka == 0.0:
        return (1.0 if nu == 0.0 else 0.0), 0.0, 0.0
    term = math.exp(nu * math.log(0.5 * ka) - math.lgamma(nu + 1.0) - ka)
    total, moment, k = term, nu * term, 0
    while term > 1e-18 * total:
        k += 1
        term *= 0.25 * ka * ka / (k * (nu + k))
        total += term
        moment += (2.0 * k + nu) * term
    slope = ka * total - moment
    return total, slope, (2.0 * ka + 1.0) * slope - (ka - nu * nu) * total
