"""Azimuth modes of the kernels between two states of a dielectric.

With k = n d the wave vector and X = |k' - k|^2, each kernel is D(h) A(X), where h = (k' - k)/sqrt X up to sign. A is
F/4 for reflection and (1 - F) n |cos_i| |cos_t|/X for refraction; in this symmetric form a path and its reverse weigh
the same, and light that changes sides from index n_i to n_o gains n_o/n_i at the end. With s the tangential part of k,
X = dp^2 + ds^2 + 4 s s' sin^2(phi/2), phi the azimuth from k to k', and mode m is int_0^pi K cos(m phi) dphi/pi.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models.microfacet.refraction import fresnel, transmittance

ABOVE, BELOW, THROUGH = 0, 1, 2
LANES = 8


@kernel
def amplitude(kind, x, n):
    """Return A(X) of reflection above, reflection below or refraction; 0 where X is out of its reach."""
    r = math.sqrt(x)
    if kind == 0:
        return 0.25 * fresnel(0.5 * r, n)
    if kind == 1:
        return 0.25 * fresnel(0.5 * r / n, 1.0 / n)
    q = (n - 1.0) * (n + 1.0)
    # n cos_t - cos_i = sqrt X and n cos_t + cos_i = q/sqrt X
    above, below = 0.5 * (q / r - r), 0.5 * (q / r + r) / n
    return n * transmittance(above, below, n) * above * below / x


@kernel
def _density(ndf, alpha, dp, ds, x, rise):
    """Return D at X = dp^2 + ds^2 + rise."""
    a2 = alpha * alpha
    if ndf == 1:
        if dp == 0.0:
            return a2 / math.pi
        r = x / (ds * ds + a2 * dp * dp + rise)
        return a2 / math.pi * r * r
    if dp == 0.0:
        return 0.0
    d2 = dp * dp
    return x * x / (math.pi * a2 * d2 * d2) * math.exp(-(ds * ds + rise) / (a2 * d2))


@kernel
def largest(ndf, alpha, dp, ds, ss, reach):
    """Return the azimuth width of the lobe between two states and the mode at which it has decayed by exp(-reach)."""
    a2 = alpha * alpha
    if ndf == 1:
        w = math.sqrt((ds * ds + a2 * dp * dp) / (ss + 1e-300))
        return w, reach / (2.0 * math.asinh(0.5 * w))
    w = alpha * abs(dp) / math.sqrt(ss + 1e-300)
    return w, 2.0 * math.sqrt(reach) / w + 4.0


@kernel
def _range(kind, ndf, alpha, n, dp, ds, ss, cut):
    """Return the end of the azimuths that count (0: none) and that where total reflection ends (-1: none inside)."""
    base = dp * dp + ds * ds
    end, edge = math.pi, -1.0
    if kind == 2:
        y = ((n - 1.0) * (n + 1.0) - base) / (4.0 * ss + 1e-300)
        if y <= 0.0:
            return 0.0, edge
        if y < 1.0:
            end = 2.0 * math.asin(math.sqrt(y))
    if ndf == 0:
        if dp == 0.0 or ds * ds > cut * alpha * alpha * dp * dp:
            return 0.0, edge
        y = cut * alpha * alpha * dp * dp / (4.0 * ss + 1e-300)
        if y < 1.0:
            end = min(end, 2.0 * math.asin(math.sqrt(y)))
    if kind == 1:
        y = (4.0 * (n - 1.0) * (n + 1.0) - base) / (4.0 * ss + 1e-300)
        if 0.0 < y < 1.0:
            edge = 2.0 * math.asin(math.sqrt(y))
    return end, edge


@kernel
def _nodes(kind, ndf, alpha, n, dp, ds, ss, end, edge, first, widest, gauss, phi, value):
    """Fill azimuths and weighted kernel values; returns how many.

    Panels double in width from the lobe outwards up to the widest; that after the end of total reflection is mapped
    by a square, as F falls there like a root.
    """
    base = dp * dp + ds * ds
    count = gauss.shape[1]
    used = 0
    low = 0.0
    width = min(first, widest)
    while low < end:
        high = low + width
        if high + 0.3 * width >= end or used + 3 * count > phi.size:
            high = end
        rooted = edge >= 0.0 and low == edge
        if edge > low and high > edge:
            high = edge
        for g in range(count):
            y, w = gauss[0, g], gauss[1, g]
            if rooted:
                w *= 2.0 * y
                y *= y
            f = low + (high - low) * y
            h = math.sin(0.5 * f)
            rise = 4.0 * ss * h * h
            x = base + rise
            if x > 0.0:
                v = amplitude(kind, x, n) * _density(ndf, alpha, dp, ds, x, rise)
                phi[used] = f
                value[used] = v * w * (high - low) / math.pi
                used += 1
        low = high
        width = min(max(low, width), widest)
    return used


@kernel
def _sum_modes(used, phi, value, start, stop, scratch, out):
    """Add up value cos(m phi) for m = start .. stop - 1 into out."""
    padded = (used + LANES - 1) // LANES * LANES
    for g in range(used, padded):
        phi[g], value[g] = 0.0, 0.0
    lanes = np.empty(LANES)
    for g in range(padded):
        v, f = value[g], phi[g]
        scratch[0, g] = v * math.cos((start - 1) * f)
        scratch[1, g] = v * math.cos(start * f)
        scratch[2, g] = 2.0 * math.cos(f)
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
def _pair(kind, p, s, q, sq):
    """Return dp (positive where light scatters so), ds and s s' of two states."""
    dp = q - p if kind == 0 else p - q
    ds = (p - q) * (p + q) / (s + sq + 1e-300) if kind < 2 else sq - s
    return dp, ds, s * sq


@parallel_kernel
def integrate(kind, surface, p, s, panel, q, sq, panel_q, factors, start, count, reach, gauss, out):
    """Fill out (count, A, B) with modes start .. start + count - 1 between states (p, s) and (q, sq).

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
    reach : float
        A mode is left out where the lobe has decayed by exp(-reach).
    gauss : ndarray (2, G)
        Rule on (0, 1).
    """
    ndf, alpha, n = surface
    per = factors.shape[1]
    size = gauss.shape[1]
    total = start + count
    capacity = size * (48 + int(math.pi * total / size)) + LANES
    for a in numba.prange(p.size):
        phi, value = np.empty(capacity), np.empty(capacity)
        scratch, row = np.empty((3, capacity)), np.empty(count)
        for b in range(q.size):
            dp, ds, ss = _pair(kind, p[a], s[a], q[b], sq[b])
            same = panel[a] == panel_q[b] and panel[a] >= 0
            out[:, a, b] = 0.0
            if dp < 0.0 or (dp == 0.0 and not same):
                continue
            end, edge = _range(kind, ndf, alpha, n, dp, ds, ss, 2.0 * reach)
            if end <= 0.0:
                continue
            w, most = largest(ndf, alpha, dp, ds, ss, reach)
            # edges and roots of the amplitude leave slow tails, which a few modes more hold
            stop = int(min(most + 12.0, float(total))) if dp > 0.0 else total
            if stop <= start:
                continue
            first = max(w, 1e-6) if dp > 0.0 else 1.0
            used = _nodes(kind, ndf, alpha, n, dp, ds, ss, end, edge, first, 2.0 * size / stop, gauss, phi, value)
            _sum_modes(used, phi, value, start, stop, scratch, row)
            f = factors[0 if kind == 0 else 1, a % per, b % per] if same else 1.0
            for m in range(stop - start):
                out[m, a, b] = f * row[m]


@kernel
def _residue(kind, alpha, n, dp, ds, ss, order):
    """Return mode `order` (real) of GGX's lobe alone: the double pole of D at X = (1 - alpha^2) dp^2."""
    a2 = alpha * alpha
    b = (1.0 - a2) * dp * dp
    c = ds * ds + a2 * dp * dp
    big_b = 2.0 * ss
    root = math.sqrt(c * (c + 2.0 * big_b))
    eta = 2.0 * math.asinh(math.sqrt(0.25 * c / (ss + 1e-300)))
    value = amplitude(kind, max(b, 0.0), n)
    # a secant over the width of the lobe stands for the slope, as A has edges
    slope = (amplitude(kind, max(b, 0.0) + c, n) - value) / c
    terms = (2.0 * b * value + b * b * slope) / root
    terms += b * b * value * (order / (root * root) + (c + big_b) / (root * root * root))
    return a2 / math.pi * math.exp(-order * eta) * terms


@parallel_kernel
def lobes(kind, surface, p, s, q, sq, orders, reach, gauss, out):
    """Fill out (M, A, B) with high modes of real order (M,), increasing; see `integrate`.

    GGX: the lobe's pole in closed form. Beckmann: by quadrature, the lobe being narrow and nothing beside it.
    """
    ndf, alpha, n = surface
    size = gauss.shape[1]
    top = orders[orders.size - 1]
    capacity = size * 96 + LANES
    for a in numba.prange(p.size):
        phi, value = np.empty(capacity), np.empty(capacity)
        for b in range(q.size):
            out[:, a, b] = 0.0
            dp, ds, ss = _pair(kind, p[a], s[a], q[b], sq[b])
            if dp <= 0.0 or ss <= 0.0:
                continue
            w, most = largest(ndf, alpha, dp, ds, ss, reach)
            if most < orders[0]:
                continue
            if ndf == 1:
                for m in range(orders.size):
                    if orders[m] <= most:
                        out[m, a, b] = _residue(kind, alpha, n, dp, ds, ss, orders[m])
                continue
            end, edge = _range(kind, ndf, alpha, n, dp, ds, ss, 2.0 * reach)
            if end <= 0.0:
                continue
            widest = 2.0 * size / min(most, top)
            used = _nodes(kind, ndf, alpha, n, dp, ds, ss, end, edge, max(w, 1e-9), widest, gauss, phi, value)
            for m in range(orders.size):
                total = 0.0
                for g in range(used):
                    total += value[g] * math.cos(orders[m] * phi[g])
                out[m, a, b] = total
