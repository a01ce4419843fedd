"""Unpolarised Fresnel reflectance in JAX; the kind is static.

Source: M. Born and E. Wolf, Principles of Optics, 7th ed., sections 1.5 and 14.2.
"""

from __future__ import annotations

import jax.numpy as jnp

MIRROR, CONDUCTOR, DIELECTRIC, SCHLICK, LAZANYI = range(5)


def _conductor(n, k, c):
    """Return F for the index n + ik.

    q + ir is the root of (n + ik)^2 - sin^2: the smaller part follows from q r = n k, so that it keeps its digits and
    a finite derivative where k -> 0.
    """
    c2, s2 = c * c, (1.0 - c) * (1.0 + c)
    contrast = (n - 1.0) * (n + 1.0) - k * k
    # the same number twice: the one keeps its digits for n near 0, the other for n near 1 at grazing
    e = jnp.where(c2 > 0.5, n * n - k * k - s2, contrast + c2)
    cross = 2.0 * n * k
    square = e * e + cross * cross
    # 0 only for k = 0 at the critical angle, where the derivative by k has no limit; 0 is taken
    live = square > 0.0
    t = jnp.sqrt(jnp.where(live, square, 1.0))
    larger = jnp.sqrt(0.5 * (t + jnp.abs(e)))
    smaller = 0.5 * cross / larger
    clear = e >= 0.0
    q = jnp.where(live, jnp.where(clear, larger, smaller), 0.0)
    r = jnp.where(live, jnp.where(clear, smaller, larger), 0.0)
    # q = r = c = 0: the interface that is not there (n = 1, k = 0) at grazing
    there = live | (c > 0.0)
    total = jnp.where(there, q + c, 1.0)
    # q^2 - c^2 without cancellation, for n + ik near 1
    r2 = r * r
    less = jnp.where(clear, (contrast + r2) / jnp.where(clear, total, 1.0), q - c)
    rs = (less * less + r2) / (total * total + r2)
    v = (q * q + r2) * c2 + s2 * s2
    return jnp.where(there, rs * v / (v + 2.0 * c * q * s2), 0.0)


def _dielectric(n, c):
    """Return F for the index n >= 1; products instead of differences, so that n -> 1 keeps all digits."""
    q = (n - 1.0) * (n + 1.0)
    c2 = c * c
    # nothing is left of the interface at n = 1, and at grazing the formula is 0/0 there
    live = (q >= 0.0) & (q + c2 > 0.0)
    q = jnp.where(live, q, 1.0)
    g = jnp.sqrt(q + c2)
    u = c + g
    v = (q + 1.0) * c + g
    rs = q / (u * u)
    rp = q * ((q + 2.0) * c2 - 1.0) / (v * v)
    return jnp.where(live, 0.5 * (rs * rs + rp * rp), 0.0)


def reflectance(kind, a, b, cosine):
    """Return F in [0, 1] at the cosine of incidence.

    Parameters
    ----------
    kind : int
        Static: 0 mirror (F = 1), 1 conductor (a = eta, b = k), 2 dielectric (a = index >= 1), 3 Schlick (a = f0),
        4 Lazányi and Szirmay-Kalos (a = f0, b = factor of the dip's term).
    a, b : Array or None
        Parameters of the kind; None where unused.
    cosine : Array (N,)
        Clipped to [0, 1].
    """
    c = jnp.clip(cosine, 0.0, 1.0)
    if kind == MIRROR:
        return jnp.ones_like(c)
    if kind == CONDUCTOR:
        return _conductor(a, b, c)
    if kind == DIELECTRIC:
        return _dielectric(a, c)
    q = 1.0 - c
    q2 = q * q
    approximate = a + (1.0 - a) * q2 * q2 * q
    if kind == LAZANYI:
        return jnp.clip(approximate - b * c * q2 * q2 * q2, 0.0, 1.0)
    return approximate
