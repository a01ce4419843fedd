"""Analog Monte Carlo paths through V-cavities of interfaced Lambertian facets: what the radiosity is compared with.

Nothing is shared with the package but the definition of the model: no symmetry, image method, kernel or quadrature. A
photon enters through a uniform point of the opening of a cavity whose facet normal is drawn from D cos; at every hit it
is mirrored with probability F, else absorbed or scattered by the body, and it is counted where it leaves.
"""

import math

import numpy as np
from numba import njit


@njit
def transmission(n, c):
    """1 - F as the mean over both polarisations, from Snell's law and Fresnel's equations."""
    if n == 1.0:
        return 1.0
    t = math.sqrt(1.0 - (1.0 - c * c) / (n * n))
    s, p = (c - n * t) / (c + n * t), (n * c - t) / (n * c + t)
    return 1.0 - 0.5 * (s * s + p * p)


@njit
def _survival(n, kd):
    """Probability that light which got into the body comes out again, r_i by the midpoint rule."""
    if n == 1.0:
        return kd
    inside, steps = 0.0, 20000
    for k in range(steps):
        c2 = (k + 0.5) / steps
        sine2 = n * n * (1.0 - c2)
        inside += (1.0 if sine2 >= 1.0 else 1.0 - transmission(n, math.sqrt(1.0 - sine2))) / steps
    return kd * (1.0 - inside) / (1.0 - kd * inside)


@njit
def _hit(x, z, wx, wz, last, st, ct):
    """Return facet (0, 1 or -1) and distance of the next hit in the cross-section; facet 0 rises to the left."""
    facet, nearest = -1, 1e300
    for f in range(2):
        if f == last:
            continue
        nx = st if f == 0 else -st
        along = wx * nx + wz * ct
        if along < 0.0:
            d = max(-(x * nx + z * ct) / along, 0.0)
            height = z + d * wz
            if d < nearest and 0.0 <= height <= st * (1.0 + 1e-12):
                facet, nearest = f, d
    return facet, nearest


@njit
def _scatter(n, nx, ct):
    """Return a direction below which a body radiates: pdf T(c) c in the hemisphere about (nx, 0, ct)."""
    while True:
        c = math.sqrt(np.random.random())
        if np.random.random() < transmission(n, c):
            break
    s, b = math.sqrt(1.0 - c * c), 2.0 * math.pi * np.random.random()
    return c * nx + s * math.cos(b) * ct, s * math.sin(b), c * ct - s * math.cos(b) * nx


@njit
def trace(ggx, sigma_x, sigma_y, n, kd, theta, phi_i, paths, seed, counts):
    """Count photons in counts (3, 2, T, P): hits 1, 2 or more; without or with a body; equal bins of sin^2 and phi."""
    np.random.seed(seed)
    survival = _survival(n, kd)
    for _ in range(paths):
        xi = np.random.random()
        r = math.sqrt(xi / (1.0 - xi)) if ggx else math.sqrt(-math.log(1.0 - xi))
        a = 2.0 * math.pi * np.random.random()
        mx, my = sigma_x * r * math.cos(a), sigma_y * r * math.sin(a)
        azimuth, ct = math.atan2(my, mx), 1.0 / math.sqrt(1.0 + mx * mx + my * my)
        st = math.hypot(mx, my) * ct
        wx, wy = -math.sin(theta) * math.cos(phi_i - azimuth), -math.sin(theta) * math.sin(phi_i - azimuth)
        wz, x, z = -math.cos(theta), ct * (2.0 * np.random.random() - 1.0), st
        hits, body, facet = 0, 0, -1
        while hits >= 0:
            facet, d = _hit(x, z, wx, wz, facet, st, ct)
            if facet < 0:
                break
            hits += 1
            x, z, nx = x + d * wx, z + d * wz, st if facet == 0 else -st
            c = min(-(wx * nx + wz * ct), 1.0)
            if np.random.random() >= transmission(n, c):
                wx, wz = wx + 2.0 * c * nx, wz + 2.0 * c * ct
            elif np.random.random() < survival:
                body = 1
                wx, wy, wz = _scatter(n, nx, ct)
            else:
                hits = -1
        if hits > 0:
            turn = (math.atan2(wy, wx) + azimuth - phi_i) / (2.0 * math.pi)
            t = min(int((1.0 - wz * wz) * counts.shape[2]), counts.shape[2] - 1)
            p = min(int((turn - math.floor(turn)) * counts.shape[3]), counts.shape[3] - 1)
            counts[min(hits, 3) - 1, body, t, p] += 1.0


def bin_nodes(polar, around, nodes):
    """Return theta_o, phi (N,) and the integral of f cos over bins (polar, around) as a function of f (N, ...)."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = 0.5 * (1.0 + x), 0.5 * w
    square = ((np.arange(polar)[:, None] + x) / polar).reshape(-1)
    phi = 2.0 * math.pi * ((np.arange(around)[:, None] + x) / around).reshape(-1)
    theta, phi = np.meshgrid(np.arcsin(np.sqrt(square)), phi, indexing="ij")

    def integrate(f):
        parts = np.reshape(f, (polar, nodes, around, nodes))
        return np.einsum("pqrs,q,s->pr", parts, w, w) * math.pi / (polar * around)

    return theta.reshape(-1), phi.reshape(-1), integrate
