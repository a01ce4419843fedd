"""The sum over the nodes of the body integral in JAX, with its derivatives in the same pass.

Forward mode through the loop would carry one copy of every intermediate a parameter. The derivatives of the
transmission are short once written out, so the loop adds up value and slopes and hands them to JAX as its rule.
"""

from __future__ import annotations

import math
from functools import partial

import jax
import jax.numpy as jnp


def transmission_slopes(n, q, c):
    """Return T and its derivatives by the cosine c > 0 and by the index n >= 1; q = n^2 - 1.

    With g = sqrt(q + c^2), u = g + c, v = n^2 c + g the two polarisations are S = 4 g c/u^2 and P = 4 n^2 g c/v^2, and
    dS/dc = 4 q^2/(g u^4), dP/dc = 4 n^2 q (g - n^2 c)/(g v^3), dS/dn = -4 n c q/(g u^4),
    dP/dn = 4 n c (g - n^2 c)(2 g^2 - n^2)/(g v^3); T is their mean.
    """
    m = q + 1.0
    g = jnp.sqrt(q + c * c)
    mc = m * c
    u, v = g + c, mc + g
    inverse = 1.0 / (g * u * v)
    iu, iv, ig = inverse * (g * v), inverse * (g * u), inverse * (u * v)
    iu2, iv2 = iu * iu, iv * iv
    gc = 2.0 * g * c
    bend = 2.0 * (g - mc) * ig * iv2 * iv
    side = 2.0 * q * ig * iu2 * iu2
    value = gc * (iu2 + m * iv2)
    return value, q * side + m * q * bend, n * c * ((2.0 * g * g - m) * bend - side)


def _sum(cavity, sx, sy, n, nodes, geometry, count):
    """Return I and its derivatives by sx, sy and n, at fixed nodes."""
    ix, iy, iz, ox, oy, oz = geometry
    q = (n - 1.0) * (n + 1.0)
    least = jnp.asarray(1e-15, ix.dtype)

    def step(k, totals):
        x, y, weight = (v[k] for v in nodes)
        xi, yi, xo, yo = ix * x, iy * y, ox * x, oy * y
        a, b = 1.0 + (sx * xi + sy * yi), 1.0 + (sx * xo + sy * yo)
        lit = (a > 0.0) & (b > 0.0)
        mz = jax.lax.rsqrt(1.0 + ((sx * x) ** 2 + (sy * y) ** 2))
        ci = jnp.maximum(jnp.minimum(iz * a * mz, 1.0), least)
        co = jnp.maximum(jnp.minimum(oz * b * mz, 1.0), least)
        ti, tic, tin = transmission_slopes(n, q, ci)
        to, toc, ton = transmission_slopes(n, q, co)
        product = a * b
        if cavity:
            smaller = 2.0 * jnp.minimum(a, b)
            inner = product <= smaller
            g = jnp.where(inner, product, smaller)
            first = jnp.where(inner, b, jnp.where(a <= b, 2.0, 0.0))
            second = jnp.where(inner, a, jnp.where(a <= b, 0.0, 2.0))
        else:
            g, first, second = product, b, a
        both = ti * to
        w = jnp.where(lit, weight * mz, 0.0)
        gw = g * w
        # along a and b, and along m_z
        pull_a = w * first * both + gw * tic * to * (iz * mz)
        pull_b = w * second * both + gw * ti * toc * (oz * mz)
        pull_z = gw * (both + mz * (tic * to * (iz * a) + ti * toc * (oz * b)))
        dzx, dzy = -mz * mz * sx * x * x, -mz * mz * sy * y * y
        value, sum_x, sum_y, sum_n = totals
        value = value + gw * both
        sum_x = sum_x + (pull_a * xi + pull_b * xo + pull_z * dzx)
        sum_y = sum_y + (pull_a * yi + pull_b * yo + pull_z * dzy)
        sum_n = sum_n + gw * (tin * to + ti * ton)
        return value, sum_x, sum_y, sum_n

    zero = jnp.zeros_like(ix)
    totals = jax.lax.fori_loop(0, jnp.asarray(count).astype(int), step, (zero, zero, zero, zero))
    return tuple(v / math.pi for v in totals)


@partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def integral(cavity, gaussian, sx, sy, n, nodes, geometry, count):
    """Return I (1/sr) by fixed nodes, unmasked with Smith.

    Parameters
    ----------
    cavity, gaussian : bool
        Static: V-cavity masking inside the integral; nodes that move with sx (the Gaussian's).
    sx, sy, n : Array
        Scales of the slopes and index of refraction; differentiable.
    nodes : tuple of Array (Q,)
        Slopes before scaling along both axes, and weights; differentiable for the Gaussian only.
    geometry : tuple of Array (N,)
        Tangent-plane slopes and cosine of light and view; taken as constant.
    count : float
        How many of the nodes to sum.
    """
    return _sum(cavity, sx, sy, n, nodes, geometry, count)[0]


@integral.defjvp
def _(cavity, gaussian, primals, tangents):
    sx, sy, n, nodes, geometry, count = primals
    if gaussian:
        # its weights and slopes depend on sigma: plain forward mode, at the cost of a pass a parameter
        def plain(sx, sy, n, nodes):
            return _sum(cavity, sx, sy, n, nodes, geometry, count)[0]

        return jax.jvp(plain, (sx, sy, n, nodes), tangents[:4])
    value, by_x, by_y, by_n = _sum(cavity, sx, sy, n, nodes, geometry, count)
    return value, by_x * tangents[0] + by_y * tangents[1] + by_n * tangents[2]
