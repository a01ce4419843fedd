"""Unpolarised Fresnel reflectance, one wavelength at a time or multiplied into a row of wavelengths.

Kinds: 0 mirror (F = 1), 1 conductor (a = eta, b = k), 2 dielectric (a = ior >= 1), 3 Schlick (a = f0), 4 Lazányi
and Szirmay-Kalos (a = f0, b = factor of the dip's term).
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.materials.fresnel import CONDUCTOR, DIELECTRIC, MIRROR, SCHLICK


@kernel
def _conductor(n, k, c):
    c2 = c * c
    s2 = 1.0 - c2
    # at an index of 1 the difference would leave rounding in place of c^2
    t0 = c2 - k * k if n == 1.0 else n * n - k * k - s2
    nk2 = 2.0 * n * k
    t = math.sqrt(t0 * t0 + nk2 * nk2)
    # of the root's two parts the smaller follows from their product n k, so that it keeps its digits as k -> 0
    larger = math.sqrt(0.5 * (t + abs(t0)))
    p2 = 2.0 * c * (larger if t0 >= 0.0 else n * k / larger)
    u = t + c2
    v = t * c2 + s2 * s2
    w = p2 * s2
    if u + p2 <= 0.0:
        # no interface, along the surface
        return 0.0
    # 0.5 rs (1 + rp/rs) over one denominator
    return max(u - p2, 0.0) * v / ((u + p2) * (v + w))


@kernel
def _dielectric(n, c):
    q = (n - 1.0) * (n + 1.0)
    if q <= 0.0:
        return 0.0
    c2 = c * c
    g = math.sqrt(q + c2)
    # differences of near-equal numbers are written as products, so that n -> 1 keeps all digits
    u = c + g
    v = (q + 1.0) * c + g
    rs = q / (u * u)
    rp = q * ((q + 2.0) * c2 - 1.0) / (v * v)
    return 0.5 * (rs * rs + rp * rp)


@kernel
def reflectance(kind, a, b, cosine):
    """Return F in [0, 1] at the cosine of incidence (clipped to [0, 1])."""
    c = min(max(cosine, 0.0), 1.0)
    if kind == MIRROR:
        return 1.0
    if kind == CONDUCTOR:
        return _conductor(a, b, c)
    if kind == DIELECTRIC:
        return _dielectric(a, c)
    q = 1.0 - c
    q2 = q * q
    q4 = q2 * q2
    approximate = a + (1.0 - a) * q4 * q
    if kind == SCHLICK:
        return approximate
    return min(max(approximate - b * c * q4 * q2, 0.0), 1.0)


@kernel
def multiply(kind, a, b, table, cosine, row):
    """Multiply row[w] by F_w(cosine) for every wavelength w; `table` (cells + 1, 2 W) serves if it is not empty.

    A row of the table holds F at the cell's left end, then the step to its right end, for all wavelengths together, so
    that one look-up serves them all.
    """
    if kind == MIRROR:
        return
    size = row.size
    cells = table.shape[0] - 1
    if cells > 0:
        x = max(cosine, 0.0) * cells
        i = min(int(x), cells - 1)
        t = x - i
        entry = table[i]
        for w in range(size):
            row[w] *= entry[w] + t * entry[size + w]
        return
    c = min(max(cosine, 0.0), 1.0)
    if kind == CONDUCTOR:
        for w in range(size):
            row[w] *= _conductor(a[w], b[w], c)
    else:
        for w in range(size):
            row[w] *= reflectance(kind, a[w], b[w], c)


@kernel
def fill_table(kind, a, b, cells):
    """Return the look-up table of `multiply` with that many cells, and its largest relative error at the midpoints."""
    size = a.size
    table = np.empty((cells + 1, 2 * size))
    worst = 0.0
    for w in range(size):
        left = reflectance(kind, a[w], b[w], 0.0)
        for i in range(cells + 1):
            right = reflectance(kind, a[w], b[w], (i + 1.0) / cells)
            table[i, w] = left
            table[i, size + w] = right - left
            exact = reflectance(kind, a[w], b[w], (i + 0.5) / cells)
            if i < cells:
                worst = max(worst, abs(0.5 * (left + right) - exact) / max(exact, 1e-300))
            left = right
    return table, worst


@kernel
def multiply_chain(kind, a, b, table, big_l, first, step, count, row):
    """Multiply a row by F(L sin(first + j step)) for j = 0 .. count - 1: the bounces of one ray in a groove."""
    if kind == MIRROR:
        return
    s, c = math.sin(first), math.cos(first)
    ss, cs = math.sin(step), math.cos(step)
    for _ in range(count):
        multiply(kind, a, b, table, big_l * s, row)
        s, c = s * cs + c * ss, c * cs - s * ss


CHAIN_SAMPLES = 24


@kernel
def multiply_long_chain(kind, a, b, table, big_l, low, high, count, row, scratch):
    """Multiply a row by the product over `count` >> 1 (real) bounces spread evenly over (low, high).

    The sum of log F over the bounces is `count` times its mean, taken at 24 midpoints: an Euler-Maclaurin step whose
    error falls like 1/24^2 and acts only on the far tail of the bounce sum.
    """
    if kind == MIRROR:
        return
    step = (high - low) / CHAIN_SAMPLES
    for w in range(scratch.size):
        scratch[w] = 1.0
    multiply_chain(kind, a, b, table, big_l, low + 0.5 * step, step, CHAIN_SAMPLES, scratch)
    power = count / CHAIN_SAMPLES
    for w in range(row.size):
        row[w] *= scratch[w] ** power
