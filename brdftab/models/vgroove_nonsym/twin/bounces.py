"""Orders two and above of the nonsymmetric groove in JAX by panel quadrature, with the nodes of `bounces`.

Orders, panels and bounces are loops; arrays hold the nodes of one panel for one tile of points. Tilts and beams depend
on directions alone: derivatives enter through the distribution and the reflectance.
"""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp
from jax import Array, lax

from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.twin.chains import CHAIN_SAMPLES, multiply_chain
from brdftab.models._shared.twin.groove2d import beam_even, beam_odd
from brdftab.models._shared.twin.ndf import BECKMANN, PHONG, density, opposite_norm
from brdftab.models._shared.twin.static import Static
from brdftab.models._shared.twin.tail import tail_node, tail_panels, tail_power
from brdftab.models._shared.twin.tiles import by_tiles, ranking
from brdftab.models.vgroove_nonsym.panels import BROAD
from brdftab.models.vgroove_nonsym.rules import HARDEST, MOST, rule
from brdftab.models.vgroove_nonsym.twin.panels import left_tilt, panel_edges
from brdftab.quadrature import gauss

PI = math.pi
HALF_PI = 0.5 * math.pi
DEPTH = 45.0
NO_CAP = 2_000_000_000
TILE = 64
Tile = dict[str, Array]


def _unit_gauss(count: int) -> tuple[Array, Array]:
    x, w = gauss(count)
    return jnp.asarray(0.5 * (1.0 + x)), jnp.asarray(0.5 * w)


def families(plane: tuple[Array, ...]) -> Tile:
    """Return in-plane angles and end of the sum of both parities and sides, (4, N): even A, even B, odd A, odd B."""
    st, ct, su, cu = plane[4:]
    t, u = jnp.arctan2(st, ct), jnp.arctan2(su, cu)
    big, small = jnp.maximum(t, u), jnp.minimum(t, u)
    d, th = 0.5 * (big - small), 0.5 * (big + small)
    behind = jnp.maximum(-small, 0.0)
    ends = (
        (PI + 2.0 * d) / (big + behind + 1e-300),
        (PI - 2.0 * d) / (th + 1e-300),
        1.0 + (PI - 2.0 * d) / (big + 1e-300),
        1.0 + (PI - 2.0 * behind - 2.0 * th) / (jnp.maximum(behind, d) + 1e-300),
    )
    return {
        "t": jnp.stack([big, -big, big, -big]),
        "u": jnp.stack([small, -small, small, -small]),
        "end": jnp.stack(ends),
    }


def rankings(plane: tuple[Array, ...]) -> tuple[Array, ...]:
    """Return for each family the points' order by falling length of the sum, four arrays (N,) of whole floats."""
    return tuple(ranking(end) for end in families(plane)["end"])


def bounces(
    static: Static, a: Array | None, b: Array | None, shape: Array, plane: tuple[Array, ...], ranks: Any
) -> Array:
    """Return the sum over k >= 2 of int P(r) D(l) sin^2(l) w prod F/J dr, (N,), D without the factor of `shape_at`.

    Parameters
    ----------
    a, b : Array () or None
        Reflectance.
    shape : Array (N,)
        Shape number of the distribution at the groove's azimuth.
    plane : tuple of Array (N,)
        From `groove_plane`.
    ranks : sequence of 4 Array (N,)
        From `rankings`.
    """
    sin_h, cos_h, _, big_l = plane[:4]
    still = lax.stop_gradient(shape)
    depth = jnp.full_like(sin_h, DEPTH)
    if static.ndf == BECKMANN:
        depth += (sin_h / (cos_h * still)) ** 2
    elif static.ndf == PHONG:
        depth -= still * jnp.log(cos_h)
    common = {"shape": shape, "big_l": big_l, "depth": depth}
    rows, total = families(plane), jnp.zeros_like(shape)
    nodes = rule(static.tolerance, static.rough)[2]
    # Phong has one exponent for all points
    walls = unit_jacobi(nodes, jnp.minimum(shape[0], BROAD)) if static.ndf == PHONG else _unit_gauss(nodes)
    for odd in (False, True):

        def side(total: Array, inputs: Any, odd: bool = odd) -> tuple[Array, None]:
            row, rank = inputs
            part = by_tiles(lambda tile: _orders(static, a, b, odd, tile, walls), rank, {**row, **common}, TILE)
            return total + part, None

        pick = slice(2, 4) if odd else slice(0, 2)
        here = {name: row[pick] for name, row in rows.items()}
        total = lax.scan(side, total, (here, jnp.stack(ranks[pick])))[0]
    return total


def _orders(static: Static, a: Any, b: Any, odd: bool, tile: Tile, walls: Any) -> Array:
    """Return all orders of one parity and side for a tile of points, (T,): one by one, then the tail in 1/k."""
    k_exact, nodes, _, _ = rule(static.tolerance, static.rough)
    cap = NO_CAP if static.max_bounces is None else static.max_bounces
    first = 3 if odd else 2
    k_explicit = _explicit(static, k_exact, tile["shape"])
    singles = jnp.maximum((jnp.minimum(k_explicit, cap) - first) // 2 + 1, 0)
    k_next = first + 2 * singles
    end, ndf = tile["end"], static.ndf
    far = (k_next < end) & (k_next <= cap) & (k_next > k_explicit)
    low = 1.0 / jnp.where(far, jnp.minimum(end, cap + 1.0 - (cap - k_next) % 2), k_next)
    high = jnp.full_like(low, 1.0 / (k_next - 1.0))
    power = tail_power(ndf, tile["shape"])
    edges = _tail_edges(ndf, odd, tile, low, high)
    starts, stops = edges[:-1], edges[1:]
    panels = jnp.where(stops > starts, tail_panels(power, starts, stops), 0.0)
    until = jnp.where(far, jnp.cumsum(panels, axis=0), 0.0)
    places, weights = _unit_gauss(nodes)

    def going(state: tuple[Array, Array, Array]) -> Array:
        number, alive, _ = state
        single = (number < singles) & jnp.any(alive & (first + 2 * number < end))
        return single | ((number < singles + nodes * jnp.max(until[-1])) & jnp.any(far & alive))

    def term(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        number, alive, total = state
        single = number < singles
        panel, at = jnp.maximum(number - singles, 0) // nodes, jnp.maximum(number - singles, 0) % nodes
        part_of = jnp.minimum(jnp.sum(until <= panel, axis=0), len(panels) - 1)[None]
        start, stop, many, last = (jnp.take_along_axis(v, part_of, 0)[0] for v in (starts, stops, panels, until))
        behind = far & (panel < until[-1])
        start, stop = jnp.where(behind, start, 0.5 * high), jnp.where(behind, stop, high)
        x, dx = tail_node(ndf, power, many, panel - last + many, start, stop, places[at])
        whole = 1.0 * (first + 2 * number)
        exact = single & (whole <= k_exact)
        k = jnp.where(single, whole, 1.0 / x)
        weight = jnp.where(single, 1.0, 0.5 * dx * weights[at] / (x * x))
        live = alive & jnp.where(single, whole < end, behind)
        bare, part = _order(static, a, b, odd, k, exact, live, tile, walls)
        total = total + jnp.where(live, weight * part, 0.0)
        if ndf == BECKMANN:
            # orders further on are fainter still
            alive = alive & ~(exact & (bare == 0.0) & (whole > 6.0) & (whole + 2.0 <= k_explicit))
        return number + 1, alive, total

    start = (jnp.array(0), jnp.ones(end.shape, bool), jnp.zeros_like(end))
    return lax.while_loop(going, term, start)[2]


def _explicit(static: Static, orders: int, shape: Array) -> Array:
    """Return how many orders are summed one by one; `rules.steep_orders` as Phong's one exponent varies."""
    if static.ndf != PHONG:
        return jnp.array(orders)
    exponent = lax.stop_gradient(shape[0])
    power = 1.0 / (2.0 * jnp.minimum(exponent, 0.0) + 4.0)
    steep = jnp.ceil(jnp.minimum((HARDEST / max(static.tolerance, 1e-12)) ** power, MOST)).astype(int)
    return jnp.where(exponent < 0.0, jnp.maximum(orders, steep), orders)


def _tail_edges(ndf: int, odd: bool, tile: Tile, low: Array, high: Array) -> Array:
    """Return the ends (E, T) of the parts of the tail in which terms are smooth, in order; see `bounces`."""
    if ndf != PHONG:
        return jnp.stack([low, high])
    t, u = tile["t"], tile["u"]
    big, small = jnp.abs(t), jnp.where(t < 0.0, -u, u)
    d, th = 0.5 * (big - small), 0.5 * (big + small)
    whole = PI + ((t + u) if odd else (t - u))
    more, less = jnp.sin(big) + jnp.sin(small), jnp.sin(big) - jnp.sin(small)
    gaps = [big, th, d, *(jnp.arctan2(v, jnp.cos(w)) for v in (more, less) for w in (big, small))]
    cuts = [gap / jnp.where(whole > gap, whole - gap, 1.0) if odd else gap / whole for gap in gaps]
    steep = lax.stop_gradient(tile["shape"]) < 0.0
    cuts = [jnp.where(steep & (low < x) & (x < high), x, high) for x in cuts]
    return jnp.sort(jnp.stack([low, *cuts, high]), axis=0)


def _order(
    static: Static, a: Any, b: Any, odd: bool, k: Array, exact: Array, live: Array, tile: Tile, walls: Any
) -> tuple[Array, Array]:
    """Return one order on one side for F = 1 and with reflectance, (T,); k is real where not `exact` (a scalar)."""
    ndf, shape, t, u = static.ndf, tile["shape"], tile["t"], tile["u"]
    k = jnp.where(live, k, 3.0 if odd else 2.0)
    _, _, nodes, fine = rule(static.tolerance, static.rough)
    places, weights = (x[:, None] for x in _unit_gauss(nodes))
    edges, count = panel_edges(t, u, k, odd, ndf, lax.stop_gradient(shape), fine, tile["depth"])
    count = jnp.where(live, count, 0)
    l0, slope = left_tilt(t, u, k, odd)
    sides: tuple[Array, ...] = (jnp.sin(t), jnp.cos(t), jnp.sin(u), jnp.cos(u))
    if odd:
        swap = u > t
        sides = tuple(jnp.where(swap, x, y) for x, y in zip((*sides[2:], *sides[:2]), sides, strict=True))
    # J = k/2 for even, (k + 1)/2 for odd orders
    front = opposite_norm(ndf, shape) * 2.0 / (k + (1.0 if odd else 0.0))

    def panel(e: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        bare, total = state
        start, stop = edges[e], edges[e + 1]
        width = stop - start
        wall = _wall(ndf, shape, (start, stop), (e == 0, e == count - 1), (l0, slope))
        r, sr, cr, sl, cl = _tilts(ndf, places, walls[0][:, None], start, stop, l0, slope, wall)
        part = jnp.where(wall[0] | wall[1], walls[1][:, None], weights)
        beam = beam_odd(sl, cl, sr, cr, *sides) if odd else beam_even(sl, cl, sr, cr, *sides)
        lit = (e < count) & (width > 1e-15) & (sl > 0.0) & (cl > 0.0) & (cr > 0.0) & (beam > 0.0)
        facets = _facets(ndf, shape, sl, jnp.where(lit, cl, 1.0), sr, jnp.where(lit, cr, 1.0))
        value = jnp.where(lit, front * width * part * facets * sl * sr * beam, 0.0)
        bare = bare + jnp.sum(value, axis=0)
        if static.fresnel == MIRROR:
            return bare, bare
        value = value * _reflect(static.fresnel, a, b, tile["big_l"], l0 - slope * r, r, t, k, exact)
        return bare, total + jnp.sum(value, axis=0)

    return lax.fori_loop(0, jnp.max(count), panel, (jnp.zeros_like(front), jnp.zeros_like(front)))


def _tilts(
    ndf: int, x: Array, x_wall: Array, start: Array, stop: Array, l0: Array, slope: Array, wall: tuple[Array, Array]
) -> tuple[Array, ...]:
    """Return r and the sines and cosines of r and l at x in (0, 1) of a panel, (Q, T), x_wall from a vertical facet."""
    width = stop - start
    r = start + width * x
    left = l0 - slope * r
    plain = r, jnp.sin(r), jnp.cos(r), jnp.sin(left), jnp.cos(left)
    if ndf != PHONG:
        return plain
    right, left_wall = wall
    gap = width * x_wall
    r_wall = jnp.where(right, HALF_PI - gap, start + gap)
    left = l0 - slope * r_wall
    steep = jnp.where(right, gap, slope * gap)
    sg, cg = jnp.sin(steep), jnp.cos(steep)
    walls = (
        r_wall,
        jnp.where(right, cg, jnp.sin(r_wall)),
        jnp.where(right, sg, jnp.cos(r_wall)),
        jnp.where(right, jnp.sin(left), cg),
        jnp.where(right, jnp.cos(left), sg),
    )
    return tuple(jnp.where(right | left_wall, w, y) for w, y in zip(walls, plain, strict=True))


def _wall(ndf: int, shape: Array, edges: tuple[Array, Array], ends: tuple[Any, Any], tilt: Any) -> tuple[Array, Array]:
    """Tell where a panel ends at a vertical right facet and where at a left one; see `bounces`."""
    (start, stop), (first, last), (l0, slope) = edges, ends, tilt
    broad = (ndf == PHONG) & (lax.stop_gradient(shape) <= BROAD)
    right = broad & last & (stop >= HALF_PI - 1e-12)
    return right, broad & ~right & first & (l0 - slope * start >= HALF_PI - 1e-12)


def unit_jacobi(count: int, exponent: Array) -> tuple[Array, Array]:
    """Return nodes and weights (count,) on (0, 1) of `project.unit_jacobi`; derivatives pass through the nodes."""
    j = jnp.arange(1.0, count)
    total = 2.0 * j + exponent
    side = 2.0 * j * (j + exponent) / (total * jnp.sqrt((total + 1.0) * (total - 1.0)))
    middle = jnp.concatenate([(exponent / (exponent + 2.0))[None], exponent**2 / (total * (total + 2.0))])
    found, vectors = jnp.linalg.eigh(jnp.diag(middle) + jnp.diag(side, 1) + jnp.diag(side, -1))
    x = 0.5 * (1.0 + found)
    return x, vectors[0] ** 2 / (exponent + 1.0) * x**-exponent


def _facets(ndf: int, shape: Array, sl: Array, cl: Array, sr: Array, cr: Array) -> Array:
    """Return D(l) D(r); cosines are positive."""
    if ndf != BECKMANN:
        return density(ndf, shape, cl, sl) * density(ndf, shape, cr, sr)
    c2 = (cl * cr) ** 2
    tl, tr = sl / (cl * shape), sr / (cr * shape)
    e = tl * tl + tr * tr
    live = e <= 700.0
    scale = 1.0 / (shape * shape * PI * c2)
    return jnp.where(live, jnp.exp(-jnp.where(live, e, 0.0)) * scale * scale, 0.0)


def _reflect(kind: int, a: Any, b: Any, big_l: Array, left: Array, r: Array, t: Array, k: Array, exact: Array) -> Array:
    """Return the product over the bounces, (Q, T): every one, or (real k) 24 samples of the mean of their logarithm."""
    step = PI - left - r
    first = HALF_PI - left - t
    spread = k * step / CHAIN_SAMPLES
    start = jnp.where(exact, first, first - 0.5 * step + 0.5 * spread)
    count = jnp.where(exact, (jnp.max(k) + 0.5).astype(int), CHAIN_SAMPLES)
    product = multiply_chain(kind, a, b, big_l, start, jnp.where(exact, step, spread), count)
    return lax.cond(exact, lambda: product, lambda: product ** (k / CHAIN_SAMPLES))
