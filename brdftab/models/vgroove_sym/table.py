"""Fast isotropic tables of the symmetric groove: the closed form of every order, on many azimuths at a time.

The azimuths of one pair of polar angles are worked through in chunks. What does not depend on the wavelength is
computed for a whole chunk order by order (`lanes`); the terms that matter are collected in a batch, whose products of
reflectances are formed a wavelength at a time and projected to channels (`chains`). The far tail is an integral over
the order.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR, Fresnel, reflectance
from brdftab.models._shared.codes import PHONG
from brdftab.models._shared.facets.frame import pair
from brdftab.models._shared.facets.ndf import density, shape_at
from brdftab.models._shared.grooves.groove2d import beam_symmetric
from brdftab.models._shared.grooves.tail import tail_node
from brdftab.models.resolve import Setup
from brdftab.models.vgroove_sym.bounces import sincos_small, step_tables
from brdftab.models.vgroove_sym.chains import (
    DEGREE,
    SUMS,
    TERMS,
    expand,
    flush,
    log_polynomial,
    push_chains,
    push_expanded,
)
from brdftab.models.vgroove_sym.simd_rows import (
    BIG,
    C_BIG,
    C_SMALL,
    CY,
    END,
    FAINT,
    FIRST,
    FRONT,
    I_H,
    LANES,
    REACHES,
    ROWS,
    SIN_Q,
    SIN_T,
    SY,
    TH,
    TOTAL,
    VALUE,
    depths,
    distribute,
    family,
    frame,
    order,
    store,
)
from brdftab.quadrature import unit_gauss

NO_CAP = 2_000_000_000
# the tightest tolerance that polynomials and bounce sum are laid out for
REACH = 1e-5
# orders up to this one add up the powers of their cosines bounce by bounce, longer ones by the expansion
DIRECT = 24
# the tail's terms carry a share like 1/x: nodes crowd towards small x, x = low + (high - low) s^3
TAIL_POWER = 3.0
FIRST_CELLS = 4096


@kernel
def _tail(k, k_last, p, ndf, shape, mirror, gauss, lanes, terms, expansion, batch, owners):
    """Add the orders k, k + 2, ... to the end of the family as half the integral over the order, in x = 1/order."""
    reach, big = lanes[REACHES + p], lanes[BIG + p]
    sin_t, sin_q, cos_t, cos_q = lanes[SIN_T + p], lanes[SIN_Q + p], lanes[C_BIG + p], lanes[C_SMALL + p]
    small = abs(2.0 * lanes[TH + p] - big)
    low, high = 1.0 / min(lanes[END + p], k_last), 1.0 / (k - 1.0)
    cut1 = min(max(small / reach, low), high)
    cut2 = min(max(big / reach, low), high)
    for panel in range(3):
        x0 = low if panel == 0 else (cut1 if panel == 1 else cut2)
        x1 = cut1 if panel == 0 else (cut2 if panel == 1 else high)
        if x1 - x0 <= 1e-15:
            continue
        for q in range(gauss.shape[1]):
            x, dx = tail_node(TAIL_POWER, x0, x1, gauss[0, q])
            s, c = sincos_small(reach * x)
            beam = beam_symmetric(s, c, sin_t, cos_t, sin_q, cos_q)
            if beam <= 0.0:
                continue
            value = density(ndf, shape, s, c) * beam * c * 0.5 * dx * gauss[1, q] / x
            if mirror:
                lanes[TOTAL + p] += value
            elif value > lanes[FAINT + p]:
                terms = push_expanded(value, 1.0 / x, p, terms, expansion, batch, owners)
    return terms


@kernel
def _higher_orders(n, distribution, orders, optics, lanes, scratch):
    """Add the orders from two on of n cells to TOTAL (F = 1) or to the sums a channel."""
    ndf, shape, _ = distribution
    steps, k_explicit, k_cap, gauss = orders
    mirror, coefficients, weights = optics[:3]
    state, expansion, batch, owners, projected, sums = scratch
    terms = 0
    for side in range(4):
        family(side, n, lanes)
        low, high = 0, n
        k = 2 + (side & 1)
        expanded = False
        while True:
            while low < high and lanes[END + low] <= k:
                low += 1
            while low < high and lanes[END + high - 1] <= k:
                high -= 1
            if low == high or k > k_cap:
                break
            if not (mirror or expanded) and k > min(DIRECT, k_explicit):
                expand(high - low, lanes[low:], state, expansion[low:])
                expanded = True
            if k > k_explicit:
                break
            order(ndf, shape, k, steps[0, k], steps[1, k], high - low, lanes[low:])
            if mirror:
                for p in range(low, high):
                    lanes[TOTAL + p] += lanes[VALUE + p]
            else:
                if terms + high - low > TERMS:
                    flush(terms, coefficients, weights, batch, owners, projected, sums)
                    terms = 0
                if k <= DIRECT:
                    terms = push_chains(k, low, high, terms, lanes, batch, owners)
                else:
                    for p in range(low, high):
                        if lanes[VALUE + p] > lanes[FAINT + p]:
                            terms = push_expanded(lanes[VALUE + p], float(k), p, terms, expansion, batch, owners)
            k += 2
        if low < high and k <= k_cap:
            k_last = k_cap + 1.0 - (k_cap - k) % 2
            for p in range(low, high):
                if lanes[END + p] > k:
                    if not mirror and terms + 3 * gauss.shape[1] > TERMS:
                        flush(terms, coefficients, weights, batch, owners, projected, sums)
                        terms = 0
                    terms = _tail(k, k_last, p, ndf, shape, mirror, gauss, lanes, terms, expansion, batch, owners)
    if terms > 0:
        flush(terms, coefficients, weights, batch, owners, projected, sums)


@kernel
def _chunk(n, distribution, orders, optics, lanes, scratch, out):
    """Write the BRDF (1/sr) of n <= LANES cells, whose directions stand in the first rows of `lanes`, to out (n, C)."""
    ndf, shape, depth = distribution
    mirror, _, _, first_f, faint = optics
    sums = scratch[5]
    frame(n, lanes)
    distribute(ndf, shape, n, SY, CY, lanes)
    depths(ndf, shape, depth, n, lanes)
    for p in range(n):
        value = lanes[VALUE + p]
        lanes[FIRST + p] = value
        lanes[FAINT + p] = faint * value / max(lanes[FRONT + p], 1e-300)
        lanes[TOTAL + p] = 0.0
    sums[:] = 0.0
    if orders[2] >= 2:
        _higher_orders(n, distribution, orders, optics, lanes, scratch)
    cells = first_f.shape[0] - 1
    for p in range(n):
        first, front = lanes[FIRST + p], lanes[FRONT + p]
        if mirror:
            out[p, 0] = first + front * lanes[TOTAL + p]
            continue
        x = lanes[I_H + p] * cells
        i = min(int(x), cells - 1)
        x -= i
        for c in range(out.shape[1]):
            f = first_f[i, c] + x * (first_f[i + 1, c] - first_f[i, c])
            out[p, c] = first * f + front * sums[c * LANES + p]


@kernel
def _scratch(channels):
    """Return what one thread needs: lanes, the scratch of the higher orders, and a chunk's values."""
    higher = (
        np.empty(7 * LANES),
        np.empty(3 * DEGREE * LANES),
        np.empty(SUMS + DEGREE * TERMS),
        np.empty(TERMS, np.int64),
        np.empty(channels * TERMS),
        np.empty(channels * LANES),
    )
    return np.zeros(ROWS * LANES), higher, np.empty((LANES, channels))


@parallel_kernel
def _points(theta_i, theta_o, phi, distribution, orders, optics, out):
    size = theta_i.size
    chunks = (size + LANES - 1) // LANES
    for chunk in numba.prange(chunks):
        lanes, scratch, value = _scratch(out.shape[1])
        start = chunk * LANES
        n = min(LANES, size - start)
        for p in range(n):
            store(p, pair(theta_i[start + p], theta_o[start + p], phi[start + p]), lanes)
        _chunk(n, distribution, orders, optics, lanes, scratch, value)
        out[start : start + n] = value[:n]


@parallel_kernel
def _fill(theta_i, theta_o, cos_half, sin_phi, square, distribution, orders, optics, out):
    rows, columns, steps, channels = out.shape
    for index in numba.prange(rows):
        # long and short rows of the triangle in turn, so that all threads get the same work
        i = index // 2 if index % 2 == 0 else rows - 1 - index // 2
        lanes, scratch, value = _scratch(channels)
        si, ci = math.sin(theta_i[i]), math.cos(theta_i[i])
        for o in range(i + 1 if square else columns):
            so, co = math.sin(theta_o[o]), math.cos(theta_o[o])
            diff = 2.0 * math.cos(0.5 * (theta_i[i] + theta_o[o])) * math.sin(0.5 * (theta_i[i] - theta_o[o]))
            for start in range(0, steps, LANES):
                n = min(LANES, steps - start)
                for p in range(n):
                    one_plus = 2.0 * cos_half[start + p] * cos_half[start + p]
                    directions = (si, ci, so, co, diff + so * one_plus, so * sin_phi[start + p], si * one_plus - diff)
                    store(p, directions, lanes)
                _chunk(n, distribution, orders, optics, lanes, scratch, value)
                for p in range(n):
                    for c in range(channels):
                        out[i, o, start + p, c] = value[p, c]
                        if square:
                            out[o, i, start + p, c] = value[p, c]


def _optics(fresnel: Fresnel, tolerance: float) -> tuple[Any, ...] | None:
    """Return the reflectance as the kernels take it, or None if no polynomial of log F holds the tolerance."""
    if fresnel.kind == MIRROR:
        nothing = np.empty((1, 0))
        return True, nothing, nothing, nothing, 0.0
    coefficients = log_polynomial(fresnel, 0.2 * tolerance)
    if coefficients is None:
        return None
    first = reflectance(fresnel, np.linspace(0.0, 1.0, FIRST_CELLS + 1)) @ fresnel.weights
    # a term of the sum this much smaller than the first order is left out
    faint = 3e-3 * tolerance * max(float(first.max(axis=1).min()), 0.0)
    weights = np.ascontiguousarray(fresnel.weights)
    return False, coefficients, weights, np.ascontiguousarray(first), faint


def _explicit(tolerance: float, alpha: float) -> tuple[int, int]:
    """Return how many orders are summed one by one, and the nodes of the tail, for a relative tolerance.

    The tail's error grows with the roughness; measured at F = 1 near the mirror direction, where it is largest.
    """
    orders, nodes = (24, 5) if tolerance >= 5e-4 else (32, 6) if tolerance >= 1e-4 else (128, 8)
    return math.ceil(orders * max(1.5 * alpha, 1.0) ** 0.8), nodes


class GrooveEvaluator:
    """One isotropic setup, ready for points and product grids.

    Parameters
    ----------
    setup : Setup
        Isotropic.
    tolerance : float
        Relative error asked, against the largest channel of a cell; at least `REACH`.
    optics : tuple
        From `_optics`.
    """

    def __init__(self, setup: Setup, tolerance: float, optics: tuple[Any, ...]) -> None:
        k_explicit, nodes = _explicit(tolerance, setup.alpha_x)
        k_cap = NO_CAP if setup.max_bounces is None else setup.max_bounces
        shape = shape_at(setup.ndf, setup.alpha_x, setup.alpha_y, 1.0, 0.0)[0]
        distribution = (setup.ndf, shape, 14.0 - math.log(tolerance))
        orders = (step_tables(k_explicit), k_explicit, k_cap, unit_gauss(nodes))
        self._arguments = (distribution, orders, optics)
        self._channels = len(setup.channels)

    def points(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, phi_i: np.ndarray) -> np.ndarray:
        """Evaluate at N pairs of directions (radians; phi_i does not matter); returns (N, 1, C) in 1/sr."""
        out = np.empty((theta_i.size, self._channels))
        # other memory layouts would be compiled anew
        theta_i, theta_o, phi = (np.ascontiguousarray(axis) for axis in (theta_i, theta_o, phi))
        _points(theta_i, theta_o, phi, *self._arguments, out)
        return out[:, None, :]

    def fill(self, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray, square: bool, out: np.ndarray) -> None:
        """Fill out (1, I, O, F, C), float32 or float64, on a product grid of radians, in 1/sr.

        A square grid (both theta axes the same) is computed half and mirrored: reciprocal bit for bit.
        """
        theta_i, theta_o = np.ascontiguousarray(theta_i), np.ascontiguousarray(theta_o)
        _fill(theta_i, theta_o, np.cos(0.5 * phi), np.sin(phi), square, *self._arguments, out[0])


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> GrooveEvaluator | None:
    """Return the fast evaluation of an isotropic setup, or None where it cannot hold the tolerance.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    tolerance : float
        Relative error asked, against the largest channel of a cell.
    orders : int
        0; components take points.
    trial : bool
        Prepared only to compile the kernels; nothing is cheaper for it here.
    """
    assert setup.fresnel is not None
    # beyond alpha = 1 Phong's exponent is negative and the orders hardly fall off
    if orders or not setup.isotropic or tolerance < REACH or (setup.ndf == PHONG and setup.alpha_x > 1.0):
        return None
    optics = _optics(setup.fresnel, tolerance)
    return None if optics is None else GrooveEvaluator(setup, tolerance, optics)
