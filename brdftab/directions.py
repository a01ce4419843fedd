"""Angles and vectors: the one place where theta, phi and the half/difference frame are defined.

The surface normal is z, azimuth 0 is x (the ``alpha_x`` direction), and both the light direction ``i`` and the view
direction ``o`` point away from the surface. The relative azimuth is ``phi = phi_o - phi_i``: the mirror direction
lies at ``phi = pi``, the retro direction at ``phi = 0``. Every angle is in radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdftab.errors import ParameterError
from brdftab.typing import Array

TWO_PI = 2.0 * np.pi
# directions whose cosine is no larger lie on the horizon, where nothing is reflected
HORIZON = 1e-15
# half vectors of no larger sine are the normal: the mirror direction, where bounces may be infinite
MIRROR_SINE = 1e-14


def checked_angles(**angles: ArrayLike) -> tuple[tuple[int, ...], list[Array]]:
    """Check angles and return their common shape and flat float64 arrays.

    Parameters
    ----------
    **angles : array_like
        Radians by name, as theta_i, theta_o, phi; those that begin with theta lie in [0, pi]. They broadcast.

    Returns
    -------
    shape : tuple of int
    flat : list of ndarray of float64, shape (N,)

    Raises
    ------
    ParameterError
        If an angle is not finite or out of range, or the angles do not broadcast.
    """
    try:
        given = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in angles.values()))
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{', '.join(angles)} do not broadcast as numbers: {error}") from None
    for name, angle in zip(angles, given, strict=True):
        bad, polar = ~np.isfinite(angle), name.startswith("theta")
        if polar:
            bad |= (angle < 0.0) | (angle > np.pi)
        if bad.any():
            shown = f"{np.degrees(angle[bad].flat[0]):g} degrees"
            valid = "[0, 180] degrees" if polar else "the finite numbers"
            raise ParameterError.out_of_range(name, shown, valid, "directions point away from the surface")
    # copies, for views of broadcast arrays are of another type to kernels
    return given[0].shape, [angle.flatten() for angle in given]


def to_vector(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Return the unit vectors of directions given by angles.

    Parameters
    ----------
    theta, phi : array_like
        Polar angle from the normal and azimuth from x, radians; they broadcast.

    Returns
    -------
    ndarray, shape (..., 3)
    """
    theta, phi = np.broadcast_arrays(np.asarray(theta, np.float64), np.asarray(phi, np.float64))
    sine = np.sin(theta)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)], axis=-1)


def from_vector(v: ArrayLike) -> tuple[Array, Array]:
    """Return the angles of vectors, which need not have unit length.

    Parameters
    ----------
    v : array_like, shape (..., 3)

    Returns
    -------
    theta : ndarray, shape (...), in [0, pi]
        By ``atan2(hypot(x, y), z)``: full precision at the poles, where ``acos(z)`` loses half the digits.
    phi : ndarray, shape (...), in [0, 2 pi)
        0 on the z axis.
    """
    v = np.asarray(v, np.float64)
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.arctan2(np.hypot(x, y), z), wrap(np.arctan2(y, x))


def wrap(phi: ArrayLike) -> Array:
    """Fold azimuths into [0, 2 pi).

    Parameters
    ----------
    phi : array_like
        Azimuth, radians, any finite value.

    Returns
    -------
    ndarray, in [0, 2 pi)
    """
    folded = np.mod(np.asarray(phi, np.float64), TWO_PI)
    # a tiny negative azimuth rounds up to 2 pi itself, and mod may give -0.0
    return np.where(folded >= TWO_PI, 0.0, folded) + 0.0


def relative_azimuth(phi_i: ArrayLike, phi_o: ArrayLike) -> Array:
    """Return ``phi_o - phi_i`` folded by mirror symmetry to [0, pi].

    Parameters
    ----------
    phi_i, phi_o : array_like
        Azimuths of light and view, radians; they broadcast.

    Returns
    -------
    ndarray, in [0, pi]
        ``pi`` is the mirror side, 0 the retro side.
    """
    # the remainder is exact, so a difference already in [-pi, pi] comes back untouched
    difference = np.abs(np.asarray(phi_o, np.float64) - np.asarray(phi_i, np.float64))
    folded = np.fmod(difference, TWO_PI)
    return np.where(folded > np.pi, TWO_PI - folded, folded)


def half_difference(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_o: ArrayLike, phi_o: ArrayLike
) -> tuple[Array, Array, Array, Array]:
    """Return the half and difference angles of a pair of directions.

    Parameters
    ----------
    theta_i, phi_i, theta_o, phi_o : array_like
        Light and view direction, radians; they broadcast.

    Returns
    -------
    theta_h, phi_h, theta_d, phi_d : ndarray
        theta_h in [0, pi], phi_h in [0, 2 pi), theta_d in [0, pi/2], phi_d in [0, 2 pi). Where the half vector is
        the normal, phi_h is 0; where light and view coincide, phi_d is 0.

    Notes
    -----
    Rusinkiewicz, "A New Change of Variables for Efficient BRDF Representation", EGWR 1998: the difference vector is
    the light direction rotated by -phi_h about the normal and then by -theta_h about the y axis.
    """
    light, view = np.broadcast_arrays(to_vector(theta_i, phi_i), to_vector(theta_o, phi_o))
    total, gap = light + view, light - view
    theta_h, phi_h = from_vector(total)
    # |i - o| = 2 sin theta_d and |i + o| = 2 cos theta_d: no acos, so equal directions give an exact 0
    theta_d = np.arctan2(np.linalg.norm(gap, axis=-1), np.linalg.norm(total, axis=-1))
    cos_h, sin_h, cos_p, sin_p = np.cos(theta_h), np.sin(theta_h), np.cos(phi_h), np.sin(phi_h)
    # i - o is twice the part of i orthogonal to h, so its azimuth in h's frame is phi_d without cancellation
    along = gap[..., 0] * cos_p + gap[..., 1] * sin_p
    x = along * cos_h - gap[..., 2] * sin_h
    y = gap[..., 1] * cos_p - gap[..., 0] * sin_p
    return theta_h, phi_h, theta_d, wrap(np.arctan2(y, x))


def in_out(
    theta_h: ArrayLike, phi_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> tuple[Array, Array, Array, Array]:
    """Return light and view angles from half and difference angles, the inverse of `half_difference`.

    Parameters
    ----------
    theta_h, phi_h, theta_d, phi_d : array_like
        Radians; they broadcast.

    Returns
    -------
    theta_i, phi_i, theta_o, phi_o : ndarray
        theta in [0, pi] (above pi/2 the direction lies below the surface), phi in [0, 2 pi).
    """
    half, light = np.broadcast_arrays(to_vector(theta_h, phi_h), to_vector(theta_d, phi_d))
    theta_h, phi_h = np.asarray(theta_h, np.float64), np.asarray(phi_h, np.float64)
    cos_h, sin_h, cos_p, sin_p = np.cos(theta_h), np.sin(theta_h), np.cos(phi_h), np.sin(phi_h)
    # the part of the light direction orthogonal to h, rotated back: theta_h about y, then phi_h about z
    x = light[..., 0] * cos_h
    across = np.stack(
        [x * cos_p - light[..., 1] * sin_p, x * sin_p + light[..., 1] * cos_p, -light[..., 0] * sin_h], -1
    )
    along = light[..., 2:] * half
    return *from_vector(along + across), *from_vector(along - across)
