"""Where light falls in a symmetric V-cavity, directly and after mirror reflections off its facets.

Both facets have slant length 1, tilt t and the opening angle gamma = pi - 2 t between them; r in (0, 1) runs from the
bottom edge. A collimated beam keeps one direction a chain of mirror reflections. Unfolded about the bottom edge it is a
straight beam that crosses copies of the facets at the polar angles 0, -gamma, -2 gamma, ...: with X_j = |u_p| sin(iota
+ j gamma), u_p the direction's projection into the cross-section and iota its angle from the first facet, the beam of
lines at distance p/|u_p| from the edge hits copy j at r = p/X_j under the cosine X_j. It enters through the opening
where max(0, -u.m') < p < u.m, and is still inside at copy j where p < X_j. So every chain lights one interval of a
facet evenly, with the transmitted irradiance X_j T(X_j) prod_{k<j} F(X_k).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.fresnel.interface import transmission

# chains fainter than this are left out
FAINT = 1e-9
HALF = math.sqrt(0.5)


def recurrence(size: int) -> np.ndarray:
    """Return what the Legendre recurrence needs, (3, size): (2n+1)/(n+1), n/(n+1), 1/(2 sqrt(2n+1))."""
    n = np.arange(size, dtype=np.float64)
    return np.stack([(2.0 * n + 1.0) / (n + 1.0), n / (n + 1.0), 0.5 / np.sqrt(2.0 * n + 1.0)])


@kernel
def interval_moments(low, high, steps, out):
    """Write the integrals over (low, high) of the Legendre functions orthonormal on (0, 1) to out (N,)."""
    out[:] = 0.0
    out[0] = high - low
    for side in range(2):
        r = high if side == 0 else low
        if r <= 0.0 or r >= 1.0:
            continue
        sign = 1.0 if side == 0 else -1.0
        x = 2.0 * r - 1.0
        before, now = 1.0, x
        for n in range(1, out.size):
            after = steps[0, n] * x * now - steps[1, n] * before
            out[n] += sign * steps[2, n] * (after - before)
            before, now = now, after


@kernel
def lit(along, up, st, ct, n, two, steps, chain, out):
    """Write the Legendre moments of the light in the cavity to out (S, 2, N): sets, facets, functions.

    Parameters
    ----------
    along, up : float
        Components of the direction along the horizontal part of the first facet's normal, and along the surface normal.
    st, ct : float
        Sine and cosine of the tilt.
    n : float
        Index of the interface.
    two : bool
        Sets are (direct and once mirrored, direct, once mirrored) if true, else (all chains, direct).
    steps : ndarray (3, N)
        From `recurrence`.
    chain : ndarray (N,)
        Scratch.
    """
    out[:] = 0.0
    size = chain.size
    c2, s2 = (ct - st) * (ct + st), 2.0 * st * ct
    for side in range(2):
        h = along if side == 0 else -along
        x, y = up * ct + h * st, up * st - h * ct
        first, low = x, max(0.0, h * st - up * ct)
        share = 1.0
        j = 0
        while x > 0.0 and share > FAINT and not (two and j > 1):
            high = min(first, x)
            if low >= high:
                break
            t = transmission(n, min(x, 1.0))
            interval_moments(low / x, high / x, steps, chain)
            value = share * x * t
            facet = (side + j) & 1
            for k in range(size):
                amount = value * chain[k]
                out[0, facet, k] += amount
                if j == 0:
                    out[1, facet, k] += amount
                elif two:
                    out[2, facet, k] += amount
            share *= 1.0 - t
            x, y = s2 * y - c2 * x, -c2 * y - s2 * x
            j += 1


@kernel
def _transform(light, cosines, vectors, row, out):
    """Write eigenfunctions' cosine coefficients of light (S, N, Q) to out (M, S, N); row (M,) is scratch."""
    sets, size, count = light.shape
    for b in range(sets):
        for m in range(row.size):
            for e in range(size):
                out[m, b, e] = 0.0
        for f in range(size):
            for m in range(row.size):
                row[m] = 0.0
            for q in range(count):
                value = light[b, f, q]
                if value != 0.0:
                    for m in range(row.size):
                        row[m] += value * cosines[q, m]
            for m in range(row.size):
                for e in range(size):
                    out[m, b, e] += vectors[f, e] * row[m]


@kernel
def _modes_at(theta, st, ct, azimuths, cosines, n, two, steps, vectors, out):
    """Fill out (2, M, R, S, N) as `modes_of_light` for one polar angle."""
    _, orders, rings, sets, size = out.shape
    chain, light = np.empty(size), np.empty((sets, 2, size))
    parts, row = np.empty((2, sets, size, azimuths.size)), np.empty(orders)
    s, c = math.sin(theta), math.cos(theta)
    for k in range(rings):
        for q in range(azimuths.size):
            lit(s * math.cos(azimuths[q]), c, st[k], ct[k], n, two, steps, chain, light)
            for b in range(sets):
                for f in range(size):
                    parts[0, b, f, q] = HALF * (light[b, 0, f] + light[b, 1, f])
                    parts[1, b, f, q] = HALF * (light[b, 0, f] - light[b, 1, f])
        for parity in range(2):
            _transform(parts[parity], cosines[parity], vectors[k, parity], row, out[parity, :, k])


@parallel_kernel
def modes_of_light(theta, st, ct, azimuths, cosines, n, two, steps, vectors, out):
    """Fill out (2, M, U, R, S, N): even and odd Fourier modes of `lit` in the eigenfunctions of the exchange.

    Parameters
    ----------
    theta, st, ct : ndarray (U,), (R,), (R,)
        Polar angles; sines and cosines of the tilts.
    azimuths : ndarray (Q,)
        In a quarter of the circle, between the direction and the first facet's normal.
    cosines : ndarray (2, Q, M)
        Weights of the cosine coefficients by parity: of the sum and of the difference of both facets over sqrt 2.
    vectors : ndarray (R, 2, N, N)
        Eigenvectors in columns.
    """
    for u in numba.prange(theta.size):
        _modes_at(theta[u], st, ct, azimuths, cosines, n, two, steps, vectors, out[:, :, u])


@kernel
def _cavities_at(theta, azimuth, nodes, n, two, steps, vectors, out):
    """Fill out (R, S, 2, N) as `everywhere` for one direction."""
    rings, sets, _, size = out.shape
    chain, light = np.empty(size), np.empty((sets, 2, size))
    s, c = math.sin(theta), math.cos(theta)
    for k in range(rings):
        lit(s * math.cos(azimuth - nodes[2, k]), c, nodes[0, k], nodes[1, k], n, two, steps, chain, light)
        for b in range(sets):
            for parity in range(2):
                sign = HALF if parity == 0 else -HALF
                for f in range(size):
                    out[k, b, parity, f] = 0.0
                for g in range(size):
                    both = HALF * light[b, 0, g] + sign * light[b, 1, g]
                    for f in range(size):
                        out[k, b, parity, f] += vectors[k, parity, g, f] * both


@parallel_kernel
def everywhere(theta, azimuth, nodes, n, two, steps, vectors, out):
    """Fill out (D, R, S, 2, N) with `lit` for directions (D,) and cavities (R,) of tilt and azimuth, in eigenvectors.

    `nodes` (3, R) holds sine and cosine of the tilt and the azimuth; `vectors` (R, 2, N, N) the eigenvectors by parity.
    """
    for d in numba.prange(theta.size):
        _cavities_at(theta[d], azimuth[d], nodes, n, two, steps, vectors, out[d])
