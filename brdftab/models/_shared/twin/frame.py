"""Pairs of directions as the twins take them, and the half-vector frame in JAX."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from brdftab.directions import HORIZON

# theta_i, theta_o, phi, phi_i of the pair that stands in for one below the horizon
STAND_IN = (0.5, 0.7, 1.0, 0.0)


class Directions(NamedTuple):
    """Pairs of directions, arrays (N,); angles in radians.

    si, ci, so, co are sines and cosines of the polar angles; hx, hy the unnormalised half vector in the frame whose x
    axis is the light's azimuth; ox the same sum seen from the view direction; cos_i to sin_o belong to the azimuths
    phi_i and phi_i + phi.
    """

    theta_i: Any
    theta_o: Any
    phi: Any
    phi_i: Any
    si: Any
    ci: Any
    so: Any
    co: Any
    hx: Any
    hy: Any
    ox: Any
    cos_i: Any
    sin_i: Any
    cos_o: Any
    sin_o: Any


def directions(theta_i: Any, theta_o: Any, phi: Any, phi_i: Any) -> Directions:
    """Pack pairs of directions once, in NumPy and float64, with sums that do not cancel near the mirror direction.

    Parameters
    ----------
    theta_i, theta_o : array_like (N,)
        Polar angles, radians in [0, pi].
    phi, phi_i : array_like (N,)
        phi_o - phi_i and the light's azimuth, radians.

    Returns
    -------
    Directions
        Of float64 (N,).
    """
    ti, to, ph, az = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(x, dtype=np.float64)) for x in (theta_i, theta_o, phi, phi_i))
    )
    si, ci, so, co = np.sin(ti), np.cos(ti), np.sin(to), np.cos(to)
    half = np.cos(0.5 * ph)
    one_plus = 2.0 * half * half
    diff = 2.0 * np.cos(0.5 * (ti + to)) * np.sin(0.5 * (ti - to))
    sums = (diff + so * one_plus, so * np.sin(ph), si * one_plus - diff)
    return Directions(ti, to, ph, az, si, ci, so, co, *sums, np.cos(az), np.sin(az), np.cos(az + ph), np.sin(az + ph))


def lifted(d: Directions) -> tuple[Any, Directions]:
    """Return where both directions are above the horizon, and the pairs with a harmless one put in elsewhere.

    A value is computed from the second and kept where the first holds: neither it nor a derivative then meets a
    division by zero.
    """
    above = jnp.minimum(d.ci, d.co) > HORIZON
    spare = directions(*STAND_IN)
    return above, Directions(*(jnp.where(above, x, s[0]) for x, s in zip(d, spare, strict=True)))


def half_vector(d: Directions) -> tuple[Any, Any, Any, Any, Any]:
    """Return sin and cos of theta_h, i.h, and cos and sin of the half vector's azimuth (1, 0 at the normal)."""
    up = d.ci + d.co
    square = d.hx * d.hx + d.hy * d.hy
    bent = square > 0.0
    flat = jnp.where(bent, jnp.sqrt(jnp.where(bent, square, 1.0)), 0.0)
    full = jnp.sqrt(square + up * up)
    over = jnp.where(bent, flat, 1.0)
    cos_a = jnp.where(bent, (d.hx * d.cos_i - d.hy * d.sin_i) / over, 1.0)
    sin_a = jnp.where(bent, (d.hx * d.sin_i + d.hy * d.cos_i) / over, 0.0)
    return flat / full, up / full, 0.5 * full, cos_a, sin_a


def groove_plane(d: Directions) -> tuple[Any, ...]:
    """Return sin(theta_h), cos(theta_h), i.h, L and the in-plane sines and cosines of light and view.

    L is the length of the projection of either direction into the plane of normal and half vector. Angles are positive
    towards the half vector; where that is the normal the light's own plane is taken.
    """
    square = d.hx * d.hx + d.hy * d.hy
    bent = square > 0.0
    length = jnp.sqrt(jnp.where(bent, square, 1.0))
    it = jnp.where(bent, d.si * (d.hx / length), d.si)
    ot = jnp.where(bent, d.so * (d.ox / length), -d.si)
    big_l, big_lo = jnp.sqrt(it * it + d.ci * d.ci), jnp.sqrt(ot * ot + d.co * d.co)
    sin_h, cos_h, i_h, _, _ = half_vector(d)
    return sin_h, cos_h, i_h, 0.5 * (big_l + big_lo), it / big_l, d.ci / big_l, ot / big_lo, d.co / big_lo
