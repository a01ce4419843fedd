"""How the bodies of both facets of a V-cavity light each other: the kernel of its radiosity, and its eigenvalues.

A body radiates proportionally to T(cos), so one number a point, its transmitted irradiance E, says all, and E = W +
kappa/pi K E. K carries T at both ends and F at the mirror reflections in between. Along the cavity it is integrated; in
the cross-section j reflections unfold to a straight chord of length d between the radii r1 and r2 at the angle theta =
(j + 1) gamma < pi. Such a chord crosses no other obstacle, since the copies of the facets fill the sector of radius 1.
With delta_1, delta_2 = pi - theta - delta_1 its angles with both facets,

    K(r1, r2) = sin(delta_1) sin(delta_2)/d int cos^2(psi) T(sin delta_1 cos psi) T(sin delta_2 cos psi)
                prod_{k=1..j} F(sin(delta_1 + k gamma) cos psi) dpsi,    psi in (-pi/2, pi/2).

It depends on r1/r2 up to 1/r2, which leaves one integral over s = r1/r2 in (0, 1), here over u = pi/2 - delta_1 where
K ds = sin(delta_2) du times the integral over psi: nothing is singular.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.models._shared.fresnel.interface import transmission
from brdftab.models.ilm.interreflection.light import FAINT
from brdftab.quadrature import gauss

PI = math.pi


@kernel
def _functions(r, steps, out):
    """Write the orthonormal Legendre functions at r in [0, 1] to out (N,)."""
    x = 2.0 * r - 1.0
    before, now = 1.0, x
    out[0] = 1.0
    for n in range(1, out.size):
        out[n] = now * 0.5 / steps[2, n]
        after = steps[0, n] * x * now - steps[1, n] * before
        before, now = now, after


@kernel
def _along(n, first, gamma, j, psi):
    """Return the integral over the elevation psi along the cavity, for a chord that leaves under the angle `first`."""
    one, two = math.sin(first), math.sin(first + (j + 1) * gamma)
    total = 0.0
    for q in range(psi.shape[1]):
        c = math.cos(0.5 * PI * psi[0, q])
        value = c * c * transmission(n, one * c) * transmission(n, two * c)
        for k in range(1, j + 1):
            value *= 1.0 - transmission(n, math.sin(first + k * gamma) * c)
        total += value * psi[1, q]
    return PI * total


@kernel
def _add_chains(tilt, n, most, steps, gauss, psi, radial, out):
    """Add the matrices of K between one facet and itself (out[0]) and the other (out[1]), up to `most` reflections."""
    size = out.shape[1]
    basis, here = np.empty((radial.shape[1], size)), np.empty(size)
    gamma = PI - 2.0 * tilt
    for q in range(radial.shape[1]):
        _functions(radial[0, q], steps, basis[q])
    j = 0
    while (j + 1) * gamma < PI and j <= most:
        theta = (j + 1) * gamma
        low, high = theta - 0.5 * PI, 0.5 * theta
        part = out[1 - (j & 1)]
        largest = 0.0
        for g in range(gauss.shape[1]):
            u = low + (high - low) * gauss[0, g]
            first = 0.5 * PI - u
            second = math.sin(PI - theta - first)
            amount = second * _along(n, first, gamma, j, psi) * (high - low) * gauss[1, g]
            largest = max(largest, amount)
            s = second / math.sin(first)
            for q in range(radial.shape[1]):
                _functions(s * radial[0, q], steps, here)
                for a in range(size):
                    value = amount * radial[1, q] * here[a]
                    for b in range(size):
                        part[a, b] += value * basis[q, b]
        j += 1
        if largest < FAINT:
            break


@kernel
def _matrices(tilts, n, most, steps, gauss, psi, radial, out):
    for k in range(tilts.size):
        _add_chains(tilts[k], n, most, steps, gauss, psi, radial, out[k])


def unit_rule(count: int) -> np.ndarray:
    """Return Gauss-Legendre nodes and weights on (0, 1), (2, count)."""
    x, w = gauss(count)
    return np.stack([0.5 * (1.0 + x), 0.5 * w])


def exchange(tilts: np.ndarray, n: float, most: int, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues (R, 2, N) and eigenvectors (R, 2, N, N) of K/pi for cavities of given tilts.

    Parameters
    ----------
    tilts : ndarray (R,)
        Radians in (0, pi/2).
    n : float
        Index of the interface.
    most : int
        Mirror reflections between two body reflections; 0 leaves the direct exchange.
    steps : ndarray (3, N)
        From `cavity_light.recurrence`; N is the number of Legendre functions a parity.

    Returns
    -------
    tuple of ndarray
        By parity: even (both facets alike), odd. kappa times an eigenvalue lies below 1.
    """
    size = steps.shape[1]
    out = np.zeros((tilts.size, 2, size, size))
    _matrices(tilts, n, most, steps, unit_rule(size + 12), unit_rule(12), unit_rule(size), out)
    # the half r1 < r2 was integrated
    same, other = (0.5 * (out + out.swapaxes(2, 3))).swapaxes(0, 1) * 2.0 / PI
    values, vectors = np.linalg.eigh(np.stack([same + other, same - other], axis=1))
    return values, vectors
