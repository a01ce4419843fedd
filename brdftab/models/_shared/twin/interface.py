"""A smooth dielectric interface over a matte body in JAX, under the names of the Numba module."""

from __future__ import annotations

import jax.numpy as jnp

from brdftab.models._shared.fresnel.interface import SERIES_BELOW, series

_SERIES = tuple(float(c) for c in series())


def transmission(n, c):
    """Return T = 1 - F at the cosine of incidence c in [0, 1] for an index n >= 1; a product, exact at grazing."""
    q = (n - 1.0) * (n + 1.0)
    square = q + c * c
    live = square > 0.0
    g = jnp.sqrt(jnp.where(live, square, 1.0))
    u = g + c
    v = (q + 1.0) * c + g
    product = u * v
    # at grazing incidence on n = 1 nothing is left of the interface
    return jnp.where(live, 2.0 * g * c * (v * v + (q + 1.0) * u * u) / (product * product), 1.0)


def external_reflectance(n):
    """Return r_e in [0, 1) (Meneveaux et al. 2018, Eq. 11), with a finite derivative at n = 1 (1/3)."""
    y = (n - 1.0) / (n + 1.0)
    n2 = n * n
    q = (n - 1.0) * (n + 1.0)
    p = n2 + 1.0
    total = n2 * q * q / (p * p * p) * jnp.log(jnp.where(y > 0.0, y, 1.0))
    near = n < SERIES_BELOW
    z = jnp.where(near, y, 0.0)
    a = jnp.zeros_like(z)
    for c in _SERIES[::-1]:
        a = a * z + c
    m = jnp.where(near, 2.0, n)
    m2 = m * m
    m4, s, t = m2 * m2, (m - 1.0) * (m + 1.0), m2 + 1.0
    far = 8.0 * m4 * (m4 + 1.0) / (t * t * t * s * s) * jnp.log(m)
    far += (m - 1.0) * (3.0 * m + 1.0) / (6.0 * (m + 1.0) * (m + 1.0))
    far += 0.5 - 2.0 * m * m2 * (m2 + 2.0 * m - 1.0) / (t * t * s)
    return jnp.where(near, a, far) + total


def body_factor(kd, n):
    """Return kappa = kd/(n^2 (1 - kd r_i)), what multiplies T(i) T(o)/pi of a flat surface (Eq. 9)."""
    return kd / (n * n * (1.0 - kd) + kd * (1.0 - external_reflectance(n)))
