"""Orders two and above of the symmetric groove in JAX: the sum of `bounces`, term by term and with its tail.

Every loop runs over orders with arrays of one tile of points, a parity and side of the groove at a time. Where terms
end depends on directions alone (and, for the terms that are too faint to count, on roughness, without derivative).
"""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp
from jax import Array, lax

from brdftab.models._shared.twin.chains import chain, chain_nodes, gram_rules, long_chain
from brdftab.models._shared.twin.groove2d import beam_symmetric
from brdftab.models._shared.twin.ndf import BECKMANN, GGX, density
from brdftab.models._shared.twin.static import Static
from brdftab.models._shared.twin.tail import tail_node, tail_panels, tail_power
from brdftab.models._shared.twin.tiles import by_tiles, ranking
from brdftab.models.vgroove_sym.rules import rule
from brdftab.quadrature import gauss

PI = math.pi
DEPTH = 45.0
# Phong's faint terms: deep enough for the factor 1/sin(theta_h) next to the mirror direction
PHONG_DEPTH = 80.0
NO_CAP = 2_000_000_000


def families(plane: tuple[Array, ...]) -> dict[str, Array]:
    """Return the in-plane quantities of both parities and sides, each (4, N): even A, odd A, even B, odd B."""
    st, ct, su, cu = plane[4:]
    t, u = jnp.arctan2(st, ct), jnp.arctan2(su, cu)
    ahead = t >= u
    big, small = jnp.where(ahead, t, u), jnp.where(ahead, u, t)
    sin_big, cos_big = jnp.where(ahead, st, su), jnp.where(ahead, ct, cu)
    sin_small, cos_small = jnp.where(ahead, su, st), jnp.where(ahead, cu, ct)
    d, th = 0.5 * (big - small), 0.5 * (big + small)
    z = jnp.stack([d, th, -d, -th])
    sign = jnp.array([1.0, 1.0, -1.0, -1.0])[:, None]
    reach = 0.5 * PI + z
    limit = jnp.stack([big, big, th, d])
    # kinks of the beam in the tail: where y passes these angles
    kinks = jnp.minimum(big, jnp.abs(small)), jnp.maximum(big, limit)
    rows = {
        "z": z,
        "reach": reach,
        "end": reach / (limit + 1e-300),
        "theta": sign * big,
        "sin_t": sign * sin_big,
        "cos_t": cos_big,
        "sin_q": sign * sin_small * jnp.array([-1.0, 1.0, -1.0, 1.0])[:, None],
        "cos_q": cos_small,
        "opposite": sign * small * jnp.array([-1.0, 1.0, -1.0, 1.0])[:, None],
        "difference": jnp.stack([jnp.abs(th), d, jnp.abs(th), d]),
        "cos_mean": jnp.cos(jnp.stack([d, th, d, th])),
        "kink": kinks[0],
        "kink_high": kinks[1],
    }
    return {name: jnp.broadcast_to(row, z.shape) for name, row in rows.items()}


def _visible_end(static: Static, shape: Array, plane: tuple[Array, ...], rows: dict[str, Array]) -> Array:
    """Return from which (real) order on terms are empty or too faint to count, (4, N), without derivative."""
    end = rows["end"]
    if static.ndf == GGX:
        return end
    shape = lax.stop_gradient(shape)
    sin_h, cos_h = plane[:2]
    if static.ndf == BECKMANN:
        tangent = sin_h / (cos_h * shape)
        y_min = jnp.arctan(1.0 / (shape * jnp.sqrt(tangent * tangent + DEPTH)))
    else:
        sharp = shape > 0.0
        y_min = jnp.where(sharp, jnp.arcsin(cos_h * jnp.exp(-PHONG_DEPTH / jnp.where(sharp, shape, 1.0))), 0.0)
    return jnp.minimum(end, rows["reach"] / jnp.maximum(y_min, 1e-300))


def rankings(static: Static, shape: Array, plane: tuple[Array, ...]) -> tuple[Array, ...]:
    """Return for each family the points' order by falling length of the sum, four arrays (N,) of whole floats."""
    return tuple(ranking(end) for end in _visible_end(static, shape, plane, families(plane)))


def bounces(
    static: Static, a: Array | None, b: Array | None, shape: Array, plane: tuple[Array, ...], ranks: Any
) -> Array:
    """Return sum_k D w sin(tilt)/k prod F over k >= 2, (N,), D without the factor of `shape_at`.

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
    rows = families(plane)
    rows["seen"] = _visible_end(static, shape, plane, rows)

    def family(total: Array, inputs: Any) -> tuple[Array, None]:
        row, parity, rank = inputs
        points = {**row, "shape": shape, "big_l": plane[3]}
        part = by_tiles(lambda tile: _sum(static, a, b, parity, tile), rank, points)
        return total + part, None

    return lax.scan(family, jnp.zeros_like(shape), (rows, jnp.array([0, 1, 0, 1]), jnp.stack(ranks)))[0]


def _sum(static: Static, a: Any, b: Any, parity: Array, tile: dict[str, Array]) -> Array:
    """Return all orders of one family for a tile of points, (T,)."""
    k_explicit, _ = rule(static.tolerance, static.rough)
    cap = NO_CAP if static.max_bounces is None else static.max_bounces
    last = min(k_explicit, cap)
    nodes = chain_nodes(static.tolerance)
    rules = tuple(jnp.asarray(x) for x in gram_rules(last, nodes)) if 0 < nodes < last else ()

    def going(state: tuple[Array, Array]) -> Array:
        return (state[0] <= last) & jnp.any(state[0] < tile["seen"])

    def order(state: tuple[Array, Array]) -> tuple[Array, Array]:
        k, total = state
        y = tile["reach"] / k
        half = PI / (2.0 * k)
        s, c = jnp.sin(tile["z"] / k), jnp.cos(tile["z"] / k)
        # the kernel's own sum of angles: where cos y is small the last digits of the tilt decide
        sy = jnp.sin(half) * c + jnp.cos(half) * s
        cy = jnp.cos(half) * c - jnp.sin(half) * s
        beam = beam_symmetric(sy, cy, tile["sin_t"], tile["cos_t"], tile["sin_q"], tile["cos_q"])
        live = (k < tile["seen"]) & (beam > 0.0)
        term = density(static.ndf, tile["shape"], jnp.where(live, sy, 1.0), jnp.where(live, cy, 0.0))
        term = term * beam * cy / k
        term = term * chain(static.fresnel, a, b, tile["big_l"], y - tile["theta"], 2.0 * y, k, rules)
        return k + 2, total + jnp.where(live, term, 0.0)

    total = lax.while_loop(going, order, (2 + parity, jnp.zeros_like(tile["reach"])))[1]
    if cap <= k_explicit:
        return total
    return total + _tail(static, a, b, k_explicit + 2 - (k_explicit + parity) % 2, cap, tile)


def _tail(static: Static, a: Any, b: Any, k: Array, cap: int, tile: dict[str, Array]) -> Array:
    """Return the orders k, k + 2, ... up to the cap as half the integral over the order, in x = 1/order, (T,)."""
    live = (k < tile["seen"]) & (k <= cap)
    stop = jnp.minimum(tile["end"], cap + 1.0 - (cap - k) % 2)
    low, high = 1.0 / jnp.where(live, stop, k), jnp.broadcast_to(1.0 / (k - 1.0), stop.shape)
    cut = [jnp.clip(tile[name] / tile["reach"], low, high) for name in ("kink", "kink_high")]
    x0, x1 = jnp.stack([low, *cut]), jnp.stack([*cut, high])
    open_panel = live & (x1 - x0 > 1e-15)
    left, right = jnp.where(open_panel, x0, 0.5), jnp.where(open_panel, x1, 1.0)
    shape = tile["shape"]
    power = tail_power(static.ndf, shape)
    powers = jnp.stack([power, *[jnp.where(power == 0.0, 0.0, 1.0)] * 2])
    panels = tail_panels(powers, left, right)
    count = rule(static.tolerance, static.rough)[1]
    nodes, weights = (jnp.asarray(0.5 * v) for v in gauss(count))

    def going(state: tuple[Array, Array]) -> Array:
        return state[0] < count * jnp.max(jnp.where(open_panel, panels, 0.0))

    def node(state: tuple[Array, Array]) -> tuple[Array, Array]:
        number, total = state
        at = number % count
        x, dx = tail_node(static.ndf, powers, panels, 1.0 * (number // count), left, right, 0.5 + nodes[at])
        y = tile["reach"] * x
        s, c = jnp.sin(y), jnp.cos(y)
        # `beam_symmetric` without differences of numbers near 1: Phong lobes live on steps y that nearly vanish
        beam = jnp.minimum(
            s * jnp.minimum(tile["cos_t"], tile["cos_q"]), jnp.sin(y - tile["difference"]) * tile["cos_mean"]
        )
        beam = jnp.minimum(2.0 * beam, jnp.minimum(jnp.sin(y - tile["theta"]), jnp.sin(y - tile["opposite"])))
        lit = open_panel & (number // count < panels) & (beam > 0.0)
        # dk/2 = dx/(2 x^2) and the term's own 1/k = x
        term = density(static.ndf, shape, jnp.where(lit, s, 1.0), jnp.where(lit, c, 0.0))
        term = term * beam * c * (0.5 * weights[at] * dx / x)
        low_end, high_end = -tile["theta"], 2.0 * tile["reach"] - tile["theta"]
        term = term * long_chain(static.fresnel, a, b, tile["big_l"], low_end, high_end, 1.0 / x)
        return number + 1, total + jnp.sum(jnp.where(lit, term, 0.0), axis=0)

    return lax.while_loop(going, node, (jnp.array(0), jnp.zeros_like(low)))[1]
