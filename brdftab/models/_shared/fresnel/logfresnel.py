"""Products of many reflectances at once: log F as a polynomial of the cosine, summed over the bounces of a ray.

With log F_w(x) = sum_p a_wp x^p and bounces at cosines L sin(x_j), the product over them is
exp(sum_p a_wp L^p S_p), S_p = sum_j sin^p(x_j): the power sums serve every wavelength and every length L.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.materials.fresnel import Fresnel, reflectance

DEGREES = (8, 10, 13, 16)
# errors of log F allowed: as a part of the cosine, and in all
STEEP, FLAT = 10.0, 3.0


def fit(fresnel: Fresnel, tolerance: float) -> np.ndarray | None:
    """Return coefficients (W, P) of log F without constant term, or None if no degree reaches the tolerance.

    F(0) = 1 holds exactly for every kind of reflectance. Many bounces at small cosines add up their errors: these stay
    below a multiple of the cosine itself.
    """
    cosine = 0.5 * (1.0 - np.cos(np.pi * (np.arange(400) + 0.5) / 400.0))
    value = reflectance(fresnel, cosine)
    if not (value > 0.0).all():
        return None
    slopes = np.log(value) / cosine[:, None]
    for degree in DEGREES:
        basis = cosine[:, None] ** np.arange(degree)
        coefficients = np.linalg.lstsq(basis, slopes, rcond=None)[0]
        error = np.abs(basis @ coefficients - slopes).max(axis=1)
        if error.max() <= STEEP * tolerance and (error * cosine).max() <= FLAT * tolerance:
            return np.ascontiguousarray(coefficients.T)
    return None


@kernel
def power_sums(first, step, count, sums):
    """Write S_p = sum_j sin^p(first + j step), j = 0 .. count - 1, for p = 1 .. sums.size."""
    sums[:] = 0.0
    s, c = math.sin(first), math.cos(first)
    ss, cs = math.sin(step), math.cos(step)
    for _ in range(count):
        z = s
        for p in range(sums.size):
            sums[p] += z
            z *= s
        s, c = s * cs + c * ss, c * cs - s * ss


@kernel
def spread_sums(low, step, count, sums):
    """Write S_p for a real number of bounces at the midpoints of steps from `low` on: Euler-Maclaurin, two terms."""
    high = low + step * count
    sl, cl = math.sin(low), math.cos(low)
    sh, ch = math.sin(high), math.cos(high)
    before, last = high - low, cl - ch
    sums[0] = last / step + step / 24.0 * (cl - ch)
    pl, ph = sl, sh
    for p in range(2, sums.size + 1):
        value = (cl * pl - ch * ph) / p + (p - 1.0) / p * before
        before, last = last, value
        sums[p - 1] = value / step - step / 24.0 * p * (ph * ch - pl * cl)
        pl *= sl
        ph *= sh


@kernel
def add_products(value, sums, coefficients, powers, scratch, acc):
    """Add value * exp(sum_p a_wp L_q^p S_p) to acc (Q, W); powers (P, Q) holds L_q^p, scratch (Q, W)."""
    size, degree = coefficients.shape
    lengths = powers.shape[1]
    # plain indices: a slice in here would cost a locked reference count each time
    for w in range(size):
        for q in range(lengths):
            scratch[w, q] = 0.0
        for p in range(degree):
            a = coefficients[w, p] * sums[p] * 0.00390625
            for q in range(lengths):
                scratch[w, q] += a * powers[p, q]
        for q in range(lengths):
            # exp(x) = (exp(x/256))^256: no call, so that the loop is vectorised
            y = max(scratch[w, q], -0.25)
            e = 1.0 + y * (1.0 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * (1 / 120 + y / 720)))))
            e *= e
            e *= e
            e *= e
            e *= e
            e *= e
            e *= e
            e *= e
            e *= e
            acc[w, q] += value * e
