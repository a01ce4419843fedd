"""Interfaced Lambertian microfacets at listed pairs of directions: closed specular part plus body integral.

The body integral takes the plain rule of body.py at two sizes where the kinks lie beyond all facets that matter, and
keeps the larger one if both agree; elsewhere the split rule with as many nodes as the tolerance asks for.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models.ilm.body import plain_integral, split_integral
from brdftab.models.ilm.cavity import points_interreflection
from brdftab.models.ilm.cavity import specular_setup as singular_setup
from brdftab.models.ilm.cavity_energy import energy_left_out
from brdftab.models.ilm.rules import radial_nodes
from brdftab.models.ilm.table import prepare
from brdftab.models.microfacet.frame import pair
from brdftab.models.microfacet.fresnel import reflectance
from brdftab.models.microfacet.gaussian import gaussian_density, gaussian_norm
from brdftab.models.microfacet.interface import body_factor, transmission
from brdftab.models.microfacet.masking import SEPARABLE, projected_alpha, smith_lambda, v_cavity
from brdftab.models.microfacet.project import unit_gauss
from brdftab.models.microfacet.single import HORIZON, V_CAVITY, geometry
from brdftab.models.setup import Setup

__all__ = ["energy_left_out", "points", "prepare", "rule_counts", "singular_setup"]

GAUSSIAN = 3
# nodes along every piece of radius and azimuth, by the least relative error asked
SPLIT_NODES = ((1e-3, 6), (1e-4, 8), (1e-5, 10), (1e-7, 14), (1e-9, 18), (1e-11, 24), (0.0, 30))
# the two sizes of the plain rule are those of `rules` at these errors
PLAIN, CHECK = 1e-4, 1e-3
# both sizes agree by luck here and there; the smaller one is wrong by far more than the larger
AGREE = 0.3


@kernel
def masked(masking, ndf, ax, ay, si, ci, so, co, phi, phi_i):
    """Return Smith's G1 G1 of both directions, 1 with V-cavities."""
    if masking == 10:
        return 1.0
    ai = projected_alpha(ndf, ax, ay, math.cos(phi_i), math.sin(phi_i))
    ao = projected_alpha(ndf, ax, ay, math.cos(phi_i + phi), math.sin(phi_i + phi))
    return 1.0 / ((1.0 + smith_lambda(ndf, ai, si / ci, False)) * (1.0 + smith_lambda(ndf, ao, so / co, False)))


@kernel
def front(masking, ndf, ax, ay, norm, theta_i, theta_o, phi, phi_i):
    """Return D G/(4 i_z o_z) in 1/sr and i.h of facets that are not flat."""
    if ndf != 3:
        return geometry(masking, ndf, ax, ay, theta_i, theta_o, phi, phi_i)
    _, ci, _, co, hx, hy, _ = pair(theta_i, theta_o, phi)
    up, flat = ci + co, math.hypot(hx, hy)
    full = math.hypot(flat, up)
    d = gaussian_density(ax, norm, up / full, flat / full)
    return d * v_cavity(up / full, ci, co, 0.5 * full) / (4.0 * ci * co), 0.5 * full


@kernel
def body(cavity, ndf, ax, ay, norm, n, slopes, rules):
    """Return the body integral (1/sr) without Smith's masking, and which rule gave it: 0 flat, 1 plain, 2 split.

    slopes: tangent-plane slopes and cosines of both directions; rules: plain nodes and azimuths, those of the check,
    split nodes, tolerance.
    """
    ix, iy, iz, ox, oy, oz = slopes
    if ax == 0.0:
        return transmission(n, iz) * transmission(n, oz) / math.pi, 0
    large, large_steps, small, small_steps, gauss, tolerance = rules
    if ndf != 1:
        kx, ky = (1.0, 1.0) if ndf == 3 else (ax, ay)
        steep = max(math.hypot(kx * ix, ky * iy), math.hypot(kx * ox, ky * oy))
        unit = math.sqrt(2.0) * ax if ndf == 3 else 1.0
        # stretched radius of the nearest kink: exp(-its square) of the facets lie beyond
        nearest = 1.0 / max(steep, 1e-300)
        if ndf == 3:
            nearest = math.atan(nearest) / unit
        if math.exp(-nearest * nearest) <= 0.03 * tolerance:
            fine = plain_integral(ndf, cavity, ax, ay, norm, n, ix, iy, iz, ox, oy, oz, large, large_steps)
            rough = plain_integral(ndf, cavity, ax, ay, norm, n, ix, iy, iz, ox, oy, oz, small, small_steps)
            if abs(fine - rough) <= 0.3 * tolerance * fine:
                return fine, 1
    return split_integral(ndf, cavity, ax, ay, norm, n, ix, iy, iz, ox, oy, oz, gauss, tolerance), 2


@parallel_kernel
def _points(theta_i, theta_o, phi, phi_i, masking, ndf, ax, ay, indices, rules, specular, bodies, used):
    """Fill specular and bodies (N, K) for K distinct indices of refraction, and used (N,) with the rule taken."""
    norm = gaussian_norm(ax) if ndf == 3 else 1.0
    cavity = masking == 10
    for k in numba.prange(theta_i.size):
        ci, co = math.cos(theta_i[k]), math.cos(theta_o[k])
        used[k] = 0
        for m in range(indices.size):
            specular[k, m] = 0.0
            bodies[k, m] = 0.0
        if min(ci, co) <= HORIZON:
            continue
        si, so = math.sin(theta_i[k]), math.sin(theta_o[k])
        az = 0.0 if ax == ay else phi_i[k]
        ti, to = si / ci, so / co
        far = az + phi[k]
        slopes = (ti * math.cos(az), ti * math.sin(az), ci, to * math.cos(far), to * math.sin(far), co)
        value, i_h, g = 0.0, 1.0, 1.0
        if ax > 0.0:
            value, i_h = front(masking, ndf, ax, ay, norm, theta_i[k], theta_o[k], phi[k], az)
            g = masked(masking, ndf, ax, ay, si, ci, so, co, phi[k], az)
        for m in range(indices.size):
            specular[k, m] = value * reflectance(2, indices[m], 0.0, i_h)
            integral, rule = body(cavity, ndf, ax, ay, norm, indices[m], slopes, rules)
            bodies[k, m] = g * integral
            used[k] = max(used[k], rule)


def _rules(tolerance: float) -> tuple[Any, ...]:
    """Return the rules of `body` for a tolerance."""
    large, large_steps = radial_nodes(0, PLAIN)
    small, small_steps = radial_nodes(0, CHECK)
    nodes = next(count for least, count in SPLIT_NODES if tolerance >= 0.999 * least)
    return large, large_steps, small, small_steps, unit_gauss(nodes), tolerance


def _parts(setup: Setup, angles: tuple[np.ndarray, ...], tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return specular part and body (N, C) of single bounces, and the rule taken (N,)."""
    assert setup.fresnel is not None
    indices, at = np.unique(setup.fresnel.a, return_inverse=True)
    masking = V_CAVITY if setup.values["masking"] == "torrance-sparrow" else SEPARABLE
    shape = (angles[0].size, indices.size)
    specular, bodies, used = np.empty(shape), np.empty(shape), np.empty(shape[0], dtype=np.int64)
    surface = (masking, setup.ndf, setup.alpha_x, setup.alpha_y, indices)
    _points(*angles, *surface, _rules(tolerance), specular, bodies, used)
    channels = len(setup.channels)
    column = np.broadcast_to(at, channels)
    kd = np.broadcast_to(setup.values["kd"], channels)
    kappa = np.array([body_factor(k, indices[c]) for k, c in zip(kd, column, strict=True)])
    return specular[:, column], kappa * bodies[:, column], used


def rule_counts(
    setup: Setup, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray, tolerance: float
) -> dict[str, Any]:
    """Say which rule serves how many of some directions at a tolerance, with the nodes of the split rule."""
    used = _parts(setup, (theta_i, theta_o, phi, phi_i), tolerance)[2]
    nodes = next(count for least, count in SPLIT_NODES if tolerance >= 0.999 * least)
    names = ("flat", "plain", "split")
    return {"split_nodes": nodes, **{name: int((used == k).sum()) for k, name in enumerate(names)}}


def points(
    setup: Setup,
    theta_i: np.ndarray,
    theta_o: np.ndarray,
    phi: np.ndarray,
    phi_i: np.ndarray,
    *,
    orders: int,
    tolerance: float,
) -> np.ndarray:
    """Evaluate at N pairs of directions.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.setup.resolve`.
    theta_i, theta_o, phi, phi_i : ndarray (N,)
        Radians.
    orders : int
        0 for the total, else the components: specular, body and, unless bounces = 1, interreflection.
    tolerance : float
        Relative error asked of the body integral. The specular part is exact, that of a flat surface (sigma = 0) a
        mirror direction without a value, which is left out.

    Returns
    -------
    ndarray (N, P, C)
        BRDF in 1/sr.
    """
    angles = (theta_i, theta_o, phi, phi_i)
    specular, matte, _ = _parts(setup, angles, tolerance)
    layers = [specular, matte]
    if setup.max_bounces != 1:
        mutual, mirrored = points_interreflection(setup, *angles, tolerance)
        layers = [specular + mirrored, matte, mutual]
    if not orders:
        return sum(layers[1:], start=layers[0])[:, None]
    return np.stack(layers, axis=1)
