"""The half-vector frame of a pair of directions: the plane of the groove and the in-plane angles."""

from __future__ import annotations

import math

from brdftab.jit import kernel


@kernel
def pair(theta_i, theta_o, phi):
    """Return sines, cosines and the cancellation-free sums of a pair of directions.

    Parameters
    ----------
    theta_i, theta_o, phi : float
        Radians; phi = phi_o - phi_i.

    Returns
    -------
    tuple of float
        si, ci, so, co; hx, hy (unnormalised half vector in the frame whose x axis is the light's azimuth) and
        ox = so + si cos(phi), the same sum seen from the view direction.
    """
    si, ci = math.sin(theta_i), math.cos(theta_i)
    so, co = math.sin(theta_o), math.cos(theta_o)
    half = math.cos(0.5 * phi)
    one_plus = 2.0 * half * half
    diff = 2.0 * math.cos(0.5 * (theta_i + theta_o)) * math.sin(0.5 * (theta_i - theta_o))
    hx = diff + so * one_plus
    hy = so * math.sin(phi)
    ox = si * one_plus - diff
    return si, ci, so, co, hx, hy, ox


@kernel
def groove_plane(si, ci, so, co, hx, hy, ox):
    """Return sin(theta_h), cos(theta_h), i.h, L and the in-plane sines and cosines of both directions.

    L is the length of the projection of i (and of o) into the plane of normal and half vector. Angles are positive
    towards h; at h = n any plane serves and the light's own is taken.
    """
    length = math.hypot(hx, hy)
    up = ci + co
    full = math.hypot(length, up)
    if length > 0.0:
        it = si * (hx / length)
        ot = so * (ox / length)
    else:
        it, ot = si, -si
    big_l = math.hypot(it, ci)
    big_lo = math.hypot(ot, co)
    return (
        length / full,
        up / full,
        0.5 * full,
        0.5 * (big_l + big_lo),
        it / big_l,
        ci / big_l,
        ot / big_lo,
        co / big_lo,
    )
