"""Fast isotropic tables of the nonsymmetric groove: the in-plane part of the higher orders on a grid, interpolated.

For an isotropic distribution f = f_1 + W(M, m, L)/(4 i_z o_z cos d sin th) with M >= |m| the in-plane angles, and W
depends on the projected length L through the reflectance alone. The grid follows M = (pi/2)(1 - (1 - u)^2) and
m = M sin(pi s/2) with a panel break at s = 0; log W is interpolated by 4 x 4 cubic Lagrange polynomials, and the ratio
of each channel to F = 1 is a polynomial in sqrt(L) whose coefficients are interpolated likewise.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON, MIRROR_SINE
from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR, Fresnel, reflectance
from brdftab.models._shared.codes import BECKMANN, PHONG
from brdftab.models._shared.facets.frame import groove_plane, pair
from brdftab.models._shared.facets.ndf import density
from brdftab.models._shared.fresnel.logfresnel import fit
from brdftab.models._shared.fresnel.project import arguments, thinned
from brdftab.models.resolve import Setup
from brdftab.models.vgroove_nonsym.bounces import NODES, add_bounces
from brdftab.models.vgroove_nonsym.direct import PAIRED, points
from brdftab.models.vgroove_nonsym.first_order import mean_masking
from brdftab.models.vgroove_nonsym.panels import CUTS
from brdftab.quadrature import unit_gauss

PI = math.pi
HALF_PI = 0.5 * math.pi
TINY = 1e-300
# the tightest tolerance that the fixed grid can hold
REACH = 8e-4
# rows in M and columns in m: the smaller is tried from a tolerance on
SIZES, LOOSE = ((57, 73), (113, 145)), 2e-3
# a grid that compiles the kernels
TRIAL = (5, 9)
# projected lengths for bright reflectances and for those below a part at normal incidence
LENGTHS, MORE, DIM = 9, 12, 0.3
# a finished grid is compared with direct sums of this tolerance at this many directions in each of five cones
CHECKS, CHECKED_TO = 8, 3e-5
F_CELLS = 4096
DEPTH = 120.0
# logarithms below this are so small that straight interpolation, which cannot overshoot, serves
FAINT = -50.0


@kernel
def _peak_shift(d, shape):
    """Return the exponent of the deepest Beckmann pair l = r at order 2, taken out before the logarithm."""
    t = math.tan(0.25 * PI - 0.5 * d)
    return 2.0 * t * t / (shape * shape)


@parallel_kernel
def _build(
    order, ndf, shape, k_explicit, k_cap, pair_from, tail, gauss, fresnel, coefficients, powers, weights, inverse, grid
):
    rows, columns, _ = grid.shape
    channels = weights.shape[1]
    for index in numba.prange(rows):
        i = order[index]
        size = weights.shape[0]
        lengths = powers.shape[1]
        acc = np.empty((1, size, lengths))
        work = (np.empty(CUTS), np.empty(CUTS), np.empty((2, size)), np.empty((NODES, 2)))
        series = (coefficients, powers, np.empty(powers.shape[0]), np.empty((size, lengths)))
        u = max(i / (rows - 1.0), 1e-6)
        big = min(HALF_PI * (1.0 - (1.0 - u) * (1.0 - u)), HALF_PI - 1e-9)
        for j in range(columns):
            small = big * math.sin(HALF_PI * (2.0 * j / (columns - 1.0) - 1.0))
            shift = _peak_shift(0.5 * (big - small), shape) if ndf == BECKMANN else 0.0
            acc[:] = 0.0
            rule = (gauss, gauss, False, shift + DEPTH, pair_from)
            total = add_bounces(
                big,
                small,
                ndf,
                shape,
                shift,
                (k_explicit, k_explicit),
                k_cap,
                tail,
                rule,
                fresnel,
                1.0,
                series,
                work,
                acc,
            )
            node = grid[i, j]
            node[:] = 0.0
            node[0] = math.log(max(total, TINY))
            if fresnel[0] == 0 or total <= TINY:
                continue
            for c in range(channels):
                full = 0.0
                for w in range(size):
                    full += weights[w, c]
                for q in range(lengths):
                    ratio = 0.0
                    for w in range(size):
                        ratio += weights[w, c] * acc[0, w, q]
                    step = ratio / total - full
                    for p in range(lengths):
                        node[1 + p * channels + c] += inverse[p, q] * step


@kernel
def _cubic(x, low, high, weights):
    """Write cubic Lagrange weights at x for four nodes inside [low, high] and return the first node."""
    i = min(max(int(x) - 1, low), high - 3)
    t = x - i - 1.0
    a, b, c, d = t + 1.0, t, t - 1.0, t - 2.0
    weights[0] = -b * c * d / 6.0
    weights[1] = a * c * d / 2.0
    weights[2] = -a * b * d / 2.0
    weights[3] = a * b * c / 6.0
    return i


@kernel
def _straight(grid, x, y):
    """Return the bilinear value of log W at grid coordinates."""
    i = min(int(x), grid.shape[0] - 2)
    j = min(int(y), grid.shape[1] - 2)
    a, b = x - i, y - j
    low = grid[i, j, 0] * (1.0 - b) + grid[i, j + 1, 0] * b
    high = grid[i + 1, j, 0] * (1.0 - b) + grid[i + 1, j + 1, 0] * b
    return low * (1.0 - a) + high * a


@kernel
def _higher_orders(big, ratio, grid, sums, wu, wv):
    """Write the interpolated log W and ratio coefficients at M = big, m = big * ratio to sums."""
    rows, columns, entries = grid.shape
    x = (1.0 - math.sqrt(max(1.0 - big / HALF_PI, 0.0))) * (rows - 1.0)
    i = _cubic(x, 0, rows - 1, wu)
    y = 0.5 * (math.asin(min(max(ratio, -1.0), 1.0)) / HALF_PI + 1.0) * (columns - 1.0)
    middle = (columns - 1) // 2
    j = _cubic(y, 0, middle, wv) if y < middle else _cubic(y, middle, columns - 1, wv)
    for e in range(entries):
        sums[e] = 0.0
    lowest = 0.0
    for a in range(4):
        for b in range(4):
            w = wu[a] * wv[b]
            lowest = min(lowest, grid[i + a, j + b, 0])
            for e in range(entries):
                sums[e] += w * grid[i + a, j + b, e]
    if lowest < FAINT:
        sums[0] = _straight(grid, x, y)


@kernel
def _at(directions, ndf, shape, many_bounces, first_f, full, grid, gauss, work, out):
    """Write the channels of the BRDF (1/sr) at one pair of directions, given as `pair` returns it."""
    si, ci, so, co, hx, hy, ox = directions
    channels = out.size
    if min(ci, co) <= HORIZON:
        for c in range(channels):
            out[c] = 0.0
        return
    wu, wv, sums = work
    sin_h, cos_h, i_h, big_l, st, ct, su, cu = groove_plane(si, ci, so, co, hx, hy, ox)
    t, u = math.atan2(st, ct), math.atan2(su, cu)
    if u > t:
        t, u, st, ct = u, t, su, cu
    cos_d = i_h / big_l
    front = 0.25 / (ci * co)
    first = front * density(ndf, shape, cos_h, sin_h) * mean_masking(ndf, shape, sin_h, cos_d, st, ct, gauss)
    x = i_h * F_CELLS
    cell = min(int(x), F_CELLS - 1)
    x -= cell
    for c in range(channels):
        out[c] = first * (first_f[cell, c] + x * (first_f[cell + 1, c] - first_f[cell, c]))
    if not many_bounces or sin_h < MIRROR_SINE:
        return
    _higher_orders(t, u / max(t, TINY), grid, sums, wu, wv)
    log_w = sums[0]
    if ndf == BECKMANN:
        # tan(pi/4 - d/2) = cos d/(1 + sin d)
        tan = cos_d / (1.0 + math.sqrt(max(1.0 - cos_d * cos_d, 0.0)))
        log_w -= 2.0 * tan * tan / (shape * shape)
    rest = front / (cos_d * sin_h) * math.exp(log_w)
    root = math.sqrt(big_l)
    count = (grid.shape[2] - 1) // channels
    for c in range(channels):
        ratio = 0.0
        for p in range(count - 1, -1, -1):
            ratio = (ratio + sums[1 + p * channels + c]) * root
        out[c] += rest * (full[c] + ratio)


@parallel_kernel
def _points(theta_i, theta_o, phi, ndf, shape, many_bounces, first_f, full, grid, gauss, out):
    blocks = 64
    size = theta_i.size
    for block in numba.prange(blocks):
        work = (np.empty(4), np.empty(4), np.empty(grid.shape[2]))
        for n in range(size * block // blocks, size * (block + 1) // blocks):
            directions = pair(theta_i[n], theta_o[n], phi[n])
            _at(directions, ndf, shape, many_bounces, first_f, full, grid, gauss, work, out[n])


@parallel_kernel
def _fill(theta_i, theta_o, cos_half, sin_phi, square, ndf, shape, many_bounces, first_f, full, grid, gauss, out):
    rows, columns, steps, channels = out.shape
    for index in numba.prange(rows):
        # long and short rows of the triangle in turn, so that all threads get the same work
        i = index // 2 if index % 2 == 0 else rows - 1 - index // 2
        work = (np.empty(4), np.empty(4), np.empty(grid.shape[2]))
        value = np.empty(channels)
        si, ci = math.sin(theta_i[i]), math.cos(theta_i[i])
        for o in range(i + 1 if square else columns):
            so, co = math.sin(theta_o[o]), math.cos(theta_o[o])
            diff = 2.0 * math.cos(0.5 * (theta_i[i] + theta_o[o])) * math.sin(0.5 * (theta_i[i] - theta_o[o]))
            for p in range(steps):
                one_plus = 2.0 * cos_half[p] * cos_half[p]
                directions = (si, ci, so, co, diff + so * one_plus, so * sin_phi[p], si * one_plus - diff)
                _at(directions, ndf, shape, many_bounces, first_f, full, grid, gauss, work, value)
                for c in range(channels):
                    out[i, o, p, c] = value[c]
                    if square:
                        out[o, i, p, c] = value[c]


class InterpolatingEvaluator:
    """The in-plane part of one setup, built once; evaluates points and product grids.

    Parameters
    ----------
    setup : Setup
        Isotropic, Beckmann or GGX.
    fresnel : Fresnel
        Reflectance of orders two and above, maybe with fewer wavelengths than the setup's.
    coefficients : ndarray (W, P)
        Polynomial of log F from `logfresnel.fit`.
    size : (int, int)
        Rows and columns of the grid.
    """

    def __init__(self, setup: Setup, fresnel: Fresnel, coefficients: np.ndarray, size: tuple[int, int]) -> None:
        weights = np.ascontiguousarray(fresnel.weights)
        k_cap = 2_000_000_000 if setup.max_bounces is None else setup.max_bounces
        # nodes in L that leave out 0, where the ratio is known to be 1, and include 1
        count = MORE if reflectance(fresnel, np.ones(1)).min() < DIM else LENGTHS
        n = np.arange(1, count + 1)
        lengths = (0.5 * (1.0 - np.cos(np.pi * n / count))) ** 2
        inverse = np.linalg.inv(np.sqrt(lengths)[:, None] ** n[None, :])
        powers = np.ascontiguousarray(lengths[None, :] ** np.arange(1, coefficients.shape[1] + 1)[:, None])
        entries = 1 if fresnel.kind == MIRROR else 1 + count * weights.shape[1]
        rows = size[0]
        grid = np.empty((*size, entries))
        many_bounces = k_cap >= 2
        if many_bounces:
            order = np.random.default_rng(0).permutation(rows)
            ndf, shape, tail, gauss = setup.ndf, setup.alpha_x, unit_gauss(3), unit_gauss(6)
            _build(
                order,
                ndf,
                shape,
                16,
                k_cap,
                PAIRED,
                tail,
                gauss,
                arguments(fresnel, 0.0),
                coefficients,
                powers,
                weights,
                inverse,
                grid,
            )
        full = weights.sum(axis=0)
        self._arguments = (
            setup.ndf,
            setup.alpha_x,
            many_bounces,
            _projected_table(setup),
            full,
            grid,
            unit_gauss(20),
        )
        self._channels = full.size

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians; phi_i does not matter); returns (N, 1, C) in 1/sr."""
        out = np.empty((theta_i.size, self._channels))
        _points(theta_i, theta_o, phi, *self._arguments, out)
        return out[:, None, :]

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (1, I, O, F, C) on a product grid; a square one is computed half and mirrored."""
        _fill(theta_i, theta_o, np.cos(0.5 * phi), np.sin(phi), square, *self._arguments, out[0])


def build(setup: Setup, tolerance: float, trial: bool = False) -> InterpolatingEvaluator | None:
    """Return an interpolant where it can hold the tolerance, else None (then evaluate directly)."""
    assert setup.fresnel is not None
    if setup.ndf == PHONG or not setup.isotropic or tolerance < REACH or not 0.02 <= setup.alpha_x <= 2.0:
        return None
    fresnel, coefficients = setup.fresnel, np.zeros((1, 0))
    if fresnel.kind != MIRROR:
        fresnel = thinned(setup, 0.3 * tolerance)
        found = fit(fresnel, 0.05 * tolerance)
        if found is None:
            return None
        coefficients = found
    if trial:
        return InterpolatingEvaluator(setup, fresnel, coefficients, TRIAL)
    for size in SIZES[0 if tolerance >= LOOSE else 1 :]:
        made = InterpolatingEvaluator(setup, fresnel, coefficients, size)
        if _worst(setup, made) <= tolerance:
            return made
    return None


def _worst(setup: Setup, made: InterpolatingEvaluator) -> float:
    """Return the largest relative error at fixed directions, most of them steep: there lengths and orders vary most."""
    random = np.random.default_rng(0)
    top = np.radians(np.repeat([0.5, 5.0, 20.0, 45.0, 88.0], CHECKS))
    theta_i, theta_o = top * random.uniform(0.1, 1.0, (2, top.size))
    phi = np.pi - np.where(np.arange(top.size) % 2, 0.02, np.pi) * random.random(top.size)
    phi_i = np.zeros(top.size)
    right = points(setup, theta_i, theta_o, phi, phi_i, orders=0, tolerance=CHECKED_TO)
    # channels made of signed spectral weights may pass through zero
    scale = np.maximum(np.abs(right), 0.1 * np.abs(right).max(axis=-1, keepdims=True)) + TINY
    return float((np.abs(made.points(theta_i, theta_o, phi, phi_i) - right) / scale).max())


def _projected_table(setup: Setup) -> np.ndarray:
    """Return F per channel at F_CELLS + 1 equidistant cosines."""
    assert setup.fresnel is not None
    cosine = np.linspace(0.0, 1.0, F_CELLS + 1)
    return np.ascontiguousarray(reflectance(setup.fresnel, cosine) @ setup.fresnel.weights)
