"""Monte Carlo of random V-grooves in space: sampled facets, a shadow test, a traced ray. No closed form of the model.

A point of the macrosurface lies on a facet m with density D(m) cos(theta_m); the facet across the groove has a tilt r
of density P(r) ~ D(r) sin^2(r) (so that counting grooves from either side gives the same census), or the same tilt in
the symmetric groove. A point uniform on the facet receives (i.m) / (cos(theta_m) i_z) of the light per macroscopic area
unless the groove's other facet shades it. Mirror facets: every sampled ray carries its weight to one direction o.

Estimates are binned by bounces and half vector h = (i + o)/|i + o| (polar angle, azimuth from i folded to [0, pi]).
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from benchmarks.papers.grooves import LEFT, bounce, hit

BECKMANN, GGX, PHONG = 0, 1, 2
NDFS = {"beckmann": BECKMANN, "ggx": GGX, "phong": PHONG}
LIMIT = 100_000


@njit
def _facet_tilt(ndf, alpha):
    """Sample the tilt of D(m) cos(theta_m) by inversion of its distribution function."""
    u = np.random.random()
    if ndf == BECKMANN:
        return math.atan(alpha * math.sqrt(-math.log1p(-u)))
    if ndf == GGX:
        return math.atan(alpha * math.sqrt(u / (1.0 - u)))
    return math.acos((1.0 - u) ** (0.5 * alpha * alpha))


@njit
def _opposite_tilt(ndf, alpha):
    """Sample r from P(r) ~ D(r) sin^2(r) through normal and gamma variates."""
    if ndf == GGX:
        a, b, c = np.random.normal(), np.random.normal(), np.random.normal()
        return math.atan(alpha * math.sqrt(a * a + b * b + c * c) / abs(np.random.normal()))
    top = math.sqrt(np.random.gamma(1.5, 1.0))
    if ndf == BECKMANN:
        return math.atan(alpha * top)
    n = 2.0 / (alpha * alpha) - 2.0
    return math.atan(top / math.sqrt(np.random.gamma(0.5 * (n + 1.0), 1.0)))


@njit
def _table_tilt(cdf, tilt):
    """Sample r from a tabulated distribution function, the path sampler without special variates."""
    return np.interp(np.random.random(), cdf, tilt)


def tilt_table(density, nodes=200_001):
    """Tabulate the distribution function of D(r) sin^2(r) on [0, pi/2]; `density` maps an array of tilts to D."""
    tilt = np.linspace(0.0, 0.5 * np.pi, nodes)[:-1]
    weight = density(tilt) * np.sin(tilt) ** 2
    cdf = np.concatenate(([0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]))))
    return cdf / cdf[-1], tilt


@njit
def walk(theta_i, symmetric, ndf, alpha, cdf, tilt):
    """Draw one groove and one point, follow the light; returns (weight, bounces, o_x, o_y, o_z), i in the x-z plane."""
    ix, iz = math.sin(theta_i), math.cos(theta_i)
    left = _facet_tilt(ndf, alpha)
    if symmetric:
        right = left
    elif cdf.size:
        right = _table_tilt(cdf, tilt)
    else:
        right = _opposite_tilt(ndf, alpha)
    phi = 2.0 * math.pi * np.random.random()
    place = np.random.random()
    tx, ty = math.cos(phi), math.sin(phi)
    across, along = ix * tx, -ix * ty
    c, s = math.cos(left), math.sin(left)
    facing = across * s + iz * c
    if facing <= 0.0:
        return 0.0, 0, 0.0, 0.0, 0.0
    top_l, top_r = -1.0 / math.tan(left), 1.0 / math.tan(right)
    px, pz = place * top_l, place
    t, _ = hit(px, pz, across, iz, top_r, 1.0)
    if t > 0.0:
        return 0.0, 0, 0.0, 0.0, 0.0
    dx, dz = 2.0 * facing * s - across, 2.0 * facing * c - iz
    _, more, dx, dz = bounce(px, pz, dx, dz, LEFT, top_l, top_r, LIMIT)
    # the component along the groove, -(i.g) with g = (-ty, tx), never changes
    return facing / (c * iz), 1 + more, dx * tx + along * ty, dx * ty - along * tx, dz


@njit
def histogram(seed, samples, theta_i, symmetric, ndf, alpha, cdf, tilt, orders, polar, azimuth):
    """Sum weights and squared weights by (order, polar bin, azimuth bin); the last order collects all further ones.

    Returns (sums, squares, total weight, total squared weight).
    """
    np.random.seed(seed)
    sums = np.zeros((orders, polar, azimuth))
    squares = np.zeros((orders, polar, azimuth))
    total, total2 = 0.0, 0.0
    ix, iz = math.sin(theta_i), math.cos(theta_i)
    for _ in range(samples):
        weight, k, ox, oy, oz = walk(theta_i, symmetric, ndf, alpha, cdf, tilt)
        if weight == 0.0:
            continue
        total += weight
        total2 += weight * weight
        hx, hy, hz = ix + ox, oy, iz + oz
        p = int(polar * math.atan2(math.hypot(hx, hy), hz) / (0.5 * math.pi))
        a = int(azimuth * math.atan2(abs(hy), hx) / math.pi)
        cell = (min(k, orders) - 1, min(p, polar - 1), min(a, azimuth - 1))
        sums[cell] += weight
        squares[cell] += weight * weight
    return sums, squares, total, total2


@dataclass(frozen=True)
class Bins:
    """Mean and standard error of the reflected fraction of the light by [order, polar bin, azimuth bin]."""

    mean: np.ndarray
    error: np.ndarray
    counted: np.ndarray
    albedo: float
    albedo_error: float


def sample(theta_i, *, symmetric, ndf, alpha, samples, seed, orders=4, polar=6, azimuth=4, table=None):
    """Run the Monte Carlo; `table` is a `tilt_table` to sample r from instead of the exact recipes."""
    cdf, tilt = table if table is not None else (np.empty(0), np.empty(0))
    sums, squares, total, total2 = histogram(
        seed, samples, theta_i, symmetric, NDFS[ndf], alpha, cdf, tilt, orders, polar, azimuth
    )
    mean = sums / samples
    error = np.sqrt(np.maximum(squares / samples - mean**2, 0.0) / samples)
    albedo = total / samples
    # the effective number of rays behind a bin: where it is small the error is not known either
    counted = np.divide(sums**2, squares, out=np.zeros_like(sums), where=squares > 0)
    return Bins(mean, error, counted, albedo, math.sqrt((total2 / samples - albedo**2) / samples))


def half_vector_nodes(theta_i, polar=6, azimuth=4, nodes=16):
    """Gauss nodes of every half-vector bin: (theta_o, phi, weight) of shape (polar, azimuth, nodes, nodes).

    ``sum(f * weight)`` over a bin is the integral of f cos(theta_o) over its directions: do = 4 (i.h) dh, both signs of
    the azimuth counted. Nodes whose o lies below the horizon carry weight 0.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    th = (np.arange(polar)[:, None] + x)[:, None, :, None] * (0.5 * np.pi / polar)
    ph = (np.arange(azimuth)[:, None] + x)[None, :, None, :] * (np.pi / azimuth)
    area = 2.0 * (0.5 * np.pi / polar) * (np.pi / azimuth) * w[:, None] * w[None, :] * np.sin(th)
    hx, hy, hz = np.broadcast_arrays(np.sin(th) * np.cos(ph), np.sin(th) * np.sin(ph), np.cos(th))
    ix, iz = math.sin(theta_i), math.cos(theta_i)
    ih = ix * hx + iz * hz
    ox, oy, oz = 2.0 * ih * hx - ix, 2.0 * ih * hy, 2.0 * ih * hz - iz
    seen = (ih > 0.0) & (oz > 0.0)
    weight = np.where(seen, area * 4.0 * ih * oz, 0.0)
    theta_o = np.where(seen, np.arctan2(np.hypot(ox, oy), oz), 0.0)
    return theta_o, np.arctan2(oy, ox), weight


def z_scores(bins, expected, least=200):
    """Deviations in standard errors of the bins behind which at least `least` effective rays stand."""
    good = bins.counted >= least
    return (expected[good] - bins.mean[good]) / bins.error[good]
