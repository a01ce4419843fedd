"""Azimuth modes of the kernels between two states of a dielectric.

With k = n d the wave vector and X = |k' - k|^2, each kernel is D(h) A(X), where h = (k' - k)/sqrt X up to sign. A is
F/4 for reflection and (1 - F) n |cos_i| |cos_t|/X for refraction; in this symmetric form a path and its reverse weigh
the same, and light that changes sides from index n_i to n_o gains n_o/n_i at the end. With s the tangential part of k,
X = dp^2 + ds^2 + 4 s s' sin^2(phi/2), phi the azimuth from k to k', and mode m is int_0^pi K cos(m phi) dphi/pi.

GGX's D is alpha^2/pi (X/(X - b))^2 with b = (1 - alpha^2) dp^2. The straight line through A at b and at the smallest X
is integrated in closed form, which holds the narrow lobe to all digits; quadrature is left with a smooth rest.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import BECKMANN, GGX
from brdftab.models._shared.random_walk.refraction import fresnel, transmittance

ABOVE, BELOW, THROUGH = 0, 1, 2
LANES = 8
# a lobe is narrow where X varies by less than this part across it
NARROW = 0.1
# secants over less than this part of the range of X are rounding
TINY = 1e-9
FADE = 36.0


@kernel
def amplitude(kind, x, n):
    """Return A(X) of reflection above, reflection below or refraction; 0 where X is out of its reach."""
    r = math.sqrt(x)
    if kind == ABOVE:
        return 0.25 * fresnel(0.5 * r, n)
    if kind == BELOW:
        return 0.25 * fresnel(0.5 * r / n, 1.0 / n)
    q = (n - 1.0) * (n + 1.0)
    # n cos_t - cos_i = sqrt X and n cos_t + cos_i = q/sqrt X
    above, below = 0.5 * (q / r - r), 0.5 * (q / r + r) / n
    return n * transmittance(above, below, n) * above * below / x


@kernel
def pair(kind, p, s, q, sq):
    """Return dp (positive where light scatters so), ds and s s' of two states."""
    dp = q - p if kind == ABOVE else p - q
    ds = (p - q) * (p + q) / (s + sq + 1e-300) if kind < THROUGH else sq - s
    return dp, ds, s * sq


@kernel
def largest(ndf, alpha, dp, ds, ss, reach):
    """Return the azimuth width of the lobe between two states and the mode at which it has decayed by exp(-reach)."""
    a2 = alpha * alpha
    if ndf == GGX:
        w = math.sqrt((ds * ds + a2 * dp * dp) / (ss + 1e-300))
        return w, reach / (2.0 * math.asinh(0.5 * w))
    w = alpha * abs(dp) / math.sqrt(ss + 1e-300)
    return w, 2.0 * math.sqrt(reach) / w + 4.0


@kernel
def pole(kind, alpha, n, dp, ds, ss):
    """Return the part of GGX's kernel that is closed: line (A at b, slope), eta, P, Q and what modes 0 and 1 add.

    The modes are exp(-m eta) (P + m Q); exact for an A that is a straight line, and for high m all that there is.
    """
    a2 = alpha * alpha
    b = (1.0 - a2) * dp * dp
    c = ds * ds + a2 * dp * dp
    span = 2.0 * ss
    root = math.sqrt(c * (c + 2.0 * span))
    eta = 2.0 * math.asinh(math.sqrt(0.25 * c / (ss + 1e-300)))
    value = amplitude(kind, b, n) if b > 0.0 else 0.0
    slope = 0.0
    if b > 0.0 and c > TINY * (b + span):
        slope = (amplitude(kind, b + c, n) - value) / c
    scale = a2 / math.pi
    square = b * b * value
    one = scale * ((2.0 * b * value + b * b * slope) / root + square * (c + span) / (root * root * root))
    two = scale * square / (root * root)
    flat = scale * (value + slope * (2.0 * b + c + span))
    return value, slope, eta, one, two, flat, -0.5 * scale * slope * span


@kernel
def _is_closed(kind, alpha, dp, ds):
    """Tell whether the line serves: at X below its reach the amplitude of refraction rises without end."""
    return kind < THROUGH or ds * ds + alpha * alpha * dp * dp < NARROW * (dp * dp + ds * ds)


@kernel
def _range(kind, ndf, alpha, n, dp, ds, ss, cut):
    """Return the end of the azimuths that count (0: none) and where total reflection begins or ends (-1: nowhere)."""
    base = dp * dp + ds * ds
    end, edge = math.pi, -1.0
    if kind == THROUGH and base >= (n - 1.0) * (n + 1.0):
        return 0.0, edge
    if ndf == BECKMANN:
        if dp == 0.0 or ds * ds > cut * alpha * alpha * dp * dp:
            return 0.0, edge
        y = cut * alpha * alpha * dp * dp / (4.0 * ss + 1e-300)
        if y < 1.0:
            end = 2.0 * math.asin(math.sqrt(y))
    if kind > ABOVE:
        y = ((4.0 if kind == BELOW else 1.0) * (n - 1.0) * (n + 1.0) - base) / (4.0 * ss + 1e-300)
        if 0.0 < y < 1.0:
            edge = 2.0 * math.asin(math.sqrt(y))
    if edge >= end:
        edge = -1.0
    return end, edge


@kernel
def _nodes(kind, surface, dp, ds, ss, line, bounds, steps, gauss, sine, value):
    """Fill sin(phi/2) and weighted values of the kernel less its line; returns how many.

    Panels grow with their distance from the lobe up to the widest; that after `edge` is mapped by a square, as F falls
    there like a root.
    """
    ndf, alpha, n = surface
    end, edge = bounds
    first, widest = steps
    a2, base = alpha * alpha, dp * dp + ds * ds
    count = gauss.shape[1]
    used = 0
    low, width = 0.0, min(first, widest)
    while low < end:
        high = low + width
        if high + 0.3 * width >= end or used + 3 * count > sine.size:
            high = end
        rooted = low == edge
        if edge > low and high > edge:
            high = edge
        for g in range(count):
            y, w = gauss[0, g], gauss[1, g] * (high - low) / math.pi
            if rooted:
                w *= 2.0 * y
                y *= y
            h = math.sin(0.5 * (low + (high - low) * y))
            rise = 4.0 * ss * h * h
            x = base + rise
            if x <= 0.0:
                continue
            d = a2 / math.pi
            if ndf == GGX and dp > 0.0:
                over = ds * ds + a2 * dp * dp + rise
                r = x / over
                v = (amplitude(kind, x, n) - line[0] - line[1] * over) * d * r * r
            elif ndf == GGX:
                v = amplitude(kind, x, n) * d
            else:
                r = x / (a2 * dp * dp)
                v = amplitude(kind, x, n) * d * r * r * math.exp(-(ds * ds + rise) / (a2 * dp * dp))
            sine[used], value[used] = h, v * w
            used += 1
        low = high
        width = min(2.0 * low, widest)
    return used


@kernel
def _sum_modes(used, sine, value, start, stop, scratch, out):
    """Write the sums of value cos(m phi), m = start .. stop - 1, into out."""
    padded = (used + LANES - 1) // LANES * LANES
    for g in range(used, padded):
        sine[g], value[g] = 0.0, 0.0
    lanes = np.empty(LANES)
    for g in range(padded):
        v, c = value[g], 1.0 - 2.0 * sine[g] * sine[g]
        scratch[0, g], scratch[1, g], scratch[2, g] = v * c, v, 2.0 * c
        if start > 0:
            f = 2.0 * math.asin(sine[g])
            scratch[0, g], scratch[1, g] = v * math.cos((start - 1) * f), v * math.cos(start * f)
    for m in range(start, stop):
        for j in range(LANES):
            lanes[j] = 0.0
        # rows of fixed length vectorise without reordering sums
        for g in range(0, padded, LANES):
            for j in range(LANES):
                c = scratch[1, g + j]
                lanes[j] += c
                scratch[1, g + j] = scratch[2, g + j] * c - scratch[0, g + j]
                scratch[0, g + j] = c
        total = 0.0
        for j in range(LANES):
            total += lanes[j]
        out[m - start] = total


@kernel
def _fill_row(kind, surface, dp, ds, ss, start, modes, reach, gauss, sine, value, scratch, row):
    """Write modes start, start + 1, ... of one pair of states into row; tells whether there are any."""
    ndf, alpha, n = surface
    row[:] = 0.0
    bounds = _range(kind, ndf, alpha, n, dp, ds, ss, 2.0 * reach)
    if bounds[0] <= 0.0:
        return False
    total = start + row.size
    w, most = largest(ndf, alpha, dp, ds, ss, reach)
    # roots of A leave slow tails, which a few modes more hold, and edges leave slower ones
    stop = int(min(most + 12.0, float(total))) if dp > 0.0 and bounds[1] < 0.0 else total
    if stop <= start:
        return False
    line = 0.0, 0.0
    closed = ndf == GGX and dp > 0.0 and _is_closed(kind, alpha, dp, ds)
    if closed:
        at, slope, eta, one, two, flat, first_mode = pole(kind, alpha, n, dp, ds, ss)
        line = at, slope
    size = gauss.shape[1]
    steps = (max(1.5 * w, 1e-9) if dp > 0.0 else 1.0), 1.5 * size / stop
    used = _nodes(kind, surface, dp, ds, ss, line, bounds, steps, gauss, sine, value)
    _sum_modes(used, sine, value, start, stop, scratch, row)
    if ndf == GGX and bounds[1] >= 0.0:
        # the modes of an edge are let fade, as ending them at once would ripple far from it
        for m in range(start, stop):
            row[m - start] *= math.exp(-FADE * (m / modes) ** 16)
    if closed:
        for m in range(start, stop):
            row[m - start] += math.exp(-m * eta) * (one + m * two)
        if start == 0:
            row[0] += flat
        if start <= 1 < total:
            row[1 - start] += first_mode
    return True


@parallel_kernel
def integrate(kind, surface, p, s, panel, q, sq, panel_q, factors, start, count, modes, reach, gauss, square, out):
    """Fill out (count, A, B), zeros before, with modes start .. start + count - 1 between states (p, s) and (q, sq).

    Parameters
    ----------
    kind : int
        ABOVE, BELOW or THROUGH.
    surface : tuple
        ndf, alpha, index below.
    p, s, panel, q, sq, panel_q : ndarray (A,), (B,)
        Wave vectors of both sets of states and the panels they belong to, -1 for directions of a table.
    factors : ndarray (2, K, K)
        Of `one_sided`: for states of one panel.
    modes : int
        How many there will be in all.
    reach : float
        A mode is left out where the lobe has decayed by exp(-reach).
    gauss : ndarray (2, G)
        Rule on (0, 1).
    square : bool
        Both sets are the states of one side, so that each path is the reverse of another one.
    """
    per = factors.shape[1]
    last = p.size - 1
    size = gauss.shape[1]
    capacity = size * (48 + int(math.pi * (start + count) / size)) + LANES
    for a in numba.prange(p.size):
        sine, value = np.empty(capacity), np.empty(capacity)
        scratch, row = np.empty((3, capacity)), np.empty(count)
        for b in range(q.size - a if square else q.size):
            dp, ds, ss = pair(kind, p[a], s[a], q[b], sq[b])
            same = panel[a] == panel_q[b] and panel[a] >= 0
            if dp < 0.0 or (dp == 0.0 and not same):
                continue
            if _fill_row(kind, surface, dp, ds, ss, start, modes, reach, gauss, sine, value, scratch, row):
                f = factors[0 if kind == ABOVE else 1, a % per, b % per] if same else 1.0
                for m in range(count):
                    out[m, a, b] = f * row[m]
                    if square:
                        out[m, last - b, last - a] = f * row[m]


@parallel_kernel
def lobes(kind, surface, p, s, q, sq, orders, reach, gauss, out):
    """Fill out (M, A, B), zeros before, with high modes of real order (M,), increasing; see `integrate`.

    GGX: the lobe's pole in closed form. Beckmann: by quadrature, the lobe being narrow and nothing beside it.
    """
    ndf, alpha, n = surface
    size = gauss.shape[1]
    top = orders[orders.size - 1]
    capacity = size * 96 + LANES
    for a in numba.prange(p.size):
        sine, value = np.empty(capacity), np.empty(capacity)
        for b in range(q.size):
            dp, ds, ss = pair(kind, p[a], s[a], q[b], sq[b])
            if dp <= 0.0 or ss <= 0.0:
                continue
            w, most = largest(ndf, alpha, dp, ds, ss, reach)
            bounds = _range(kind, ndf, alpha, n, dp, ds, ss, 2.0 * reach)
            if most < orders[0] or bounds[0] <= 0.0:
                continue
            if ndf == GGX:
                if not _is_closed(kind, alpha, dp, ds):
                    continue
                _, _, eta, one, two, _, _ = pole(kind, alpha, n, dp, ds, ss)
                for m in range(orders.size):
                    if orders[m] <= most:
                        out[m, a, b] = math.exp(-orders[m] * eta) * (one + orders[m] * two)
                continue
            steps = max(1.5 * w, 1e-9), 1.5 * size / min(most, top)
            used = _nodes(kind, surface, dp, ds, ss, (0.0, 0.0), bounds, steps, gauss, sine, value)
            for g in range(used):
                sine[g] = 2.0 * math.asin(sine[g])
            for m in range(orders.size):
                total = 0.0
                for g in range(used):
                    total += value[g] * math.cos(orders[m] * sine[g])
                out[m, a, b] = total
