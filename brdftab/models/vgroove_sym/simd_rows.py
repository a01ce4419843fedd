"""What orders of the symmetric groove have in common, on many cells at a time: frame, beam, distribution.

Every function loops over cells without calls and without overlap of what it reads and writes, so that the compiler
turns the loop into vector code. `bounces` holds the same formulas for one pair of directions.
"""

from __future__ import annotations

import math

from brdftab.directions import HORIZON, MIRROR_SINE
from brdftab.jit import kernel
from brdftab.models._shared.codes import BECKMANN, GGX, PHONG
from brdftab.models._shared.facets.ndf import density
from brdftab.models._shared.grooves.groove2d import beam_symmetric
from brdftab.models.vgroove_sym.bounces import sincos_small

PI = math.pi

# one scratch array holds named rows of LANES numbers: fixed distances let the compiler prove that rows do not overlap
LANES = 184
CI, CO, SI, SO, HX, HY, OX = (LANES * n for n in range(7))
I_H, BIG_L, FIRST, FRONT, FAINT, BIG, D, TH, S_BIG, C_BIG, S_SMALL, C_SMALL, Y_MIN = (LANES * n for n in range(7, 20))
Z, REACHES, END, SIN_T, SIN_Q, SY, CY, VALUE, TOTAL = (LANES * n for n in range(20, 29))
ROWS = 29


@kernel
def small_exp(x):
    """Return exp(x) for -720 <= x <= 0 as (exp(x/16384))^16384, good to 1e-11, without a call."""
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
def angle(s, c):
    """Return the angle in (-pi/2, pi/2) of that sine and cosine: 4 atan of the tangent of its quarter, by series."""
    u = s / (1.0 + c)
    u /= 1.0 + math.sqrt(1.0 + u * u)
    z = u * u
    a = 1 / 23 - z * (1 / 25 - z * (1 / 27 - z * (1 / 29 - z / 31)))
    a = 1 / 13 - z * (1 / 15 - z * (1 / 17 - z * (1 / 19 - z * (1 / 21 - z * a))))
    a = 1.0 - z * (1 / 3 - z * (1 / 5 - z * (1 / 7 - z * (1 / 9 - z * (1 / 11 - z * a)))))
    return 4.0 * u * a


@kernel
def frame(n, lanes):
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
        t, u = angle(st, ct), angle(su, cu)
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
def distribute(ndf, shape, n, sines, cosines, lanes):
    """Multiply VALUE by the density of facets whose tilts have these sines and cosines (offsets of two rows)."""
    if ndf == BECKMANN:
        a2 = 1.0 / (shape * shape)
        for p in range(n):
            s, c = lanes[sines + p], lanes[cosines + p]
            c2 = 1.0 / (c * c)
            e = s * s * c2 * a2
            value = small_exp(-e) * (a2 / PI) * c2 * c2
            lanes[VALUE + p] *= value if e < 700.0 else 0.0
    elif ndf == GGX:
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
def depths(ndf, shape, depth, n, lanes):
    """Write the least y whose facets matter: their exponent exceeds the first order's by `depth` at most."""
    a2 = shape * shape
    drop = math.exp(-depth / shape) if ndf == PHONG and shape > 0.0 else 0.0
    for p in range(n):
        s, c = lanes[SY + p], lanes[CY + p]
        x = 1.0 / math.sqrt(1.0 + s * s / max(c * c, 1e-300) + depth * a2) if ndf == BECKMANN else c * drop
        # asin(x) from below
        z = x * x
        y = x * (1.0 + z * (1 / 6 + z * (3 / 40 + z * (5 / 112))))
        lanes[Y_MIN + p] = 1e-300 if ndf == GGX else max(y, 1e-300)


@kernel
def family(family, n, lanes):
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
def order(ndf, shape, k, sin_k, cos_k, n, lanes):
    """Write D(a) w sin(a)/k of order k to VALUE, and sine and cosine of y to SY and CY."""
    bounces = float(k)
    inverse = 1.0 / bounces
    for p in range(n):
        s, c = sincos_small(lanes[Z + p] * inverse)
        sy, cy = sin_k * c + cos_k * s, cos_k * c - sin_k * s
        beam = beam_symmetric(sy, cy, lanes[SIN_T + p], lanes[C_BIG + p], lanes[SIN_Q + p], lanes[C_SMALL + p])
        lanes[SY + p] = sy
        lanes[CY + p] = cy
        lanes[VALUE + p] = max(beam, 0.0) * cy * inverse if lanes[END + p] > bounces else 0.0
    distribute(ndf, shape, n, CY, SY, lanes)


@kernel
def store(p, directions, lanes):
    """Store one pair of directions, given as `frame.pair` returns it."""
    si, ci, so, co, hx, hy, ox = directions
    lanes[CI + p] = ci
    lanes[CO + p] = co
    lanes[SI + p] = si
    lanes[SO + p] = so
    lanes[HX + p] = hx
    lanes[HY + p] = hy
    lanes[OX + p] = ox
