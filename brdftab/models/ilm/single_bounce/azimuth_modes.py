"""The body integral of all cells of a product grid at once: it factorises on rings of facets of equal tilt.

On a ring of slope rho the facets at azimuth a see a direction u under u_z m_z x_u, x_u = 1 + rho tan(theta_u) cos a.
With Smith masking the integrand is A_i(a) A_o(a - phi), A_u = x_u+ T(u_z m_z x_u) sqrt(m_z), and so it is in V-cavities
wherever only one direction is masked, A_u times min(1, 2/x_u); where both are, wedges.py adds the rest. With the cosine
coefficients a_m(theta, ring) of A, from equal steps of azimuth,

    I(theta_i, theta_o, phi) = sum_m eps_m cos(m phi) sum_rings w a_m(theta_i) a_m(theta_o),  eps_0 = 1, else 2,

one matrix product a mode. Even and odd modes are kept apart: folding a at pi/2 halves their cost.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import BECKMANN, GGX
from brdftab.models._shared.facets.gaussian import gaussian_norm
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array

# Beckmann facets beyond this stretched slope have a share of 2e-14
FAR = 5.6
# polar angles whose samples are held at a time
CHUNK = 32


class Modes(NamedTuple):
    """Cosine coefficients of both sides; even and odd modes (M/2, theta, rings) each, the rings' weights included."""

    even_i: Array
    odd_i: Array
    even_o: Array
    odd_o: Array


def rings(ndf: int, sigma: float, count: int) -> tuple[Array, Array]:
    """Return slopes and weights (count,) of rings; the weights are shares of the projected area of facets.

    Gauss-Legendre, crowded where grazing directions have their kinks (flat facets) and where GGX ends (steep ones).
    """
    t, w = unit_gauss(count)
    if ndf == BECKMANN:
        r = FAR * t * t
        return sigma * r, w * 4.0 * FAR * t * r * np.exp(-r * r)
    if ndf == GGX:
        angle = 0.5 * math.pi * t * t * (3.0 - 2.0 * t)
        return sigma * np.tan(angle), w * 3.0 * math.pi * t * (1.0 - t) * np.sin(2.0 * angle)
    high = min(0.5 * math.pi, math.sqrt(2.0) * FAR * sigma)
    tilt = high * t * t
    density = gaussian_norm(sigma) / (sigma * sigma) * np.exp(-0.5 * (tilt / sigma) ** 2) * np.sin(tilt)
    return np.tan(tilt), w * 2.0 * high * t * density


@kernel
def _ring_row(c, cosine, slope, mz, root, q, cavity, first, last):
    """Write sqrt(w) A at azimuths a and pi - a of all rings; c = cos(theta), `slope` is rho tan(theta)."""
    n2 = q + 1.0
    cap = 2.0 if cavity else 1e300
    for side in range(2):
        values = first if side == 0 else last
        cosine_a = cosine if side == 0 else -cosine
        for k in range(slope.size):
            x = max(1.0 + slope[k] * cosine_a, 0.0)
            m = max(c * mz[k] * x, 1e-30)
            g = math.sqrt(q + m * m)
            a, b = g + m, n2 * m + g
            ab = a * b
            values[k] = root[k] * min(x, cap) * (2.0 * g * m * (b * b + n2 * a * a) / (ab * ab))


@parallel_kernel
def _samples(theta, rho, weights, q, cavity, half, even, odd):
    """Fill even and odd (half + 1, theta, rings): sums and differences of sqrt(w) A at azimuths a_j and pi - a_j."""
    size = rho.size
    for j in numba.prange(half + 1):
        cosine = math.cos(0.5 * math.pi * j / half) if j < half else 0.0
        slope, mz, root = np.empty(size), np.empty(size), np.empty(size)
        first, last = np.empty(size), np.empty(size)
        for k in range(size):
            mz[k] = 1.0 / math.sqrt(1.0 + rho[k] * rho[k])
            root[k] = math.sqrt(weights[k] * mz[k])
        for n in range(theta.size):
            tangent = math.tan(theta[n])
            for k in range(size):
                slope[k] = rho[k] * tangent
            _ring_row(math.cos(theta[n]), cosine, slope, mz, root, q, cavity, first, last)
            for k in range(size):
                even[j, n, k] = first[k] + last[k]
                odd[j, n, k] = first[k] - last[k]


def _coefficients(theta: Array, rho: Array, weights: Array, n: float, cavity: bool, count: int) -> tuple[Array, Array]:
    """Return even and odd cosine coefficients (count/2, theta, rings) from 2 count azimuth steps over half a turn."""
    steps = 0.5 * math.pi / count * np.arange(count + 1)
    ends = np.ones(count + 1)
    # the trapezoid's ends; the middle is its own mirror image
    ends[[0, -1]] = 0.5
    wave = 2.0 * np.arange(count // 2)[:, None]
    basis = [np.cos((wave + parity) * steps) * (ends / (2.0 * count)) for parity in (0, 1)]
    found = [np.empty((count // 2, theta.size, rho.size)) for _ in basis]
    for start in range(0, theta.size, CHUNK):
        some = theta[start : start + CHUNK]
        samples = np.empty((2, count + 1, some.size, rho.size))
        _samples(some, rho, weights, (n - 1.0) * (n + 1.0), cavity, count, samples[0], samples[1])
        for parity in (0, 1):
            part = basis[parity] @ samples[parity].reshape(count + 1, -1)
            found[parity][:, start : start + CHUNK] = part.reshape(count // 2, some.size, -1)
    return found[0], found[1]


def modes(
    ndf: int, sigma: float, n: float, cavity: bool, theta_i: Array, theta_o: Array, size: tuple[int, int]
) -> Modes:
    """Return the cosine coefficients of both polar axes (radians below pi/2).

    Parameters
    ----------
    ndf : int
        0 Beckmann, 1 GGX, 3 Gaussian in the tilt.
    sigma, n : float
        Roughness and refractive index of the interface.
    cavity : bool
        V-cavity masking of one direction at a time.
    theta_i, theta_o : ndarray
        Polar angles; one set of coefficients serves both where it is the same object.
    size : tuple of int
        Rings and modes; the modes are an even number.
    """
    rho, weights = rings(ndf, sigma, size[0])
    even, odd = _coefficients(theta_i, rho, weights, n, cavity, size[1])
    if theta_o is theta_i:
        return Modes(even, odd, even, odd)
    return Modes(even, odd, *_coefficients(theta_o, rho, weights, n, cavity, size[1]))


def azimuth_basis(phi: Array, count: int) -> tuple[Array, Array]:
    """Return eps_m cos(m phi), (count/2, phi) for even and for odd m."""
    m = 2.0 * np.arange(count // 2)[:, None]
    even = 2.0 * np.cos(m * phi)
    even[0] = 1.0
    return even, 2.0 * np.cos((m + 1.0) * phi)


def block(found: Modes, basis: tuple[Array, Array], start: int, stop: int, columns: int) -> Array:
    """Return pi I (stop - start, columns, phi) of the first `columns` views, without Smith's masking."""
    total: Array | None = None
    for side_i, side_o, waves in ((found.even_i, found.even_o, basis[0]), (found.odd_i, found.odd_o, basis[1])):
        products = np.matmul(side_i[:, start:stop], side_o[:, :columns].transpose(0, 2, 1))
        part = products.reshape(len(products), -1).T @ waves
        total = part if total is None else np.add(total, part, out=total)
    assert total is not None
    return total.reshape(stop - start, columns, -1)
