"""What V-cavities add where both directions are masked: two smooth wedges of slope space for each cell.

Where x_i > 2 and x_o > 2 (x_u = 1 + t_u.s, see rings.py) the masked integrand min(2 x_i, 2 x_o) exceeds the product 4
of rings.py by 2 (x_i - 2) on the side x_o > x_i, and the other way round. In polar coordinates (r, psi) of stretched
slopes about the origin, with psi from the light's azimuth and d = cot(theta)/sigma, the first wedge is
r > r_0 = d_i/cos psi, psi > psi* = atan((d_o - d_i cos phi)/(d_i sin phi)), and there x_i - 2 = r/r_0 - 1:

    W_i = int d psi int_(r_0) 2 (r/r_0 - 1) P(r) T_i T_o m_z r dr.

For each distribution r^2 (or the squared tilt) is r_0^2 plus a multiple of fixed nodes with fixed weights, so that one
exponential an angle is left. All azimuths of a pair of polar angles run at once, so that the loops vectorise.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import BECKMANN, GAUSSIAN, GGX
from brdftab.models._shared.facets.gaussian import gaussian_norm
from brdftab.models._shared.single_bounce.single_rows import exponential
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array

HALF_PI = 0.5 * math.pi


def wedge_rule(ndf: int, sigma: float, reach: float, radii: int, angles: int) -> tuple[Array, Array, float]:
    """Return radial nodes and weights (2, radii), angular ones (2, angles), and `reach`.

    Beckmann and Gaussian facets are kept up to an exponent `reach` above the wedge's nearest ones; with GGX, wedges
    beyond the squared stretched slope `reach` are left out.

    The squared radius is r_0^2 + s v with s = 1 (Beckmann) or 1 + r_0^2 (GGX), v being a node; for the Gaussian it is
    the squared tilt, in units of 2 sigma^2.
    """
    x, w = unit_gauss(radii)
    if ndf == GGX:
        # m_z turns at r = 1/sigma, near the end
        power = 1.5 if sigma < 0.3 else 1.0
        angle = HALF_PI * (1.0 - (1.0 - x) ** power)
        radial = np.stack([np.tan(angle) ** 2, HALF_PI * w * power * (1.0 - x) ** (power - 1.0) * np.sin(2.0 * angle)])
    elif ndf == BECKMANN:
        v = reach * x * x
        radial = np.stack([v, 2.0 * reach * w * x * np.exp(-v)])
    else:
        # the upper end depends on the cell; 2 pi C sigma^2 is the norm that the exponential lacks
        radial = np.stack([x * x, gaussian_norm(sigma) * 2.0 * w * x])
    return radial, unit_gauss(angles), reach


@kernel
def _turn(x):
    """Return sine and cosine of x in [-pi/2, pi/2] to 4e-16: Taylor polynomials, which vectorise."""
    z = x * x
    s = -1.0 / 121645100408832000.0
    s = s * z + 1.0 / 355687428096000.0
    s = s * z - 1.0 / 1307674368000.0
    s = s * z + 1.0 / 6227020800.0
    s = s * z - 1.0 / 39916800.0
    s = s * z + 1.0 / 362880.0
    s = s * z - 1.0 / 5040.0
    s = s * z + 1.0 / 120.0
    s = s * z - 1.0 / 6.0
    c = 1.0 / 2432902008176640000.0
    c = c * z - 1.0 / 6402373705728000.0
    c = c * z + 1.0 / 20922789888000.0
    c = c * z - 1.0 / 87178291200.0
    c = c * z + 1.0 / 479001600.0
    c = c * z - 1.0 / 3628800.0
    c = c * z + 1.0 / 40320.0
    c = c * z - 1.0 / 720.0
    c = c * z + 1.0 / 24.0
    c = c * z - 0.5
    return x * (1.0 + z * s), 1.0 + z * c


@kernel
def _limits(ndf, sigma, reach, di, do, cos_phi, sin_phi):
    """Return the range of pi/2 - psi in which the wedge holds facets; empty (0, 0) where there are none."""
    high = math.atan2(di * max(sin_phi, 1e-300), do - di * cos_phi)
    nearest = di / (1.0 if high >= HALF_PI else math.sin(high))
    if ndf == GGX:
        return 0.0, high if nearest * nearest <= reach else 0.0
    if ndf == BECKMANN:
        if nearest * nearest > reach:
            return 0.0, 0.0
        farthest = math.sqrt(nearest * nearest + reach)
    else:
        tilt, room = math.atan(nearest), 2.0 * sigma * sigma * reach
        if tilt * tilt > room:
            return 0.0, 0.0
        tilt = math.sqrt(tilt * tilt + room)
        farthest = math.tan(tilt) if tilt < HALF_PI else math.inf
    low = math.asin(di / farthest)
    return low, min(high, math.pi - low)


@kernel
def _angle_row(ndf, x, weight, di, do, start, span, cosine, sine, r0, growth, share, view):
    """Write r_0, s, the weight and d(x_o)/dr at one angular node of every azimuth."""
    for a in range(start.size):
        s, c = _turn(start[a] + span[a] * x - HALF_PI)
        # s and c are -sin psi and cos psi
        c = max(c, 1e-15)
        near = di / c
        near2 = near * near
        r0[a] = near
        view[a] = (c * cosine[a] - s * sine[a]) / do
        growth[a] = 1.0 + near2 if ndf == GGX else 1.0
        e = exponential(-min(near2, 700.0))
        scale = 1.0 / (1.0 + near2) if ndf == GGX else (e if ndf == BECKMANN else 1.0)
        share[a] = weight * span[a] * scale


@kernel
def _radius_row(row, r0, growth, share, view, total):
    """Add one radial node of every azimuth (Beckmann, GGX), in the type of the arrays.

    `row` holds 1, 2, v, 4 times the weight, sigma^2, n^2 - 1, n^2 and both cosines: a literal would widen float32.
    """
    one, two, v, weight, sigma2, q, n2, ci, co = row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8]
    for a in range(r0.size):
        near = r0[a]
        rise = growth[a] * v
        r2 = near * near + rise
        r = math.sqrt(r2)
        nu = rise / (near * (r + near))
        mz = math.sqrt(one / (one + sigma2 * r2))
        im = (two + nu) * ci * mz
        om = (one + r * view[a]) * co * mz
        gi, go = math.sqrt(q + im * im), math.sqrt(q + om * om)
        ai, bi, ao, bo = gi + im, n2 * im + gi, go + om, n2 * om + go
        inverse = one / ((ai * bi) * (ao * bo))
        first = (gi * im) * (go * om) * inverse
        second = (bi * bi + n2 * ai * ai) * (bo * bo + n2 * ao * ao) * inverse
        total[a] += weight * share[a] * nu * mz * first * second


@kernel
def _tilt_row(v, weight, sigma, reach, q, ci, co, r0, share, view, total):
    """Add one radial node of every azimuth (Gaussian; `share` without the exponential)."""
    n2 = q + 1.0
    room = 2.0 * sigma * sigma
    for a in range(r0.size):
        near = r0[a]
        first = math.atan(near)
        height = min(reach, (HALF_PI * HALF_PI - first * first) / room)
        if height <= 0.0 or first * first > 700.0 * room:
            continue
        tilt = min(math.sqrt(first * first + room * height * v), HALF_PI)
        r = math.tan(tilt)
        mz = math.cos(tilt)
        nu = max(r / near - 1.0, 0.0)
        im = (2.0 + nu) * ci * mz
        om = (1.0 + r * view[a]) * co * mz
        gi, go = math.sqrt(q + im * im), math.sqrt(q + om * om)
        ai, bi, ao, bo = gi + im, n2 * im + gi, go + om, n2 * om + go
        low = (ai * bi) * (ao * bo)
        up = (gi * im) * (go * om) * ((bi * bi + n2 * ai * ai) * (bo * bo + n2 * ao * ao))
        kept = math.exp(-tilt * tilt / room) * math.sin(tilt) / tilt
        total[a] += 4.0 * weight * share[a] * height * kept * nu * mz * up / (low * low)


@kernel
def _wedge(ndf, sigma, q, rule, di, do, ci, co, cos_phi, sin_phi, lanes, work, out):
    """Add one wedge of a pair of polar angles to out (phi,); `lanes` (5, phi) float64, `work` in the loop's type."""
    radial, angular, reach = rule
    count = 0
    for p in range(out.size):
        low, high = _limits(ndf, sigma, reach, di, do, cos_phi[p], sin_phi[p])
        if high > low:
            lanes[0, count], lanes[1, count] = low, high - low
            lanes[2, count], lanes[3, count], lanes[4, count] = cos_phi[p], sin_phi[p], p
            count += 1
    start, span, cosine, sine = lanes[0, :count], lanes[1, :count], lanes[2, :count], lanes[3, :count]
    r0, growth, share, view = work[0, :count], work[1, :count], work[2, :count], work[3, :count]
    total, row = work[4, :count], work[5, :9]
    total[:] = 0.0
    row[0], row[1], row[4], row[5], row[6], row[7], row[8] = 1.0, 2.0, sigma * sigma, q, q + 1.0, ci, co
    for j in range(angular.shape[1]):
        _angle_row(ndf, angular[0, j], angular[1, j], di, do, start, span, cosine, sine, r0, growth, share, view)
        for k in range(radial.shape[1]):
            row[2], row[3] = radial[0, k], 4.0 * radial[1, k]
            if ndf == GAUSSIAN:
                _tilt_row(radial[0, k], radial[1, k], sigma, reach, q, ci, co, r0, share, view, total)
            else:
                _radius_row(row, r0, growth, share, view, total)
    for a in range(count):
        out[int(lanes[4, a])] += total[a] / math.pi


@parallel_kernel
def add_wedges(ndf, sigma, q, rule, kind, theta_i, theta_o, cos_phi, sin_phi, first, triangle, out):
    """Add both wedges to out (lights, views, phi), whose first light is `first` of the axis; o <= i if `triangle`.

    The arithmetic has the type of the array `kind`.
    """
    rows, columns, steps = out.shape
    unit = sigma if ndf != GAUSSIAN else 1.0
    for index in numba.prange(rows * columns):
        i, o = index // columns, index % columns
        if triangle and o > first + i:
            continue
        ti, to = theta_i[first + i], theta_o[o]
        di, do = 1.0 / (unit * max(math.tan(ti), 1e-100)), 1.0 / (unit * max(math.tan(to), 1e-100))
        # all of both wedges is farther out than d_i and d_o
        if ndf != GAUSSIAN and max(di, do) ** 2 > rule[2]:
            continue
        lanes, work = np.empty((5, steps)), np.empty((6, max(steps, 9)), kind.dtype)
        ci, co = math.cos(ti), math.cos(to)
        _wedge(ndf, sigma, q, rule, di, do, ci, co, cos_phi, sin_phi, lanes, work, out[i, o])
        _wedge(ndf, sigma, q, rule, do, di, co, ci, cos_phi, sin_phi, lanes, work, out[i, o])
