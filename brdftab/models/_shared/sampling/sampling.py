"""Drawing facets and following rays: the pieces that the models' samplers share.

Directions are unit vectors as float64 arrays (N, 3) with z along the surface normal and x along azimuth 0.
A facet normal is m = (u, v, 1) / sqrt(1 + u^2 + v^2), where (u, v) is the downhill slope of the facet.

References
----------
- [HD14] Heitz, d'Eon, "Importance sampling microfacet-based BSDFs using the distribution of visible normals", 2014.
- [H18] Heitz, "Sampling the GGX distribution of visible normals", 2018; as a spherical cap: Dupuy, Benyoub, 2023.
- [L18] Lee et al., "Practical multiple scattering for rough surfaces", 2018.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.jit import kernel
from brdftab.materials.fresnel import mirror
from brdftab.models._shared.codes import BECKMANN, GGX, PHONG
from brdftab.models._shared.facets import ndf as ndf_piece
from brdftab.models._shared.facets.masking import projected_alpha, smith_lambda
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# beyond this slope (in units of alpha) exp(-u^2) is below 1e-19 of the density: no float64 uniform gets there
_FAR = 6.7
# Phong's slopes have no bound for alpha > 1; this one squares to a finite number
STEEPEST = 1e98
# relative tolerance of the quadrature behind a V-groove's pdf, and of f where a weight divides by it
PDF_TOLERANCE = 1e-4


def unit(theta: Array | float, phi: Array | float) -> Array:
    """Return the unit vectors (..., 3) of polar angles and azimuths in radians."""
    s = np.sin(theta)
    return np.stack(np.broadcast_arrays(s * np.cos(phi), s * np.sin(phi), np.cos(theta)), axis=-1)


def angles(v: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return polar angle (N,), azimuth (N,) in [0, 2 pi) and whether the direction (N, 3) is above the horizon."""
    theta = np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2])
    phi = np.mod(np.arctan2(v[:, 1], v[:, 0]), 2 * np.pi)
    # a tiny negative azimuth rounds to 2 pi itself
    phi[phi >= 2 * np.pi] = 0.0
    return theta, phi, theta < 0.5 * np.pi


def cosine_hemisphere(n: int, rng: np.random.Generator) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Draw `n` directions with density cos(theta) / pi; all are valid."""
    theta = np.arcsin(np.sqrt(rng.random(n)))
    return theta, 2 * np.pi * rng.random(n), np.ones(n, dtype=np.bool_)


def cosine_pdf(theta_o: Array) -> Array:
    """Return cos(theta) / pi above the horizon and 0 elsewhere, 1/sr."""
    return np.maximum(np.cos(theta_o), 0.0) * (theta_o < 0.5 * np.pi) / np.pi


def tilt_tangents(setup: Setup, n: int, rng: np.random.Generator) -> Array:
    """Draw |slope| / alpha (n,) with the tilt's share of D cos(theta_m); Phong at its own alpha."""
    # 1 - U lies in (0, 1]: no logarithm of 0
    log_u = np.log1p(-rng.random(n))
    if setup.ndf == BECKMANN:
        return np.sqrt(-log_u)
    if setup.ndf == GGX:
        return np.sqrt(np.expm1(-log_u))
    # cos(theta_m)^(n + 2) is uniform and n + 2 = 2 / alpha^2
    with np.errstate(over="ignore"):
        return np.minimum(np.sqrt(np.expm1(-log_u * setup.alpha_x**2)) / setup.alpha_x, STEEPEST)


def facet_slopes(setup: Setup, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw slopes (u, v), each (n,), of facets as a point of the macro-surface meets them: D cos(theta_m).

    Also the share of V-grooves a facet area: alpha_x, alpha_y stretch a circle (Beckmann, GGX) [HD14, supplement].
    """
    r, azimuth = tilt_tangents(setup, n, rng), 2 * np.pi * rng.random(n)
    return setup.alpha_x * r * np.cos(azimuth), setup.alpha_y * r * np.sin(azimuth)


def normals(u: Array, v: Array) -> Array:
    """Return the unit normals (N, 3) of slopes of at most 1e100."""
    z = 1.0 / np.sqrt(1.0 + u * u + v * v)
    return np.stack([u * z, v * z, z], axis=-1)


def reflect(i: Array, m: Array) -> Array:
    """Mirror the directions i (3,) or (N, 3) about the normals m (N, 3)."""
    return 2.0 * np.sum(i * m, axis=-1, keepdims=True) * m - i


@kernel
def visible_slope(c, uniform):
    """Solve for the slope u along the light's azimuth that a Beckmann surface of alpha = 1 shows.

    The density is (c + u) exp(-u^2) on u > -c, c = cot(theta_i) [HD14, supplement 2]; its integral from -c is
    N(u) = c sqrt(pi)/2 (erf u + erf c) + (exp(-c^2) - exp(-u^2)) / 2. Newton's steps kept inside a shrinking bracket.

    Parameters
    ----------
    c : float
        Cotangent of the stretched polar angle, in (0, inf].
    uniform : float
        In [0, 1): the share of N below u.

    Returns
    -------
    float
        u in [-c, 6.7].
    """
    # scaled by 1 / (1 + c), so that neither c -> 0 nor c -> inf leaves the range
    a = 0.5 * math.sqrt(math.pi) * (1.0 if c > 1e16 else c / (1.0 + c))
    b = 0.5 / (1.0 + c)
    e_c, x_c = math.erf(c), math.exp(-(min(c, 30.0) ** 2))
    target = uniform * (a * (1.0 + e_c) + b * x_c)
    lo, hi = -min(c, _FAR), _FAR
    u = 0.5 * lo if c < 1.0 else 0.0
    for _ in range(80):
        gap = a * (math.erf(u) + e_c) + b * (x_c - math.exp(-u * u)) - target
        if gap > 0.0:
            hi = u
        else:
            lo = u
        slope = (2.0 * a / math.sqrt(math.pi) + 2.0 * b * u) * math.exp(-u * u)
        step = u - gap / slope if slope > 0.0 else lo - 1.0
        if not lo < step < hi:
            step = 0.5 * (lo + hi)
            if hi - lo <= 1e-15 * (1.0 + abs(step)):
                return step
        elif abs(step - u) <= 1e-8 * (1.0 + abs(u)):
            # the error of a Newton step is of the order of its square
            return step
        u = step
    return u


@kernel
def _visible_slopes(c, uniform):
    """Apply `visible_slope` to an array (N,) at one c."""
    out = np.empty_like(uniform)
    for j in range(uniform.size):
        out[j] = visible_slope(c, uniform[j])
    return out


def visible_normals(setup: Setup, i: Array, n: int, rng: np.random.Generator) -> Array:
    """Draw `n` normals (n, 3) as the direction `i` (3,) sees them: D_vis = D (i.m) / (i_z (1 + Lambda)).

    Beckmann [HD14], GGX [H18], both exact for alpha_x != alpha_y. Phong has no closed form of D_vis, so its normals
    come from D cos(theta_m); those that face away from `i` reflect below the horizon.
    """
    if setup.ndf == PHONG:
        return normals(*facet_slopes(setup, n, rng))
    stretched = i * np.array([setup.alpha_x, setup.alpha_y, 1.0])
    along = math.hypot(stretched[0], stretched[1])
    if setup.ndf == GGX:
        w = stretched / np.linalg.norm(stretched)
        z = (1.0 - rng.random(n)) * (1.0 + w[2]) - w[2]
        s, azimuth = np.sqrt(np.maximum(0.0, 1.0 - z * z)), 2 * np.pi * rng.random(n)
        h = w + np.stack([s * np.cos(azimuth), s * np.sin(azimuth), z], axis=-1)
        m = h * np.array([setup.alpha_x, setup.alpha_y, 1.0])
        return m / np.linalg.norm(m, axis=-1, keepdims=True)
    c = stretched[2] / along if along > 0.0 else math.inf
    x, y = (stretched[0] / along, stretched[1] / along) if along > 0.0 else (1.0, 0.0)
    p = _visible_slopes(c, rng.random(n))
    q = rng.standard_normal(n) / math.sqrt(2.0)
    return normals(setup.alpha_x * (x * p - y * q), setup.alpha_y * (y * p + x * q))


@kernel
def _facet_pdf(ndf, alpha_x, alpha_y, i, h, visible):
    """Return D (i.h) / (i_z (1 + Lambda)) where `visible` is set, else D h_z; arrays (N,) of 1/sr for i, h (N, 3)."""
    out = np.empty(h.shape[0])
    for j in range(h.shape[0]):
        s = math.hypot(h[j, 0], h[j, 1])
        x, y = (h[j, 0] / s, h[j, 1] / s) if s > 0.0 else (1.0, 0.0)
        shape, factor = ndf_piece.shape_at(ndf, alpha_x, alpha_y, x, y)
        out[j] = factor * ndf_piece.density(ndf, shape, h[j, 2], s)
        if not visible:
            out[j] *= h[j, 2]
            continue
        s = math.hypot(i[j, 0], i[j, 1])
        x, y = (i[j, 0] / s, i[j, 1] / s) if s > 0.0 else (1.0, 0.0)
        alpha = projected_alpha(ndf, alpha_x, alpha_y, x, y)
        shown = i[j, 2] * (1.0 + smith_lambda(ndf, alpha, s / i[j, 2], False))
        out[j] *= (i[j, 0] * h[j, 0] + i[j, 1] * h[j, 1] + i[j, 2] * h[j, 2]) / shown
    return out


def facet_pdf(setup: Setup, i: Array, h: Array, *, visible: bool) -> Array:
    """Evaluate the density (N,), 1/sr, of normals h (N, 3): D_vis seen from i (N, 3), or D cos(theta_h).

    Lambda is the exact one of Beckmann and GGX whatever masking the model uses: the pdf is that of the samples.
    """
    return _facet_pdf(setup.ndf, setup.alpha_x, setup.alpha_y, i, h, visible)


def half_vectors(theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> tuple[Array, Array, Array, Array]:
    """Return i, o, h (N, 3 each) and i.h (N,), which is cos of half the angle between i and o."""
    i, o = unit(theta_i, phi_i), unit(theta_o, phi_i + phi)
    h = i + o
    # i = -o happens only at the horizon, where the pdf is 0 anyway
    norm = np.maximum(np.linalg.norm(h, axis=-1), 1e-300)
    return i, o, h / norm[:, None], 0.5 * norm


def masked(density: Array, theta_i: Array, theta_o: Array) -> Array:
    """Return `density` (N,) with 0 where either direction is at or below the horizon."""
    return np.where((theta_i < 0.5 * np.pi) & (theta_o < 0.5 * np.pi), density, 0.0)


def tangents_beside(setup: Setup, n: int, rng: np.random.Generator) -> Array:
    """Draw |slope| / alpha (n,) of the second facet of a nonsymmetric groove, exactly from P(r) ~ D(r) sin^2 r.

    With t = tan(r) / alpha: Beckmann t^2 exp(-t^2), GGX t^2 / (1 + t^2)^2, Phong a beta prime law of tan^2 r.
    The paper tabulates an inverse CDF instead ([L18], Section 6 and Appendix C).
    """
    power = rng.standard_gamma(1.5, n)
    if setup.ndf == BECKMANN:
        return np.sqrt(power)
    shape = 0.5 if setup.ndf == GGX else 1.0 / setup.alpha_x**2 - 0.5
    with np.errstate(divide="ignore"):
        t = np.minimum(np.sqrt(power / rng.standard_gamma(shape, n)), STEEPEST)
    return t if setup.ndf == GGX else t / setup.alpha_x


@kernel
def leave_groove(ti, a, b, where):
    """Follow one ray through a groove of mirrors, in its plane, by unfolding the reflections.

    The facets meet at the origin and end at height 1; left = (-cos l, sin l) / sin l, right = (cos r, sin r) / sin r.
    In the unfolded (kaleidoscopic) plane the ray is one line, copies of the facets stand at steps of the aperture
    a + b around the origin, and a copy is hit when the line passes inside its length. Once inside, the line stays
    inside until it has passed its nearest point, so the first copy that is missed has a closed form: no intersection
    is computed and no path is cut short, however narrow the groove.

    Parameters
    ----------
    ti : float
        Signed angle of the direction towards the light, positive towards the right facet, in (-pi/2, pi/2).
    a, b : float
        Angles pi/2 - l and pi/2 - r of the left and right facet from the vertical, in [0, pi/2].
    where : float
        In [0, 1]: where the ray crosses the opening, from its left to its right end.

    Returns
    -------
    bounces : float
        A whole number, at least 1 (a float, as it has no bound).
    to : float
        Signed angle of the outgoing direction, the same convention as `ti`.
    """
    x = -math.tan(a) + where * (math.tan(a) + math.tan(b))
    side = 1.0
    # distance of the ray from the origin, positive when it meets the left facet first
    c = math.sin(ti) - x * math.cos(ti)
    if c < 0.0:
        side, ti, a, b, c = -1.0, -ti, b, a, -c
    aperture = max(a + b, 1e-300)
    # copy k + 1 stands at the angle `turn` - k aperture from where the ray is nearest to the origin, and the ray lies
    # within its length 1 / cos(b or a) while that angle is inside +-acos(c cos(b or a)); even copies are right facets
    turn = 0.5 * math.pi - a - ti
    within_a, within_b = math.acos(min(1.0, c * math.cos(a))), math.acos(min(1.0, c * math.cos(b)))
    if turn - aperture >= within_b:
        k = 1.0
    else:
        k = max(1.0, 1.0 + 2.0 * math.ceil(0.5 * ((turn + within_b) / aperture - 1.0)))
        k = min(k, max(2.0, 2.0 * math.ceil(0.5 * (turn + within_a) / aperture)))
    if k % 2 == 1:
        return k, side * (math.pi - 2.0 * a - ti - (k - 1) * aperture)
    return k, side * (ti + k * aperture - math.pi)


@kernel
def _leave_grooves(i, u, v, right, where, most):
    """Follow rays from -i (3,) through grooves (N,): see `reflect_in_grooves`."""
    out = np.empty((u.size, 3))
    for j in range(u.size):
        left = math.hypot(u[j], v[j])
        # the left facet's normal leans to the right, which is the positive side of the groove's plane
        x, y = (u[j] / left, v[j] / left) if left > 0.0 else (1.0, 0.0)
        inside, beside = i[0] * x + i[1] * y, i[1] * x - i[0] * y
        a, b = math.atan2(1.0, left), math.atan2(1.0, right[j])
        k, to = leave_groove(math.atan2(inside, i[2]), a, b, where[j])
        length = math.hypot(inside, i[2])
        s, z = length * math.sin(to), length * math.cos(to)
        if most > 0 and k > most:
            z = -1.0
        out[j, 0], out[j, 1], out[j, 2] = s * x + beside * y, s * y - beside * x, z
    return out


def reflect_in_grooves(setup: Setup, i: Array, u: Array, v: Array, right: Array, where: Array) -> Array:
    """Send one ray from `i` into each groove and return where it leaves, (N, 3).

    Mirrors keep the component along the groove, so only the plane across it needs following ([L18], Section 4).
    Paths longer than the model's cap of bounces point below the horizon.

    Parameters
    ----------
    setup : Setup
        Read for `max_bounces` only.
    i : ndarray (3,)
        Direction towards the light.
    u, v : ndarray (N,)
        Slope of the left facet; its direction is the groove's azimuth.
    right : ndarray (N,)
        Tangent of the right facet's tilt.
    where : ndarray (N,)
        In [0, 1]: where the ray crosses the opening.
    """
    return _leave_grooves(i, u, v, right, where, setup.max_bounces or 0)


def mirror_pdf(kernel_module: Any, setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
    """Return f cos(theta_o) (N,) of a V-groove model with its Fresnel factor replaced by F = 1, 1/sr.

    Every ray that enters a groove of mirrors leaves it (white furnace), so this is a normalised density.
    """
    fresnel = mirror()
    bare = replace(setup, fresnel=fresnel, channels=fresnel.channels)
    f = kernel_module.points(bare, theta_i, theta_o, phi, phi_i, orders=0, tolerance=PDF_TOLERANCE)[:, 0, 0]
    return masked(f * np.cos(theta_o), theta_i, theta_o)
