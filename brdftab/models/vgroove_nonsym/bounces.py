"""Orders two and above of the nonsymmetric V-groove BRDF by panel quadrature (Lee 2018, Eqs. 22-23 corrected).

All orders and both sides for in-plane angles M >= |m|; d = (M - m)/2, th = (M + m)/2. What is summed is
int P(r) D(l) sin^2(l) w prod F/J dr, so that f = L/(4 (i.h) i_z o_z sin(theta_h)) times the sum.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.codes import BECKMANN, PHONG
from brdftab.models._shared.facets.ndf import density, opposite_norm
from brdftab.models._shared.fresnel.fresnel import multiply_chain, multiply_long_chain
from brdftab.models._shared.fresnel.logfresnel import add_products, power_sums, spread_sums
from brdftab.models._shared.grooves.groove2d import beam_even, beam_odd
from brdftab.models._shared.grooves.tail import tail_node, tail_panel, tail_panels, tail_power
from brdftab.models.vgroove_nonsym.panels import BROAD, left_tilt, panel_edges

PI = math.pi
HALF_PI = 0.5 * math.pi
NODES = 1024


@kernel
def order_end(family, big_m, small_m):
    """Return the order from which on a family (0 even A, 1 odd A, 2 even B, 3 odd B) is empty."""
    d = 0.5 * (big_m - small_m)
    th = 0.5 * (big_m + small_m)
    behind = max(-small_m, 0.0)
    if family == 0:
        return (PI + 2.0 * d) / (big_m + behind + 1e-300)
    if family == 2:
        return (PI - 2.0 * d) / (th + 1e-300)
    if family == 1:
        return 1.0 + (PI - 2.0 * d) / (big_m + 1e-300)
    return 1.0 + (PI - 2.0 * behind - 2.0 * th) / (max(behind, d) + 1e-300)


@kernel
def _facets(ndf, shape, sl, cl, sr, cr, shift):
    """Return D(l) D(r), for Beckmann times exp(shift) so that its deep tails survive in a logarithm."""
    if ndf == BECKMANN:
        ia2 = 1.0 / (shape * shape)
        c = cl * cr
        tl, tr = sl / cl, sr / cr
        e = (tl * tl + tr * tr) * ia2 - shift
        if e > 700.0:
            return 0.0
        c2 = c * c
        scale = ia2 / (PI * c2)
        return math.exp(-e) * scale * scale
    return density(ndf, shape, cl, sl) * density(ndf, shape, cr, sr)


@kernel
def _wall(ndf, shape, is_first, is_last, start, end, l0, slope):
    """Tell whether a panel of a broad Phong lobe ends where the right (1) or left (2) facet is vertical, else 0."""
    if ndf != PHONG or shape > BROAD:
        return 0
    if is_last and end >= HALF_PI - 1e-12:
        return 1
    if is_first and l0 - slope * start >= HALF_PI - 1e-12:
        return 2
    return 0


@kernel
def _node(x, wall, start, width, l0, slope):
    """Return r and the sines and cosines of r and l at x in (0, 1) of a panel, x counted from a vertical facet."""
    if wall == 0:
        r = start + width * x
        left = l0 - slope * r
        return r, math.sin(r), math.cos(r), math.sin(left), math.cos(left)
    gap = width * x
    if wall == 1:
        r = HALF_PI - gap
        left = l0 - slope * r
        return r, math.cos(gap), math.sin(gap), math.sin(left), math.cos(left)
    r = start + gap
    gap *= slope
    return r, math.sin(r), math.cos(r), math.cos(gap), math.sin(gap)


@kernel
def _add_node(fresnel, big_l, r, t, k, exact, l0, slope, value, row, acc):
    """Add value * prod F at one tilt r to acc (W,)."""
    kind, a, b, table = fresnel
    if kind == MIRROR:
        acc[0] += value
        return
    left = l0 - slope * r
    step = PI - left - r
    first = HALF_PI - left - t
    product = row[0]
    for w in range(product.size):
        product[w] = value
    if exact:
        multiply_chain(kind, a, b, table, big_l, first, step, int(k + 0.5), product)
    else:
        low = first - 0.5 * step
        multiply_long_chain(kind, a, b, table, big_l, low, low + k * step, k, product, row[1])
    for w in range(product.size):
        acc[w] += product[w]


@kernel
def _add_series(series, pair_from, nodes, count, mass, t, k, exact, l0, slope, acc):
    """Add collected nodes (r, value) to acc (W, Q) through the polynomial of log F; high orders by two nodes."""
    coefficients, powers, sums, scratch = series
    if k >= pair_from and count > 2:
        mean = 0.0
        for n in range(count):
            mean += nodes[n, 0] * nodes[n, 1]
        mean /= mass
        m2, m3 = 0.0, 0.0
        for n in range(count):
            x = nodes[n, 0] - mean
            m2 += x * x * nodes[n, 1]
            m3 += x * x * x * nodes[n, 1]
        sigma = math.sqrt(m2 / mass) + 1e-300
        skew = m3 / mass / (sigma * sigma * sigma)
        root = math.sqrt(skew * skew + 4.0)
        low, high = 0.5 * (skew - root), 0.5 * (skew + root)
        nodes[0, 0], nodes[0, 1] = mean + sigma * low, mass * high / root
        nodes[1, 0], nodes[1, 1] = mean + sigma * high, -mass * low / root
        count = 2
    for n in range(count):
        r = nodes[n, 0]
        left = l0 - slope * r
        step = PI - left - r
        first = HALF_PI - left - t
        if exact:
            power_sums(first, step, int(k + 0.5), sums)
        else:
            spread_sums(first - 0.5 * step, step, k, sums)
        add_products(nodes[n, 1], sums, coefficients, powers, scratch, acc)


@kernel
def add_order(t, u, k, odd, exact, weight, ndf, shape, shift, rule, fresnel, big_l, series, work, acc):
    """Add weight times one order on one side to acc; return the same with F = 1.

    Parameters
    ----------
    t, u : float
        Incoming and outgoing in-plane angle of the side, radians.
    k : float
        The order, real in the tail (then exact is False).
    rule : tuple
        Gauss nodes and weights (2, n), those of panels that end at a vertical facet, fine scale cuts or not, depth
        limit of `panel_edges`, and the order from which on a series sees the reflectance at the two nodes that keep
        three moments of the tilt.
    big_l : float
        Projected length L at which the reflectance is applied; acc is (1, W) then.
    series : tuple
        Polynomial of log F, powers of several lengths, scratch; if not empty acc is (W, Q) for all Q lengths.
    work : tuple of ndarray
        Scratch: cuts, edges, row, nodes.
    """
    gauss, wall_gauss, fine, depth_limit, pair_from = rule
    cuts, edges, row, nodes = work
    use_series = series[0].shape[1] > 0
    count = panel_edges(t, u, k, odd, ndf, shape, fine, depth_limit, cuts, edges)
    if count == 0:
        return 0.0
    l0, slope = left_tilt(t, u, k, odd)
    st, ct, su, cu = math.sin(t), math.cos(t), math.sin(u), math.cos(u)
    swap = u > t
    # J = k/2 for even, (k + 1)/2 for odd orders
    front = weight * opposite_norm(ndf, shape) * 2.0 / (k + (1.0 if odd else 0.0))
    total = 0.0
    found = 0
    for e in range(count - 1):
        width = edges[e + 1] - edges[e]
        if width <= 1e-15:
            continue
        wall = _wall(ndf, shape, e == 0, e == count - 2, edges[e], edges[e + 1], l0, slope)
        for q in range(gauss.shape[1]):
            at, part = gauss[0, q], gauss[1, q]
            if wall != 0:
                at, part = wall_gauss[0, q], wall_gauss[1, q]
            r, sr, cr, sl, cl = _node(at, wall, edges[e], width, l0, slope)
            if sl <= 0.0 or cl <= 0.0 or cr <= 0.0:
                continue
            if not odd:
                beam = beam_even(sl, cl, sr, cr, st, ct, su, cu)
            elif swap:
                beam = beam_odd(sl, cl, sr, cr, su, cu, st, ct)
            else:
                beam = beam_odd(sl, cl, sr, cr, st, ct, su, cu)
            if beam <= 0.0:
                continue
            value = front * width * part * _facets(ndf, shape, sl, cl, sr, cr, shift) * sl * sr * beam
            if value <= 0.0:
                continue
            total += value
            if use_series:
                nodes[found, 0], nodes[found, 1] = r, value
                found += 1
            else:
                _add_node(fresnel, big_l, r, t, k, exact, l0, slope, value, row, acc[0])
    if found > 0:
        _add_series(series, pair_from, nodes, found, total, t, k, exact, l0, slope, acc)
    return total


@kernel
def _tail_edges(ndf, shape, family, big_m, small_m, low, high, edges):
    """Write the ends of the parts of the tail over x = 1/k in which terms are smooth and return their number + 1.

    With n < 0 facets near the vertical carry the terms, and the beam between one such and the other kinks in k.
    """
    edges[0] = low
    edges[1] = high
    if ndf != PHONG or shape >= 0.0:
        return 2
    d, th = 0.5 * (big_m - small_m), 0.5 * (big_m + small_m)
    # aperture left beside a vertical facet, times k for even and k + 1 for odd orders
    odd = (family & 1) == 1
    whole = PI + (2.0 if family < 2 else -2.0) * (th if odd else d)
    more, less = math.sin(big_m) + math.sin(small_m), math.sin(big_m) - math.sin(small_m)
    cos_big, cos_small = math.cos(big_m), math.cos(small_m)
    gaps = (
        big_m,
        th,
        d,
        math.atan2(more, cos_big),
        math.atan2(more, cos_small),
        math.atan2(less, cos_big),
        math.atan2(less, cos_small),
    )
    count = 2
    for gap in gaps:
        x = gap / (whole - gap) if odd else gap / whole
        if low < x < high:
            edges[count] = x
            count += 1
    edges[:count].sort()
    return count


@kernel
def add_bounces(big_m, small_m, ndf, shape, shift, k_explicit, k_cap, tail, rule, fresnel, big_l, series, work, acc):
    """Add every order k >= 2 up to the cap to acc (P, ...) and return their sum for F = 1.

    Orders up to the second of k_explicit are summed one by one, up to the first bounce by bounce; beyond, half the
    integral over k by `tail` (2, n) nodes in 1/k.
    Order k goes to layer min(k, P) - 1. Parameters as in `add_order`.
    """
    k_exact, k_single = k_explicit
    power = tail_power(ndf, shape)
    layers, nodes = acc.shape[0], tail.shape[1]
    ends = np.empty(9)
    total = 0.0
    for family in range(4):
        odd = (family & 1) == 1
        sign = 1.0 if family < 2 else -1.0
        t, u = sign * big_m, sign * small_m
        end = order_end(family, big_m, small_m)
        k = 3 if odd else 2
        while k < end and k <= k_single and k <= k_cap:
            part = add_order(
                t,
                u,
                float(k),
                odd,
                k <= k_exact,
                1.0,
                ndf,
                shape,
                shift,
                rule,
                fresnel,
                big_l,
                series,
                work,
                acc[min(k, layers) - 1],
            )
            total += part
            k += 2
            if part == 0.0 and ndf == BECKMANN and k > 8:
                break
        if k <= k_single or k >= end or k > k_cap:
            continue
        x0 = 1.0 / min(end, k_cap + 1.0 - (k_cap - k) % 2)
        x1 = 1.0 / (k - 1.0)
        count = _tail_edges(ndf, shape, family, big_m, small_m, x0, x1, ends)
        for e in range(count - 1):
            panels = tail_panels(power, ends[e], ends[e + 1])
            for n in range(panels * nodes):
                low, high = tail_panel(n // nodes, panels, ends[e], ends[e + 1])
                x, dx = tail_node(power, low, high, tail[0, n % nodes])
                total += add_order(
                    t,
                    u,
                    1.0 / x,
                    odd,
                    False,
                    0.5 * dx * tail[1, n % nodes] / (x * x),
                    ndf,
                    shape,
                    shift,
                    rule,
                    fresnel,
                    big_l,
                    series,
                    work,
                    acc[layers - 1],
                )
    return total
