"""How much light single bounces of isotropic facets with F = 1 reflect: directional and average albedo."""

from __future__ import annotations

import math
from functools import lru_cache

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import Fresnel
from brdftab.models._shared.codes import BECKMANN, PHONG, WALTER
from brdftab.models._shared.facets.masking import smith_g2, smith_lambda
from brdftab.models._shared.facets.ndf import density
from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models.resolve import Setup
from brdftab.quadrature import unit_gauss

Array = np.ndarray
NODES = 12
# panels of the half vector's azimuth, closer towards the end where the mirrored direction sets
AZIMUTHS = (0.0, 0.4, 0.7, 0.9, 1.0)
Rule = tuple[int, int, float]
# Gauss nodes, Chebyshev nodes of a panel of the table of 1 - E, and halvings of its panels towards grazing; what a
# tolerance from `LOOSE` on allows: smooth Beckmann facets miss so little that its relative error counts
EXACT: Rule = (NODES, 12, 20.0)
FEWER: Rule = (6, 8, 12.0)
SMOOTH: Rule = (10, 12, 12.0)
LOOSE, SMOOTHEST = 1e-4, 0.3
# of GGX and Phong facets below this roughness fewer nodes leave 1e-4 of 1 - E at .01 and 7e-2 at 1e-4
FINEST = 0.02
# facets rougher than this return so little that the relative error of E counts
ROUGHEST = 1.0


@kernel
def _ring(masking, ndf, alpha, si, ci, sh, ch, cuts, x, w):
    """Return the integral of G(i, o) (i.h)/i_z over the azimuths of half vectors of one tilt, o above the horizon."""
    # o_z = 2 (i.h) h_z - i_z > 0 holds up to this azimuth
    limit = ci * (0.5 / ch - ch)
    top = math.pi
    if si * sh > 0.0:
        top = math.acos(min(1.0, max(-1.0, limit / (si * sh))))
    elif limit >= 0.0:
        return 0.0
    walter = masking == WALTER
    lambda_i = smith_lambda(ndf, alpha, si / ci, walter)
    total = 0.0
    for p in range(cuts.size - 1):
        width = top * (cuts[p + 1] - cuts[p])
        for k in range(x.size):
            i_h = si * sh * math.cos(top * cuts[p] + width * x[k]) + ci * ch
            oz = min(2.0 * i_h * ch - ci, 1.0)
            if oz <= 0.0 or i_h <= 0.0:
                continue
            tangent = math.sqrt((1.0 - oz) * (1.0 + oz)) / oz
            total += width * w[k] * smith_g2(masking, lambda_i, smith_lambda(ndf, alpha, tangent, walter)) * i_h / ci
    return 2.0 * total


@parallel_kernel
def _albedo(masking, ndf, alpha, theta, edges, cuts, x, w, out):
    """Fill out (N,) by Gauss panels between edges (N, E) of the half vector's tilt."""
    shape = 2.0 / (alpha * alpha) - 2.0 if ndf == PHONG else alpha
    for n in numba.prange(theta.size):
        si, ci = math.sin(theta[n]), math.cos(theta[n])
        total = 0.0
        for p in range(edges.shape[1] - 1):
            width = edges[n, p + 1] - edges[n, p]
            if width <= 0.0:
                continue
            for k in range(x.size):
                tilt = edges[n, p] + width * x[k]
                sh, ch = math.sin(tilt), math.cos(tilt)
                d = density(ndf, shape, ch, sh)
                if d > 0.0:
                    total += width * w[k] * sh * d * _ring(masking, ndf, alpha, si, ci, sh, ch, cuts, x, w)
        out[n] = total


def single_albedo(masking: int, ndf: int, alpha: float, theta: Array, nodes: int = NODES) -> Array:
    """Return the directional albedo (N,) of single bounces with F = 1.

    Parameters
    ----------
    masking, ndf : int
        Codes of masking.py and ndf.py.
    alpha : float
        Isotropic roughness.
    theta : ndarray (N,)
        Polar angles of the light, radians in [0, pi/2).
    nodes : int
        Gauss nodes a panel.
    """
    # tilts at which the first and the last azimuth sets, and around them
    first, last = 0.25 * math.pi - 0.5 * theta, 0.25 * math.pi + 0.5 * theta
    scales = np.arctan(alpha * 2.0 ** np.arange(-2.0, 3.0 + math.ceil(math.log2(8.0 * max(alpha, 1.0) / alpha))))
    steps = 0.25 ** np.arange(0, 6)
    edges = [np.zeros_like(theta), first, last, np.abs(theta), 0.5 * theta]
    edges += [np.full_like(theta, s) for s in scales]
    edges += [first + sign * 0.25 * s for s in steps for sign in (-1.0, 1.0)] + [last - 0.5 * s for s in steps]
    # grazing light sees facets of small tilt towards it only
    edges += [np.minimum(0.5 * math.pi - theta, alpha) * s for s in 2.0 ** np.arange(-3.0, 4.0)]
    panels = np.sort(np.clip(np.stack(edges, axis=1), 0.0, last[:, None]), axis=1)
    out = np.empty(theta.size)
    _albedo(masking, ndf, alpha, np.ascontiguousarray(theta), panels, np.array(AZIMUTHS), *unit_gauss(nodes), out)
    return out


def _cuts(alpha: float, halvings: float = 20.0) -> Array:
    """Return edges of panels in elevation (pi/2 - theta), closer towards grazing where E turns within alpha."""
    low = math.atan(min(alpha, 1.0))
    dyadic = low * 2.0 ** np.arange(-halvings, math.log2(0.5 * math.pi / low))
    # rough facets mask from 1/alpha on, and Walter's rational fit from 1/(1.6 alpha) on
    rough = 0.5 * math.pi - np.arctan(2.0 ** np.arange(-1.0, 5.0 if alpha > 1.0 else 0.0) / (0.8 * alpha))
    return np.sort(np.concatenate([[0.0], dyadic[dyadic < 1.2], rough, [1.2, 0.5 * math.pi]]))


@lru_cache(maxsize=64)
def _table(masking: int, ndf: int, alpha: float, rule: Rule) -> tuple[Array, Array]:
    """Return edges (P + 1,) of panels in elevation and 1 - E (P, degree) at their Chebyshev nodes."""
    nodes, degree, halvings = rule
    cuts = _cuts(alpha, halvings)
    at = 0.5 * (cuts[:-1, None] + cuts[1:, None] + np.diff(cuts)[:, None] * _chebyshev(degree))
    return cuts, 1.0 - single_albedo(masking, ndf, alpha, 0.5 * math.pi - at.reshape(-1), nodes).reshape(at.shape)


def _chebyshev(degree: int) -> Array:
    return np.cos((2.0 * np.arange(degree) + 1.0) * math.pi / (2 * degree))


@lru_cache(maxsize=64)
def average_albedo(masking: int, ndf: int, alpha: float, tolerance: float = 0.0) -> float:
    """Return the average 2 int E(mu) mu dmu of `single_albedo` over the hemisphere."""
    x, w = unit_gauss(16)
    rule = _rule(ndf, alpha, tolerance, True)
    cuts = _cuts(alpha, rule[2])
    elevation = (cuts[:-1, None] + np.diff(cuts)[:, None] * x).reshape(-1)
    weight = (np.diff(cuts)[:, None] * w).reshape(-1)
    if rule == EXACT:
        albedo = single_albedo(masking, ndf, alpha, 0.5 * math.pi - elevation)
    else:
        albedo = 1.0 - _looked_up(elevation, *_table(masking, ndf, alpha, rule))
    return float(np.sum(weight * albedo * np.sin(2.0 * elevation)))


def average_reflectance(fresnel: Fresnel) -> Array:
    """Return the average 2 int F(mu) mu dmu (W,) of a facet's reflectance."""
    x, w = unit_gauss(64)
    # nodes gather at grazing, where F rises
    mu = x * x
    weight = 4.0 * w * x * mu
    rows = [sum(weight[n] * reflectance(fresnel.kind, a, b, mu[n]) for n in range(x.size)) for a, b in _pairs(fresnel)]
    return np.array(rows)


def _pairs(fresnel: Fresnel) -> list[tuple[float, float]]:
    return list(zip(fresnel.a.tolist(), fresnel.b.tolist(), strict=True))


def _rule(ndf: int, alpha: float, tolerance: float, divided: bool) -> Rule:
    """Return the rule of a table; `divided`: 1 - E is divided by its average, so that its relative error counts."""
    if tolerance < LOOSE or (ndf != BECKMANN and alpha < FINEST):
        return EXACT
    return SMOOTH if alpha > ROUGHEST or (divided and ndf == BECKMANN and alpha < SMOOTHEST) else FEWER


def missing(setup: Setup, masking: int, theta: Array, tolerance: float = 0.0, divided: bool = True) -> Array:
    """Return 1 - E (N,) of single bounces; 0 at the horizon and below.

    Good to 1e-9 (3e-7 of E for Beckmann above 2), from a tolerance of 1e-4 on to 1e-5, or what `divided` asks.
    """
    key = (masking, setup.ndf, setup.alpha_x)
    found = _looked_up(0.5 * math.pi - theta, *_table(*key, _rule(*key[1:], tolerance, divided)))
    # rounding of 1 - E where nearly nothing is missing takes either sign
    return np.where(np.cos(theta) > HORIZON, np.maximum(found, 0.0), 0.0)


def _looked_up(elevation: Array, cuts: Array, values: Array) -> Array:
    """Return 1 - E at elevations (N,) from a table."""
    elevation = np.clip(elevation, 0.0, 0.5 * math.pi)
    panel = np.clip(np.searchsorted(cuts, elevation, side="right") - 1, 0, len(cuts) - 2)
    x = (2.0 * elevation - cuts[panel] - cuts[panel + 1]) / (cuts[panel + 1] - cuts[panel])
    degree = values.shape[1]
    nodes = _chebyshev(degree)
    # barycentric weights of Chebyshev nodes of the first kind
    signs = (-1.0) ** np.arange(degree) * np.sqrt(1.0 - nodes * nodes)
    gap = x[:, None] - nodes
    gap[gap == 0.0] = 1e-300
    share = signs / gap
    return (share * values[panel]).sum(axis=1) / share.sum(axis=1)
