"""One row of a single-bounce table, all azimuths of a pair of polar angles, in loops that vectorise.

With t = tan^2(theta_h) = tan^2((theta_i - theta_o)/2) + 2 s_i s_o (1 + cos phi)/(c_i + c_o)^2, where no term cancels,
and q = 1 + t = 1/cos^2(theta_h): i.h = (c_i + c_o) sqrt(q)/2, GGX is a^2 q^2/(pi (a^2 + t)^2), Beckmann
exp(-t/a^2) q^2/(pi a^2) and Phong (n + 2)/(2 pi) q^(-n/2). Masking over 4 c_i c_o is min(u, v/q), where v = inf except
in V-cavities.

A loop works in the type of its arrays, so constants come in arrays too: a literal would widen float32 to float64.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel

LOG2_E = 1.4426950408889634
LN2_HIGH = 6.93147180369123816490e-01
LN2_LOW = 1.90821492927058770002e-10
# 1.5 * 2^52: adding it leaves the nearest integer in the last bits of a float64
ROUND = 6755399441055744.0
SQRT_HALF_BITS = 0x3FE6A09E667F3BCD


@kernel
def exponential(x):
    """Return exp(x) for |x| <= 700, to 3e-16: Cody and Waite's reduction and a Taylor polynomial; vectorises."""
    shifted = x * LOG2_E + ROUND
    whole = shifted - ROUND
    r = (x - whole * LN2_HIGH) - whole * LN2_LOW
    p = 1.0 / 479001600.0
    p = p * r + 1.0 / 39916800.0
    p = p * r + 1.0 / 3628800.0
    p = p * r + 1.0 / 362880.0
    p = p * r + 1.0 / 40320.0
    p = p * r + 1.0 / 5040.0
    p = p * r + 1.0 / 720.0
    p = p * r + 1.0 / 120.0
    p = p * r + 1.0 / 24.0
    p = p * r + 1.0 / 6.0
    p = p * r + 0.5
    p = p * r + 1.0
    p = p * r + 1.0
    scale = (np.float64(shifted).view(np.int64) << 52) + (1023 << 52)
    return p * np.int64(scale).view(np.float64)


@kernel
def log_one_plus(t):
    """Return log(1 + t) for t >= 0, to 4e-16 relative: the atanh series of fdlibm; vectorises."""
    q = 1.0 + t
    bits = np.float64(q).view(np.int64)
    k = (bits - SQRT_HALF_BITS) >> 52
    f = np.int64(bits - (k << 52)).view(np.float64) - 1.0
    s = f / (2.0 + f)
    z = s * s
    p = 2.0 / 19.0
    p = p * z + 2.0 / 17.0
    p = p * z + 2.0 / 15.0
    p = p * z + 2.0 / 13.0
    p = p * z + 2.0 / 11.0
    p = p * z + 2.0 / 9.0
    p = p * z + 2.0 / 7.0
    p = p * z + 2.0 / 5.0
    p = p * z + 2.0 / 3.0
    # log(1 + f) = f - s (f - z p); the last term is what rounding took from 1 + t
    low = k * LN2_LOW + (t - (q - 1.0)) / q
    return k * LN2_HIGH + ((f - s * (f - z * p)) + low)


@kernel
def ggx_row(row, squares, weight, x):
    """Write D G/(4 c_i c_o) and the reflectance's variable; `squares` is 1 + cos phi.

    `row` is 1, a^2, tan^2, slope, u, v (u and v times a^2/pi), (c_i + c_o)/2 and the map's m1, m0, d1, d0.
    """
    one, a2, first, slope, u, v = row[0], row[1], row[2], row[3], row[4], row[5]
    h, m1, m0, d1, d0 = row[6], row[7], row[8], row[9], row[10]
    for p in range(squares.size):
        t = first + slope * squares[p]
        up = one + t
        c = h * math.sqrt(up)
        # one division serves both the distribution and the map
        below, under = a2 + t, d1 * c + d0
        both = one / (below * under)
        r = both * under
        d = up * r
        weight[p] = d * min(u * d, v * r)
        x[p] = (m1 * c + m0) * (both * below)


@kernel
def beckmann_row(inverse, first, slope, u, v, squares, weight, q):
    """Write D G/(4 c_i c_o) and q in float64; `inverse` is 1/a^2, and u, v are times 1/(pi a^2)."""
    for p in range(squares.size):
        t = first + slope * squares[p]
        up = 1.0 + t
        e = t * inverse
        value = exponential(-min(e, 700.0)) * up * min(u * up, v)
        weight[p] = 0.0 if e > 700.0 else value
        q[p] = up


@kernel
def phong_row(half, first, slope, u, v, squares, weight, q):
    """Write D G/(4 c_i c_o) and q in float64; `half` is n/2, and u, v are times (n + 2)/(2 pi)."""
    for p in range(squares.size):
        t = first + slope * squares[p]
        up = 1.0 + t
        e = half * log_one_plus(t)
        value = exponential(-min(e, 700.0)) * min(u, v / up)
        weight[p] = 0.0 if e > 700.0 else value
        q[p] = up


@kernel
def map_row(row, q):
    """Turn q in place into the reflectance's variable, a Moebius map of i.h to [-1, 1]; `row` as in `ggx_row`."""
    h, m1, m0, d1, d0 = row[6], row[7], row[8], row[9], row[10]
    for p in range(q.size):
        c = h * math.sqrt(q[p])
        q[p] = (m1 * c + m0) / (d1 * c + d0)


@kernel
def horner_start(k, zone, c, x, out):
    """Write the polynomial of the first five coefficients (highest power first) of a zone and channel to out[c]."""
    k0, k1, k2, k3, k4 = k[zone, c, 0], k[zone, c, 1], k[zone, c, 2], k[zone, c, 3], k[zone, c, 4]
    for p in range(x.size):
        y = x[p]
        out[c, p] = (((k0 * y + k1) * y + k2) * y + k3) * y + k4


@kernel
def horner_more(k, zone, c, at, x, out):
    """Go on with the four coefficients from `at`."""
    k0, k1, k2, k3 = k[zone, c, at], k[zone, c, at + 1], k[zone, c, at + 2], k[zone, c, at + 3]
    for p in range(x.size):
        y = x[p]
        out[c, p] = (((out[c, p] * y + k0) * y + k1) * y + k2) * y + k3


@kernel
def interleave(weight, rows, out):
    """Write weight (P) times each channel's row (C, P) to out (P C), channel fastest."""
    channels = rows.shape[0]
    if channels == 3:
        for p in range(weight.size):
            w = weight[p]
            out[3 * p] = w * rows[0, p]
            out[3 * p + 1] = w * rows[1, p]
            out[3 * p + 2] = w * rows[2, p]
    else:
        for c in range(channels):
            for p in range(weight.size):
                out[channels * p + c] = weight[p] * rows[c, p]
