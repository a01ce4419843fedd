"""Orders two and above of the symmetric V-groove BRDF, summed to their exact end (Lee 2018, Eqs. 14-17 corrected).

With M >= m the in-plane angles of both directions, d = (M - m)/2 and th = (M + m)/2, order k has on each side
y = Y/k, and the beam is zero from a known k on: Y = (pi +- 2d)/2 for even, (pi +- 2th)/2 for odd orders.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.codes import BECKMANN
from brdftab.models._shared.facets.ndf import density
from brdftab.models._shared.fresnel.fresnel import multiply_chain, multiply_long_chain
from brdftab.models._shared.grooves.groove2d import beam_symmetric
from brdftab.models._shared.grooves.tail import tail_node, tail_panel, tail_panels, tail_power

PI = math.pi
# terms below exp(-45) of the largest exponent met so far cannot change a float64 sum
DEPTH = 45.0


def step_tables(count: int) -> np.ndarray:
    """Return sin and cos of pi/(2k) for k = 0 .. count + 2, shape (2, count + 3); k = 0 is unused."""
    k = np.arange(count + 3, dtype=np.float64)
    k[0] = 1.0
    return np.stack([np.sin(PI / (2.0 * k)), np.cos(PI / (2.0 * k))])


@kernel
def sincos_small(x):
    """Return sin and cos for |x| <= pi/4 to the last digits."""
    z = x * x
    s = 1.0 / 6227020800.0 - z / 1307674368000.0
    s = x * (1.0 + z * (-1 / 6 + z * (1 / 120 + z * (-1 / 5040 + z * (1 / 362880 + z * (-1 / 39916800 + z * s))))))
    c = 1.0 / 479001600.0 + z * (-1.0 / 87178291200.0 + z / 20922789888000.0)
    c = 1.0 + z * (-0.5 + z * (1 / 24 + z * (-1 / 720 + z * (1 / 40320 + z * (-1 / 3628800 + z * c)))))
    return s, c


@kernel
def add_bounces(
    in_plane, big_l, ndf, shape, amp, depth_from, fresnel, steps, k_explicit, k_cap, gauss, prefactor, row, acc
):
    """Add prefactor * sum_k D w sin(a)/k prod F to acc for every k >= 2 up to the cap.

    Parameters
    ----------
    in_plane : tuple of float
        M, m (radians) and sin M, cos M, sin m, cos m.
    big_l : float
        Length of the directions' projections into the groove plane.
    depth_from : float
        tan^2(theta_h)/shape^2 of the first order: where Beckmann's terms may be dropped.
    fresnel : tuple
        kind, a (W,), b (W,), look-up table.
    steps : ndarray (2, >= k_explicit + 3)
        From `step_tables`.
    k_explicit, k_cap : int
        Last order summed term by term; last order counted at all.
    gauss : ndarray (2, n)
        Nodes and weights on (0, 1) for the tail, an integral in 1/k.
    row : ndarray (2, W)
        Scratch.
    acc : ndarray (P, W)
        P = 1: the total. Else order k goes to layer min(k, P) - 1.
    """
    big_m, small_m, sin_big, cos_big, sin_small, cos_small = in_plane
    d = 0.5 * (big_m - small_m)
    th = 0.5 * (big_m + small_m)
    layers = acc.shape[0]
    cut = shape * shape * (depth_from + DEPTH)
    for family in range(4):
        parity = family & 1
        sign = 1.0 if family < 2 else -1.0
        z = th if parity else d
        reach = 0.5 * PI + sign * z
        behind = d if parity else th
        limit = big_m if sign > 0.0 else behind
        end = reach / (limit + 1e-300)
        sin_q = sign * (sin_small if parity else -sin_small)
        k = 2 + parity
        cut_off = False
        while k < end and k <= k_explicit and k <= k_cap:
            s, c = sincos_small(sign * z / k)
            sy = steps[0, k] * c + steps[1, k] * s
            cy = steps[1, k] * c - steps[0, k] * s
            if ndf == BECKMANN and cy * cy > cut * sy * sy:
                cut_off = True
                break
            beam = beam_symmetric(sy, cy, sign * sin_big, cos_big, sin_q, cos_small)
            if beam > 0.0:
                value = prefactor * amp * density(ndf, shape, sy, cy) * beam * cy / k
                _add_term(fresnel, big_l, reach / k, sign * big_m, k, value, row, acc, min(k, layers) - 1)
            k += 2
        if not cut_off and k < end and k <= k_cap:
            last = min(end, k_cap + 1.0 - (k_cap - k) % 2)
            ends = (reach, last, k - 1.0, min(big_m, abs(small_m)), sign * big_m)
            angles = (sign * big_m, cos_big, sign * (small_m if parity else -small_m), cos_small, max(big_m, limit))
            halves = (sign * d, math.cos(th)) if parity else (sign * th, math.cos(d))
            _add_tail(ends, angles, halves, big_l, ndf, shape, prefactor * amp, fresnel, gauss, row, acc)


@kernel
def _add_term(fresnel, big_l, y, theta_i, k, value, row, acc, layer):
    """Add value * prod_j F(L sin((2j - 1) y - theta_i)) to one layer."""
    kind, a, b, table = fresnel
    size = acc.shape[1]
    if kind == MIRROR:
        acc[layer, 0] += value
        return
    product = row[0]
    for w in range(size):
        product[w] = value
    multiply_chain(kind, a, b, table, big_l, y - theta_i, 2.0 * y, k, product)
    for w in range(size):
        acc[layer, w] += product[w]


@kernel
def _add_tail(ends, angles, halves, big_l, ndf, shape, prefactor, fresnel, gauss, row, acc):
    """Add the orders of one family beyond the explicit ones as half the integral over k, in x = 1/k."""
    reach, k_last, k_first, kink, theta_i = ends
    theta, cos_t, opposite, cos_q, kink_high = angles
    difference, cos_mean = halves
    kind, a, b, table = fresnel
    layer = acc.shape[0] - 1
    low, high = 1.0 / k_last, 1.0 / k_first
    power = tail_power(ndf, shape)
    cut1 = min(max(kink / reach, low), high)
    cut2 = min(max(kink_high / reach, low), high)
    for panel in range(3):
        x0 = low if panel == 0 else (cut1 if panel == 1 else cut2)
        x1 = cut1 if panel == 0 else (cut2 if panel == 1 else high)
        if x1 - x0 <= 1e-15:
            continue
        scale = power if panel == 0 or power == 0.0 else 1.0
        parts = tail_panels(scale, x0, x1)
        for n in range(parts * gauss.shape[1]):
            q = n % gauss.shape[1]
            left, right = tail_panel(n // gauss.shape[1], parts, x0, x1)
            x, dx = tail_node(scale, left, right, gauss[0, q])
            y = reach * x
            s, c = math.sin(y), math.cos(y)
            # `beam_symmetric` without differences of numbers near 1: Phong lobes live on steps y that nearly vanish
            beam = 2.0 * min(s * min(cos_t, cos_q), math.sin(y - abs(difference)) * cos_mean)
            beam = min(beam, math.sin(y - theta), math.sin(y - opposite))
            if beam <= 0.0:
                continue
            # dk/2 = dx/(2 x^2) and the term's own 1/k = x
            value = prefactor * density(ndf, shape, s, c) * beam * c * 0.5 * dx * gauss[1, q] / x
            if kind == MIRROR:
                acc[layer, 0] += value
                continue
            product = row[0]
            for w in range(acc.shape[1]):
                product[w] = value
            multiply_long_chain(kind, a, b, table, big_l, -theta_i, 2.0 * reach - theta_i, 1.0 / x, product, row[1])
            for w in range(acc.shape[1]):
                acc[layer, w] += product[w]
