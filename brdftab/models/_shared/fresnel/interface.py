"""A smooth dielectric interface over a matte body: transmission, diffuse reflectances and the factor of the body.

Everything is written so that no digits cancel: at grazing incidence, for an index near 1 and for an albedo near 1.
F itself is `fresnel.reflectance` of kind 2.

References
----------
Meneveaux et al., "Rendering Rough Opaque Materials with Interfaced Lambertian Microfacets", 2018, Eqs. 8 to 11.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from brdftab.jit import kernel

# below this index the closed form of r_e cancels and its series in (n - 1)/(n + 1) < 0.24 takes over
SERIES_BELOW = 1.6
SERIES_TERMS = 36


def _times(a: list[Fraction], b: list[Fraction], size: int) -> list[Fraction]:
    """Return the product of two power series, cut at `size` terms."""
    out = [Fraction(0)] * size
    for i, x in enumerate(a[:size]):
        for j, y in enumerate(b[: size - i]):
            out[i + j] += x * y
    return out


def series(size: int = SERIES_TERMS) -> np.ndarray:
    """Return the Taylor coefficients (size,) of A(y) in r_e = A(y) + n^2 (n^2-1)^2/(n^2+1)^3 ln y, y = (n-1)/(n+1).

    With n = (1+y)/(1-y), Eq. 11 without its second logarithm is 1/2 + y (2+y)/6 + N(y)/(4 y), where
    N = (1+y)^4 (1-y)^2 (1+6y^2+y^4) (artanh(y)/y)/(1+y^2)^3 - (1+y)^3 (1-y) (1+2y-y^2)/(1+y^2)^2 starts with y.
    """
    length = size + 1
    plus, minus = [Fraction(1), Fraction(1)], [Fraction(1), Fraction(-1)]
    # 1/(1+y^2), whose square and cube follow by multiplication
    geometric = [Fraction((-1) ** (k // 2) if k % 2 == 0 else 0) for k in range(length)]
    artanh = [Fraction(1, k + 1) if k % 2 == 0 else Fraction(0) for k in range(length)]
    shared = geometric
    for factor in (geometric, plus, plus, plus, minus):
        shared = _times(shared, factor, length)
    first = shared
    for factor in (geometric, plus, minus, [Fraction(c) for c in (1, 0, 6, 0, 1)], artanh):
        first = _times(first, factor, length)
    second = _times(shared, [Fraction(c) for c in (1, 2, -1)], length)
    quotient = [(a - b) / 4 for a, b in zip(first, second, strict=True)][1:]
    for power, value in ((0, Fraction(1, 2)), (1, Fraction(1, 3)), (2, Fraction(1, 6))):
        quotient[power] += value
    return np.array([float(c) for c in quotient])


_SERIES = series()


@kernel
def transmission(n, c):
    """Return T = 1 - F in [0, 1] of an interface of index n >= 1 at the cosine of incidence c in [0, 1].

    T = 2 g c (1/(g+c)^2 + n^2/(n^2 c + g)^2) with g = sqrt(n^2 - 1 + c^2): a product, exact at grazing incidence.
    """
    q = (n - 1.0) * (n + 1.0)
    if q <= 0.0:
        return 1.0
    g = math.sqrt(q + c * c)
    u = g + c
    v = (q + 1.0) * c + g
    return 2.0 * g * c * (1.0 / (u * u) + (q + 1.0) / (v * v))


@kernel
def external_reflectance(n):
    """Return r_e in [0, 1): the share of diffuse light from outside that an interface of index n >= 1 reflects.

    Eq. 11, by the series of `series` below n = 1.6; relative error below 3e-15 for every n in [1, 100].
    """
    if n <= 1.0:
        return 0.0
    n2 = n * n
    q = (n - 1.0) * (n + 1.0)
    p = n2 + 1.0
    y = (n - 1.0) / (n + 1.0)
    total = n2 * q * q / (p * p * p) * math.log(y)
    if n < SERIES_BELOW:
        a = 0.0
        for k in range(SERIES_TERMS - 1, -1, -1):
            a = a * y + _SERIES[k]
        return a + total
    n4 = n2 * n2
    total += 8.0 * n4 * (n4 + 1.0) / (p * p * p * q * q) * math.log(n)
    total += y * (3.0 * n + 1.0) / (6.0 * (n + 1.0))
    return total + 0.5 - 2.0 * n * n2 * (n2 + 2.0 * n - 1.0) / (p * p * q)


@kernel
def internal_reflectance(n):
    """Return r_i in [0, 1): the same from inside, (n^2 - 1 + r_e)/n^2."""
    return ((n - 1.0) * (n + 1.0) + external_reflectance(n)) / (n * n)


@kernel
def body_factor(kd, n):
    """Return kappa = kd/(n^2 (1 - kd r_i)), what multiplies T(i) T(o)/pi of a flat surface (Eq. 9).

    The denominator is n^2 (1 - kd) + kd (1 - r_e), a sum of positive terms.
    """
    return kd / (n * n * (1.0 - kd) + kd * (1.0 - external_reflectance(n)))


@kernel
def grazing_scale(n):
    """Return the cosine of incidence below which T is linear: sqrt(n^2-1) near n = 1, 1/n for large n, 1 at n = 1."""
    q = (n - 1.0) * (n + 1.0)
    if q <= 0.0:
        return 1.0
    g = math.sqrt(q)
    return min(1.0, g, g / (n * n) if n > 2.0 else 1.0)
