"""Products of reflectances over the bounces of many terms of the bounce sum at once.

With log F_w(x) = sum_q a_wq x^q and bounces at cosines L sin(x_j), the product is exp(sum_q a_wq S_q) with the power
sums S_q = sum_j (L sin x_j)^q, which serve all wavelengths. The x_j are evenly spaced and, of one parity and side of
the groove, centred in equal parts of the same span, so that the sums of long chains follow the Euler-Maclaurin
expansion S_q = k I_q + A_q/k + B_q/k^3, whose coefficients are the same for every order k. Terms wait in a batch until
it is full.
"""

from __future__ import annotations

import numpy as np

from brdftab.jit import kernel
from brdftab.materials.fresnel import Fresnel, reflectance
from brdftab.models.vgroove_sym.simd_rows import (
    BIG_L,
    C_BIG,
    C_SMALL,
    CY,
    FAINT,
    LANES,
    REACHES,
    SIN_Q,
    SIN_T,
    SY,
    VALUE,
)

# degree of log F as a polynomial: fixed, so that the loops over it can be written out
DEGREE = 14
# a batch of terms: owner cell aside, value, geometry of the chain and sums of powers 1, 2, ... of the cosines
TERMS = 264
AMOUNT, LENGTH, S_NOW, C_NOW, S_STEP, C_STEP, NOW, SUMS = (TERMS * n for n in range(8))
# rows of the recursion over powers in the expansion
BEFORE, MEAN, POWER_A, POWER_B, LOWER_A, LOWER_B, LENGTHS = (LANES * n for n in range(7))


def log_polynomial(fresnel: Fresnel, tolerance: float) -> np.ndarray | None:
    """Return coefficients (W, P) of log F without constant term, or None if they miss the tolerance.

    Errors where F is below 0.001 weigh less: products of several such are nothing. F(0) = 1 for every kind.
    """
    cosine = 0.5 * (1.0 - np.cos(np.pi * (np.arange(256) + 0.5) / 256.0))
    value = reflectance(fresnel, cosine)
    if not (value > 0.0).all():
        return None
    logs = np.log(value)
    basis = cosine[:, None] ** np.arange(1, DEGREE + 1)
    weight = np.minimum(1000.0 * value, 1.0)
    rows = [np.linalg.lstsq(basis * f[:, None], g * f, rcond=None)[0] for f, g in zip(weight.T, logs.T, strict=True)]
    error = np.abs((basis @ np.transpose(rows) - logs) * weight).max()
    return np.array(rows) if error <= tolerance else None


@kernel
def push_chains(k, low, high, terms, lanes, batch, owners):
    """Append the terms of order k that are not faint to the batch, with their power sums over the k bounces."""
    start = terms
    for p in range(low, high):
        if lanes[VALUE + p] > lanes[FAINT + p]:
            sy, cy, s_big, c_big = lanes[SY + p], lanes[CY + p], lanes[SIN_T + p], lanes[C_BIG + p]
            owners[terms] = p
            batch[AMOUNT + terms] = lanes[VALUE + p]
            batch[LENGTH + terms] = lanes[BIG_L + p]
            batch[S_NOW + terms] = sy * c_big - cy * s_big
            batch[C_NOW + terms] = cy * c_big + sy * s_big
            batch[S_STEP + terms] = 2.0 * sy * cy
            batch[C_STEP + terms] = (cy - sy) * (cy + sy)
            terms += 1
    fresh = batch[start:]
    count = terms - start
    for n in range(DEGREE):
        row = fresh[SUMS + n * TERMS :]
        for t in range(count):
            row[t] = 0.0
    for _ in range(k):
        add_powers(count, fresh)
    return terms


@kernel
def add_powers(count, batch):
    """Add the powers 1 to DEGREE of the present bounce's cosines and go on to the next bounce."""
    for t in range(count):
        s, c = batch[S_NOW + t], batch[C_NOW + t]
        ss, cs = batch[S_STEP + t], batch[C_STEP + t]
        x = max(batch[LENGTH + t] * s, 0.0)
        batch[S_NOW + t] = s * cs + c * ss
        batch[C_NOW + t] = c * cs - s * ss
        # written out: a loop here would keep the compiler from vectorising the loop over terms
        x2 = x * x
        x3, x4 = x2 * x, x2 * x2
        x5, x6, x7 = x4 * x, x4 * x2, x4 * x3
        x8 = x4 * x4
        batch[SUMS + t] += x
        batch[SUMS + TERMS + t] += x2
        batch[SUMS + 2 * TERMS + t] += x3
        batch[SUMS + 3 * TERMS + t] += x4
        batch[SUMS + 4 * TERMS + t] += x5
        batch[SUMS + 5 * TERMS + t] += x6
        batch[SUMS + 6 * TERMS + t] += x7
        batch[SUMS + 7 * TERMS + t] += x8
        batch[SUMS + 8 * TERMS + t] += x8 * x
        batch[SUMS + 9 * TERMS + t] += x8 * x2
        batch[SUMS + 10 * TERMS + t] += x8 * x3
        batch[SUMS + 11 * TERMS + t] += x8 * x4
        batch[SUMS + 12 * TERMS + t] += x8 * x5
        batch[SUMS + 13 * TERMS + t] += x8 * x6


@kernel
def expand(n, lanes, state, expansion):
    """Write, for each power, the coefficients of k, 1/k and 1/k^3 in the sum over k evenly spaced bounces."""
    for p in range(n):
        # integrals of sin^(q-2) and sin^(q-1) over the span; sin^(q-1) and sin^(q-3) at both ends; L^q
        state[BEFORE + p] = 0.0
        state[MEAN + p] = 2.0 * lanes[REACHES + p]
        state[POWER_A + p] = 1.0
        state[POWER_B + p] = 1.0
        state[LOWER_A + p] = 0.0
        state[LOWER_B + p] = 0.0
        state[LENGTHS + p] = lanes[BIG_L + p]
    for m in range(DEGREE):
        q = m + 1.0
        odds, both, step = m * (m - 1.0), 3.0 * m + 1.0, m / q
        out = expansion[3 * m * LANES :]
        start = 1.0 if m == 1 else 0.0
        for p in range(n):
            sa, ca = -lanes[SIN_T + p], lanes[C_BIG + p]
            sb, cb = -lanes[SIN_Q + p], -lanes[C_SMALL + p]
            span = 2.0 * lanes[REACHES + p]
            pa, pb, ra, rb = state[POWER_A + p], state[POWER_B + p], state[LOWER_A + p], state[LOWER_B + p]
            power, before = state[LENGTHS + p], state[BEFORE + p]
            mean = (ca * pa - cb * pb) * (1.0 / q) + step * before
            third_a = ca * (odds * ca * ca * ra - both * pa)
            third_b = cb * (odds * cb * cb * rb - both * pb)
            out[p] = power * mean / span
            out[LANES + p] = power * span * (q / 24.0) * (ca * pa - cb * pb)
            out[2 * LANES + p] = power * span * span * span * (7.0 / 5760.0 * q) * (third_b - third_a)
            state[BEFORE + p] = state[MEAN + p]
            state[MEAN + p] = mean
            state[LOWER_A + p] = start + ra * sa
            state[LOWER_B + p] = start + rb * sb
            state[POWER_A + p] = pa * sa
            state[POWER_B + p] = pb * sb
            state[LENGTHS + p] = power * lanes[BIG_L + p]


@kernel
def push_expanded(value, k, p, terms, expansion, batch, owners):
    """Append one term of (real) order k, its power sums by expansion."""
    owners[terms] = p
    batch[AMOUNT + terms] = value
    inverse = 1.0 / k
    cube = inverse * inverse * inverse
    for m in range(DEGREE):
        a, b, c = expansion[3 * m * LANES + p], expansion[(3 * m + 1) * LANES + p], expansion[(3 * m + 2) * LANES + p]
        batch[SUMS + m * TERMS + terms] = k * a + inverse * b + cube * c
    return terms + 1


@kernel
def flush(terms, coefficients, weights, batch, owners, projected, sums):
    """Add the terms of the batch, times exp(sum_q a_q S_q) a wavelength, to the channels of their cells."""
    size, channels = weights.shape
    for c in range(channels):
        for t in range(terms):
            projected[c * TERMS + t] = 0.0
    for w in range(size):
        a = coefficients[w]
        for t in range(terms):
            z = a[0] * batch[SUMS + t] + a[1] * batch[SUMS + TERMS + t] + a[2] * batch[SUMS + 2 * TERMS + t]
            z += a[3] * batch[SUMS + 3 * TERMS + t] + a[4] * batch[SUMS + 4 * TERMS + t]
            z += a[5] * batch[SUMS + 5 * TERMS + t] + a[6] * batch[SUMS + 6 * TERMS + t]
            z += a[7] * batch[SUMS + 7 * TERMS + t] + a[8] * batch[SUMS + 8 * TERMS + t]
            z += a[9] * batch[SUMS + 9 * TERMS + t] + a[10] * batch[SUMS + 10 * TERMS + t]
            z += a[11] * batch[SUMS + 11 * TERMS + t] + a[12] * batch[SUMS + 12 * TERMS + t]
            z += a[13] * batch[SUMS + 13 * TERMS + t]
            # exp(z) = (exp(z/64))^64, and nothing below exp(-32)
            y = max(z * 0.015625, -0.5)
            e = 1.0 + y * (1.0 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * (1 / 120)))))
            e *= e
            e *= e
            e *= e
            e *= e
            e *= e
            e *= e
            batch[NOW + t] = batch[AMOUNT + t] * e
        for c in range(channels):
            weight = weights[w, c]
            if weight != 0.0:
                for t in range(terms):
                    projected[c * TERMS + t] += weight * batch[NOW + t]
    for c in range(channels):
        for t in range(terms):
            sums[c * LANES + owners[t]] += projected[c * TERMS + t]
