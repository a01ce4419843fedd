"""Fast isotropic tables of the symmetric groove: the closed form of every order, on many azimuths at a time.

The azimuths of one pair of polar angles are worked through in chunks. What does not depend on the wavelength (frame,
beam, distribution) is computed for a whole chunk by loops that the compiler turns into vector code; the reflectances of
one cell are computed for all wavelengths together. With x_j the angles of the bounces, which are evenly spaced, the
sum of log F(L sin x_j) over a long chain is its Euler-Maclaurin expansion about the integral, whose coefficients are the
same for every order of one parity and side of the groove.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR, Fresnel, reflectance
from brdftab.models.microfacet.frame import pair
from brdftab.models.microfacet.groove2d import beam_symmetric
from brdftab.models.microfacet.ndf import density, shape_at
from brdftab.models.microfacet.project import unit_gauss
from brdftab.models.setup import Setup
from brdftab.models.vgroove_sym.bounces import sincos_small, step_tables

PI = math.pi
HORIZON = 1e-15
MIRROR_SINE = 1e-14
NO_CAP = 2_000_000_000
# the tightest tolerance that the look-up tables and the bounce sum are laid out for
REACH = 1e-5
# orders up to this one add up the powers of their cosines bounce by bounce, longer ones by the expansion
DIRECT = 24
FIRST_CELLS = 4096
# degree of log F as a polynomial: fixed, so that the loops over it are unrolled
DEGREE = 14

# one scratch array holds named rows of LANES numbers: fixed distances let the compiler prove that rows do not overlap
LANES = 184
CI, CO, SI, SO, HX, HY, OX = (LANES * n for n in range(7))
I_H, BIG_L, FIRST, FRONT, FAINT, BIG, D, TH, S_BIG, C_BIG, S_SMALL, C_SMALL, Y_MIN = (LANES * n for n in range(7, 20))
Z, REACHES, END, SIN_T, SIN_Q, SY, CY, VALUE, TOTAL = (LANES * n for n in range(20, 29))
ROWS = 29
BEFORE, MEAN, POWER_A, POWER_B, LOWER_A, LOWER_B, LENGTHS = (LANES * n for n in range(7))
# a batch of terms: owner cell aside, value, geometry of the chain and sums of powers 1, 2, ... of the cosines
TERMS = 264
AMOUNT, LENGTH, S_NOW, C_NOW, S_STEP, C_STEP, NOW, SUMS = (TERMS * n for n in range(8))


@kernel
def _exp(x):
    """Return exp(x) for -720 <= x <= 0 as (exp(x/16384))^16384, good to 1e-11: no call, so that loops are vectorised."""
    y = max(x, -720.0) * (1.0 / 16384.0)
    e = 1.0 + y * (1.0 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * (1 / 120 + y * (1 / 720 + y * (1 / 5040)))))))
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    return e


@kernel
def _angle(s, c):
    """Return the angle in (-pi/2, pi/2) of that sine and cosine: 4 atan of the tangent of its quarter, by series."""
    u = s / (1.0 + c)
    u /= 1.0 + math.sqrt(1.0 + u * u)
    z = u * u
    a = 1 / 23 - z * (1 / 25 - z * (1 / 27 - z * (1 / 29 - z / 31)))
    a = 1 / 13 - z * (1 / 15 - z * (1 / 17 - z * (1 / 19 - z * (1 / 21 - z * a))))
    a = 1.0 - z * (1 / 3 - z * (1 / 5 - z * (1 / 7 - z * (1 / 9 - z * (1 / 11 - z * a)))))
    return 4.0 * u * a


@kernel
def _frame(n, lanes):
    """Write groove plane, in-plane angles and geometric factors of n cells (see `frame.groove_plane`)."""
    for p in range(n):
        ci, co, hx, hy = lanes[CI + p], lanes[CO + p], lanes[HX + p], lanes[HY + p]
        length = math.sqrt(hx * hx + hy * hy)
        inverse = 1.0 / max(length, 1e-300)
        it, ot = lanes[SI + p] * (hx * inverse), lanes[SO + p] * (lanes[OX + p] * inverse)
        up = max(ci + co, 1e-300)
        full = math.sqrt(hx * hx + hy * hy + up * up)
        li, lo = math.sqrt(it * it + ci * ci), math.sqrt(ot * ot + co * co)
        inverse_i, inverse_o = 1.0 / max(li, 1e-300), 1.0 / max(lo, 1e-300)
        st, ct, su, cu = it * inverse_i, ci * inverse_i, ot * inverse_o, co * inverse_o
        lanes[SY + p] = length / full
        lanes[CY + p] = up / full
        lanes[I_H + p] = 0.5 * full
        lanes[BIG_L + p] = 0.5 * (li + lo)
        t, u = _angle(st, ct), _angle(su, cu)
        first = t >= u
        lanes[BIG + p] = max(t, u)
        lanes[D + p] = 0.5 * abs(t - u)
        lanes[TH + p] = 0.5 * (t + u)
        lanes[S_BIG + p] = st if first else su
        lanes[C_BIG + p] = ct if first else cu
        lanes[S_SMALL + p] = su if first else st
        lanes[C_SMALL + p] = cu if first else ct
    for p in range(n):
        ci, co, i_h = lanes[CI + p], lanes[CO + p], lanes[I_H + p]
        low = min(ci, co)
        front = 0.25 / (max(ci, HORIZON) * max(co, HORIZON))
        front = front if low > HORIZON else 0.0
        lanes[VALUE + p] = front * min(1.0, 2.0 * lanes[CY + p] * low / i_h)
        sin_h = lanes[SY + p]
        rest = front * lanes[BIG_L + p] / (i_h * max(sin_h, MIRROR_SINE))
        lanes[FRONT + p] = rest if sin_h >= MIRROR_SINE else 0.0


@kernel
def _distribute(ndf, shape, n, sines, cosines, lanes):
    """Multiply VALUE by the density of facets whose tilts have these sines and cosines (offsets of two rows)."""
    if ndf == 0:
        a2 = 1.0 / (shape * shape)
        for p in range(n):
            s, c = lanes[sines + p], lanes[cosines + p]
            c2 = 1.0 / (c * c)
            e = s * s * c2 * a2
            value = _exp(-e) * (a2 / PI) * c2 * c2
            lanes[VALUE + p] *= value if e < 700.0 else 0.0
    elif ndf == 1:
        a2 = shape * shape
        for p in range(n):
            s, c = lanes[sines + p], lanes[cosines + p]
            d = a2 * c * c + s * s
            lanes[VALUE + p] *= a2 / (PI * d * d)
    else:
        for p in range(n):
            if lanes[VALUE + p] > 0.0:
                lanes[VALUE + p] *= density(ndf, shape, lanes[cosines + p], lanes[sines + p])


@kernel
def _depths(ndf, shape, depth, n, lanes):
    """Write the least y whose facets matter: their exponent exceeds the first order's by `depth` at most."""
    a2 = shape * shape
    drop = math.exp(-depth / shape)
    for p in range(n):
        s, c = lanes[SY + p], lanes[CY + p]
        if ndf == 0:
            x = 1.0 / math.sqrt(1.0 + s * s / max(c * c, 1e-300) + depth * a2)
        else:
            x = c * drop
        # asin(x) from below
        z = x * x
        y = x * (1.0 + z * (1 / 6 + z * (3 / 40 + z * (5 / 112))))
        lanes[Y_MIN + p] = 1e-300 if ndf == 1 else max(y, 1e-300)


@kernel
def _family(family, n, lanes):
    """Write reach, end and signed angles of one parity (bit 0) and side (bit 1) of the groove."""
    odd = family & 1
    side = family >= 2
    sign = -1.0 if side else 1.0
    for p in range(n):
        d, th = lanes[D + p], lanes[TH + p]
        z = th if odd else d
        reach = 0.5 * PI + sign * z
        other = d if odd else th
        limit = max(other if side else lanes[BIG + p], 1e-300)
        end = reach / max(limit, lanes[Y_MIN + p])
        lanes[END + p] = end if lanes[FRONT + p] > 0.0 else 0.0
        lanes[REACHES + p] = reach
        lanes[Z + p] = sign * z
        lanes[SIN_T + p] = sign * lanes[S_BIG + p]
        lanes[SIN_Q + p] = (sign if odd else -sign) * lanes[S_SMALL + p]


@kernel
def _order(ndf, shape, k, sin_k, cos_k, n, lanes):
    """Write D(a) w sin(a)/k of order k to VALUE, and sine and cosine of y to SY and CY."""
    order = float(k)
    inverse = 1.0 / order
    for p in range(n):
        s, c = sincos_small(lanes[Z + p] * inverse)
        sy, cy = sin_k * c + cos_k * s, cos_k * c - sin_k * s
        beam = beam_symmetric(sy, cy, lanes[SIN_T + p], lanes[C_BIG + p], lanes[SIN_Q + p], lanes[C_SMALL + p])
        lanes[SY + p] = sy
        lanes[CY + p] = cy
        lanes[VALUE + p] = max(beam, 0.0) * cy * inverse if lanes[END + p] > order else 0.0
    _distribute(ndf, shape, n, CY, SY, lanes)


@kernel
def _push_chains(k, low, high, terms, lanes, batch, owners):
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
        _add_powers(count, fresh)
    return terms


@kernel
def _add_powers(count, batch):
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
def _expand(n, lanes, state, expansion):
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
def _push_expanded(value, k, p, terms, expansion, batch, owners):
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
def _flush(terms, coefficients, weights, batch, owners, projected, sums):
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


@kernel
def _tail(k, k_last, p, ndf, shape, mirror, gauss, lanes, terms, expansion, batch, owners):
    """Add the orders k, k + 2, ... to the end of the family as half the integral over the order, in x = 1/order."""
    reach, big = lanes[REACHES + p], lanes[BIG + p]
    sin_t, sin_q, cos_t, cos_q = lanes[SIN_T + p], lanes[SIN_Q + p], lanes[C_BIG + p], lanes[C_SMALL + p]
    small = abs(2.0 * lanes[TH + p] - big)
    low, high = 1.0 / min(lanes[END + p], k_last), 1.0 / (k - 1.0)
    cut1 = min(max(small / reach, low), high)
    cut2 = min(max(big / reach, low), high)
    for panel in range(3):
        x0 = low if panel == 0 else (cut1 if panel == 1 else cut2)
        x1 = cut1 if panel == 0 else (cut2 if panel == 1 else high)
        if x1 - x0 <= 1e-15:
            continue
        for q in range(gauss.shape[1]):
            x = x0 + (x1 - x0) * gauss[0, q]
            s, c = sincos_small(reach * x)
            beam = beam_symmetric(s, c, sin_t, cos_t, sin_q, cos_q)
            if beam <= 0.0:
                continue
            value = density(ndf, shape, s, c) * beam * c * 0.5 * (x1 - x0) * gauss[1, q] / x
            if mirror:
                lanes[TOTAL + p] += value
            elif value > lanes[FAINT + p]:
                terms = _push_expanded(value, 1.0 / x, p, terms, expansion, batch, owners)
    return terms


@kernel
def _higher_orders(n, distribution, orders, optics, lanes, scratch):
    """Add the orders from two on of n cells to TOTAL (F = 1) or to the sums a channel."""
    ndf, shape, _ = distribution
    steps, k_explicit, k_cap, gauss = orders
    mirror, coefficients, weights = optics[:3]
    state, expansion, batch, owners, projected, sums = scratch
    terms = 0
    for family in range(4):
        _family(family, n, lanes)
        low, high = 0, n
        k = 2 + (family & 1)
        expanded = False
        while True:
            while low < high and lanes[END + low] <= k:
                low += 1
            while low < high and lanes[END + high - 1] <= k:
                high -= 1
            if low == high or k > k_cap:
                break
            if not (mirror or expanded) and k > DIRECT:
                _expand(high - low, lanes[low:], state, expansion[low:])
                expanded = True
            if k > k_explicit:
                break
            _order(ndf, shape, k, steps[0, k], steps[1, k], high - low, lanes[low:])
            if mirror:
                for p in range(low, high):
                    lanes[TOTAL + p] += lanes[VALUE + p]
            else:
                if terms + high - low > TERMS:
                    _flush(terms, coefficients, weights, batch, owners, projected, sums)
                    terms = 0
                if k <= DIRECT:
                    terms = _push_chains(k, low, high, terms, lanes, batch, owners)
                else:
                    for p in range(low, high):
                        if lanes[VALUE + p] > lanes[FAINT + p]:
                            terms = _push_expanded(
                                lanes[VALUE + p], float(k), p, terms, expansion, batch, owners
                            )
            k += 2
        if low < high and k <= k_cap:
            k_last = k_cap + 1.0 - (k_cap - k) % 2
            for p in range(low, high):
                if lanes[END + p] > k:
                    if not mirror and terms + 3 * gauss.shape[1] > TERMS:
                        _flush(terms, coefficients, weights, batch, owners, projected, sums)
                        terms = 0
                    terms = _tail(
                        k, k_last, p, ndf, shape, mirror, gauss, lanes, terms, expansion, batch, owners
                    )
    if terms > 0:
        _flush(terms, coefficients, weights, batch, owners, projected, sums)


@kernel
def _chunk(n, distribution, orders, optics, lanes, scratch, out):
    """Write the BRDF (1/sr) of n <= LANES cells, whose directions stand in the first rows of `lanes`, to out (n, C)."""
    ndf, shape, depth = distribution
    mirror, _, _, first_f, faint = optics
    sums = scratch[5]
    _frame(n, lanes)
    _distribute(ndf, shape, n, SY, CY, lanes)
    _depths(ndf, shape, depth, n, lanes)
    for p in range(n):
        value = lanes[VALUE + p]
        lanes[FIRST + p] = value
        lanes[FAINT + p] = faint * value / max(lanes[FRONT + p], 1e-300)
        lanes[TOTAL + p] = 0.0
    sums[:] = 0.0
    if orders[2] >= 2:
        _higher_orders(n, distribution, orders, optics, lanes, scratch)
    cells = first_f.shape[0] - 1
    for p in range(n):
        first, front = lanes[FIRST + p], lanes[FRONT + p]
        if mirror:
            out[p, 0] = first + front * lanes[TOTAL + p]
            continue
        x = lanes[I_H + p] * cells
        i = min(int(x), cells - 1)
        x -= i
        for c in range(out.shape[1]):
            f = first_f[i, c] + x * (first_f[i + 1, c] - first_f[i, c])
            out[p, c] = first * f + front * sums[c * LANES + p]


@kernel
def _scratch(channels):
    """Return what one thread needs: lanes, the scratch of the higher orders, and a chunk's values."""
    higher = (
        np.empty(7 * LANES),
        np.empty(3 * DEGREE * LANES),
        np.empty(SUMS + DEGREE * TERMS),
        np.empty(TERMS, np.int64),
        np.empty(channels * TERMS),
        np.empty(channels * LANES),
    )
    return np.zeros(ROWS * LANES), higher, np.empty((LANES, channels))


@kernel
def _store(p, directions, lanes):
    """Store one pair of directions, given as `frame.pair` returns it."""
    si, ci, so, co, hx, hy, ox = directions
    lanes[CI + p] = ci
    lanes[CO + p] = co
    lanes[SI + p] = si
    lanes[SO + p] = so
    lanes[HX + p] = hx
    lanes[HY + p] = hy
    lanes[OX + p] = ox


@parallel_kernel
def _points(theta_i, theta_o, phi, distribution, orders, optics, out):
    size = theta_i.size
    chunks = (size + LANES - 1) // LANES
    for chunk in numba.prange(chunks):
        lanes, scratch, value = _scratch(out.shape[1])
        start = chunk * LANES
        n = min(LANES, size - start)
        for p in range(n):
            _store(p, pair(theta_i[start + p], theta_o[start + p], phi[start + p]), lanes)
        _chunk(n, distribution, orders, optics, lanes, scratch, value)
        out[start : start + n] = value[:n]


@parallel_kernel
def _fill(theta_i, theta_o, cos_half, sin_phi, square, distribution, orders, optics, out):
    rows, columns, steps, channels = out.shape
    for index in numba.prange(rows):
        # long and short rows of the triangle in turn, so that all threads get the same work
        i = index // 2 if index % 2 == 0 else rows - 1 - index // 2
        lanes, scratch, value = _scratch(channels)
        si, ci = math.sin(theta_i[i]), math.cos(theta_i[i])
        for o in range(i + 1 if square else columns):
            so, co = math.sin(theta_o[o]), math.cos(theta_o[o])
            diff = 2.0 * math.cos(0.5 * (theta_i[i] + theta_o[o])) * math.sin(0.5 * (theta_i[i] - theta_o[o]))
            for start in range(0, steps, LANES):
                n = min(LANES, steps - start)
                for p in range(n):
                    one_plus = 2.0 * cos_half[start + p] * cos_half[start + p]
                    directions = (si, ci, so, co, diff + so * one_plus, so * sin_phi[start + p], si * one_plus - diff)
                    _store(p, directions, lanes)
                _chunk(n, distribution, orders, optics, lanes, scratch, value)
                for p in range(n):
                    for c in range(channels):
                        out[i, o, start + p, c] = value[p, c]
                        if square:
                            out[o, i, start + p, c] = value[p, c]


def _log_polynomial(fresnel: Fresnel, tolerance: float) -> np.ndarray | None:
    """Return coefficients (W, P) of log F without constant term, or None if they miss the tolerance.

    The error of log F is weighted by F: where F is small, products of several are nothing. F(0) = 1 for every kind.
    """
    cosine = 0.5 * (1.0 - np.cos(np.pi * (np.arange(800) + 0.5) / 800.0))
    value = reflectance(fresnel, cosine)
    if not (value > 0.0).all():
        return None
    logs = np.log(value)
    basis = cosine[:, None] ** np.arange(1, DEGREE + 1)
    rows = [np.linalg.lstsq(basis * f[:, None], g * f, rcond=None)[0] for f, g in zip(value.T, logs.T, strict=True)]
    error = np.abs((basis @ np.transpose(rows) - logs) * value).max()
    return np.array(rows) if error <= tolerance else None


def _optics(fresnel: Fresnel, tolerance: float) -> tuple[Any, ...] | None:
    """Return the reflectance as the kernels take it, or None if no polynomial of log F holds the tolerance."""
    if fresnel.kind == MIRROR:
        nothing = np.empty((1, 0))
        return True, nothing, nothing, nothing, 0.0
    coefficients = _log_polynomial(fresnel, 0.2 * tolerance)
    if coefficients is None:
        return None
    first = reflectance(fresnel, np.linspace(0.0, 1.0, FIRST_CELLS + 1)) @ fresnel.weights
    # a term of the sum this much smaller than the first order is left out
    faint = 3e-3 * tolerance * max(float(first.max(axis=1).min()), 0.0)
    weights = np.ascontiguousarray(fresnel.weights)
    return False, coefficients, weights, np.ascontiguousarray(first), faint


def _explicit(tolerance: float) -> tuple[int, int]:
    """Return how many orders are summed one by one, and the nodes of the tail, for a relative tolerance."""
    if tolerance >= 5e-4:
        return 24, 4
    if tolerance >= 1e-4:
        return 96, 4
    return 256, 8


class Prepared:
    """One isotropic setup, ready for points and product grids.

    Parameters
    ----------
    setup : Setup
        Isotropic.
    tolerance : float
        Relative error asked, against the largest channel of a cell; at least `REACH`.
    optics : tuple
        From `_optics`.
    """

    def __init__(self, setup: Setup, tolerance: float, optics: tuple[Any, ...]) -> None:
        k_explicit, nodes = _explicit(tolerance)
        k_cap = NO_CAP if setup.max_bounces is None else setup.max_bounces
        shape = shape_at(setup.ndf, setup.alpha_x, setup.alpha_y, 1.0, 0.0)[0]
        distribution = (setup.ndf, shape, 14.0 - math.log(tolerance))
        orders = (step_tables(k_explicit), k_explicit, k_cap, unit_gauss(nodes))
        self._arguments = (distribution, orders, optics)
        self._channels = len(setup.channels)

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians; phi_i does not matter); returns (N, 1, C) in 1/sr."""
        out = np.empty((theta_i.size, self._channels))
        _points(theta_i, theta_o, phi, *self._arguments, out)
        return out[:, None, :]

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (I, O, P, C), float32 or float64, on a product grid of radians, in 1/sr.

        A square grid (both theta axes the same) is computed half and mirrored: reciprocal bit for bit.
        """
        _fill(theta_i, theta_o, np.cos(0.5 * phi), np.sin(phi), square, *self._arguments, out)


def prepare(setup: Setup, tolerance: float, trial: bool = False) -> Prepared | None:
    """Return the fast evaluation of an isotropic setup, or None where it cannot hold the tolerance.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.setup.resolve`.
    tolerance : float
        Relative error asked, against the largest channel of a cell.
    """
    assert setup.fresnel is not None
    if not setup.isotropic or tolerance < REACH:
        return None
    optics = _optics(setup.fresnel, tolerance)
    return None if optics is None else Prepared(setup, tolerance, optics)
