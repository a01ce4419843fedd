"""Residuals and normal equations of a sum of models, accumulated over chunks of directions.

A chunk's Jacobian and residual are summed at once into the Gram matrix of [J r], so that memory does not grow with
the number of points. Its Cholesky factor R stands for the whole problem: R[:, -1] as residual and R[:, :-1] as Jacobian
have the same cost, gradient and J^T J. The costly part of a model that its channels share goes through its loops once a
chunk, with one tangent for each shared parameter that it depends on. What no single direction enters (``prepare`` of a
twin) is computed once a pass, for every channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from brdftab.fit.losses import OFFSETS, curvature, soft_l1, transform
from brdftab.fit.program import Problem
from brdftab.models import twin
from brdftab.models._shared.twin.frame import Directions, directions
from brdftab.models._shared.twin.static import WEIGHTS
from brdftab.models.protocols import HasPreparation
from brdftab.models.twins import prepared
from brdftab.typing import Array

CHUNK = 1024


class Scales(NamedTuple):
    """Numbers of the loss: where soft-L1 turns linear, and what the log loss adds on both sides (1/sr)."""

    robust: Any = 1.0
    floor: Any = OFFSETS["log"]


class Data(NamedTuple):
    """One chunk: directions (CHUNK,); transformed data, weights and marks of saturation (C, CHUNK)."""

    d: Directions
    target: Any
    weight: Any
    saturated: Any


# rows of a packed chunk before the data: what cannot be had from the others without a loss of digits
ROWS = ("si", "ci", "so", "co", "hx", "hy", "ox", "cos_o", "sin_o")


def unpack(rows: Any) -> Data:
    """Return the parts of one packed chunk (rows, CHUNK); angles are computed where a model asks for them."""
    first = len(ROWS)
    channels = (rows.shape[0] - first) // 2
    p = dict(zip(ROWS, rows[:first], strict=True))
    zero = jnp.zeros_like(rows[0])
    angles = (jnp.arctan2(p["si"], p["ci"]), jnp.arctan2(p["so"], p["co"]), jnp.arctan2(p["sin_o"], p["cos_o"]), zero)
    azimuths = (zero + 1.0, zero, p["cos_o"], p["sin_o"])
    d = Directions._make([*angles, *(p[name] for name in ROWS[:7]), *azimuths])
    # a negative weight marks a saturated value
    signed = rows[first + channels :]
    return Data(d, rows[first : first + channels], jnp.abs(signed), signed < 0.0)


def pack(
    theta_i: Array, theta_o: Array, phi: Array, target: Array, weight: Array, saturated: NDArray[np.bool_], chunks: int
) -> Array:
    """Pack N directions and (N, C) data into one array (chunks, rows, CHUNK); what is left over has weight 0."""
    count, channels = theta_i.size, target.shape[1]
    d = directions(theta_i, theta_o, phi, np.zeros(count))._asdict()
    signed = np.where(saturated, -weight, weight)
    packed = np.zeros((chunks, len(ROWS) + 2 * channels, CHUNK))
    columns = [*(d[name] for name in ROWS), *target.T, *signed.T]
    spare = directions(0.5, 0.7, 1.0, 0.0)._asdict()
    padding = [*(spare[name][0] for name in ROWS), *[0.0] * (2 * channels)]
    whole = count // CHUNK
    for n, (column, fill) in enumerate(zip(columns, padding, strict=True)):
        packed[:whole, n] = column[: whole * CHUNK].reshape(whole, CHUNK)
        rest = count - whole * CHUNK
        if whole < chunks:
            packed[whole:, n] = fill
            packed[whole, n, :rest] = column[whole * CHUNK :]
    return packed


def _parameters(made: Problem, shared: Any, own: Any, fixed: Any, rules: Any) -> list[dict[str, Any]]:
    """Return the twins' parameters of one channel."""
    found = [{**term, **rule} for term, rule in zip(fixed, rules, strict=True)]
    entries = [(s, shared[n]) for n, s in enumerate(made.shared)] + [(s, own[n]) for n, s in enumerate(made.own)]
    for slot, x in entries:
        value = jnp.exp(x) if slot.log else x
        if slot.as_index:
            root = jnp.sqrt(value)
            value = (1.0 + root) / (1.0 - root)
        for name in slot.names:
            if name in found[slot.term]:
                found[slot.term][name] = value
    return found


def _shapes(made: Problem, params: Sequence[dict[str, Any]], d: Directions) -> tuple[Any, ...]:
    return tuple(twin(s.model).shapes(s, p, d) for s, p in zip(made.statics, params, strict=True))


def _value(made: Problem, params: Sequence[dict[str, Any]], shapes: Any, d: Directions) -> Any:
    """Return the sum of the models in one channel, (N,) in 1/sr."""
    total = 0.0
    for static, p, shape in zip(made.statics, params, shapes, strict=True):
        value = twin(static.model).value
        if WEIGHTS in p:
            rest = {k: v for k, v in p.items() if k not in ("a", "b", WEIGHTS)}
            waves = jax.vmap(lambda a, b, s=static, r=rest, h=shape, v=value: v(s, {**r, "a": a, "b": b}, h, d))
            total = total + p[WEIGHTS] @ waves(p["a"], p["b"])
        else:
            total = total + value(static, p, shape, d)
    return total


def _solved(made: Problem, shared: Any, own: Any, fixed: Any) -> tuple[Any, ...]:
    """Return what each term prepares, arrays with a leading axis of channels; nothing for terms that do not."""
    numbers, rules = fixed
    found: list[Any] = []
    for at, static in enumerate(made.statics):
        if not isinstance(twin(static.model), HasPreparation):
            found.append({})
            continue

        def one(mine: Any, kept: Any, at: int = at, **optics: Any) -> Any:
            p = _parameters(made, shared, mine, kept, rules)[at]
            return prepared(made.statics[at], {**p, **optics})

        term = numbers[at]
        if WEIGHTS not in term:
            found.append(jax.vmap(one)(own, numbers))
            continue
        # channels have their wavelengths in common; what is prepared is linear in the light that it stands for
        first = jax.tree.map(lambda v: v[0], numbers)
        waves = jax.vmap(lambda a, b, one=one, first=first: one(own[0], first, a=a, b=b))(term["a"][0], term["b"][0])
        share = term[WEIGHTS] / jnp.sum(term[WEIGHTS], 1, keepdims=True)
        found.append(jax.tree.map(lambda v, share=share: jnp.tensordot(share, v, 1), waves))
    return tuple(found)


def _pushed(made: Problem, x: Any, fixed: Any) -> tuple[Any, Any]:
    """Return `_solved` and its tangents, one for each entry of a channel, on an axis after that of the channels."""
    ns, no = len(made.shared), len(made.own)
    own = x[ns:].reshape(-1, no) if no else jnp.zeros((next(iter(fixed[0][0].values())).shape[0], 0))
    slots = enumerate(made.shared + made.own)
    entries = [n for n, s in slots if isinstance(twin(made.statics[s.term].model), HasPreparation)]
    if not entries:
        found = _solved(made, x[:ns], own, fixed)
        return found, jax.tree.map(lambda v: jnp.zeros((v.shape[0], ns + no, *v.shape[1:])), found)
    rows = np.array(entries)
    steps = jnp.eye(ns + no)

    def push(t: Any) -> Any:
        # every channel depends on its own entries alone
        step = (t[:ns], jnp.broadcast_to(t[ns:], own.shape))
        return jax.jvp(lambda u, v: _solved(made, u, v, fixed), (x[:ns], own), step)

    found, moved = jax.vmap(push, out_axes=(None, 0))(steps[rows])
    return found, jax.tree.map(lambda m: jnp.moveaxis(jnp.tensordot(steps[:, rows], m, 1), 0, 1), moved)


def _joined(params: Sequence[dict[str, Any]], solved: Sequence[Any]) -> list[dict[str, Any]]:
    """Return the parameters of each term with what it has prepared."""
    return [{**p, **s} for p, s in zip(params, solved, strict=True)]


def values(made: Problem, x: Any, fixed: Any, d: Directions) -> Any:
    """Return the fitted sum (C, N) in 1/sr at packed directions (N,)."""
    ns = len(made.shared)
    numbers, rules = fixed
    channels = next(iter(numbers[0].values())).shape[0]
    own = x[ns:].reshape(channels, len(made.own))
    first = jax.tree.map(lambda v: v[0], numbers)
    base = _shapes(made, _parameters(made, x[:ns], own[0], first, rules), d) if made.common else None

    def one(mine: Any, kept: Any, solved: Any) -> Any:
        params = _joined(_parameters(made, x[:ns], mine, kept, rules), solved)
        return _value(made, params, _shapes(made, params, d) if base is None else base, d)

    return jax.vmap(one)(own, numbers, _solved(made, x[:ns], own, fixed))


def _residual(made: Problem, f: Any, chunk: Any, scale: Scales) -> tuple[Any, Any]:
    """Return the (robust) residual of one channel (N,), and the weight of its square in the covariance's bread."""
    target, weight, saturated, cosine = chunk
    r = (transform(made.loss, f, cosine, scale.floor) - target) * weight
    # a saturated value says only that the truth is not lower
    r = jnp.where(saturated, jnp.minimum(r, 0.0), r)
    if not made.robust:
        return r, r
    return soft_l1(r, scale.robust), r


def _chunk(made: Problem, x: Any, fixed: Any, solved: Any, scale: Scales, chunk: Data) -> tuple[Any, Any, Any]:
    """Return J (C, m, N), the residual and the plain residual (C, N) of one chunk; m = shared and own entries.

    `solved` comes from `_pushed`.
    """
    ns, no = len(made.shared), len(made.own)
    channels = chunk.target.shape[0]
    shared, own = x[:ns], x[ns:].reshape(channels, no)
    numbers, rules = fixed
    first = jax.tree.map(lambda v: v[0], numbers)

    def shape_of(u: Any, mine: Any, kept: Any) -> Any:
        return _shapes(made, _parameters(made, u, mine, kept, rules), chunk.d)

    steps = jnp.eye(ns + no)
    if made.common:
        if made.moving:
            rows = np.array(made.moving)

            def push(t: Any) -> Any:
                return jax.jvp(lambda u: shape_of(u, own[0], first), (shared,), (t,))

            base, moved = jax.vmap(push, out_axes=(None, 0))(steps[rows][:, :ns])
            tangents = jax.tree.map(lambda m: jnp.tensordot(steps[:, rows], m, 1), moved)
        else:
            base = shape_of(shared, own[0], first)
            tangents = jax.tree.map(lambda v: jnp.zeros((ns + no, *v.shape), v.dtype), base)

    def channel(mine: Any, kept: Any, data: Any, ready: Any, steered: Any) -> Any:
        def f(u: Any, v: Any, own_solved: Any, shapes: Any) -> Any:
            params = _joined(_parameters(made, u, v, kept, rules), own_solved)
            found = _value(made, params, shapes if shapes is not None else _shapes(made, params, chunk.d), chunk.d)
            return _residual(made, found, (*data, chunk.d.ci), scale)

        if made.common:
            with_shapes = jax.vmap(
                lambda t, z, s: jax.jvp(f, (shared, mine, ready, base), (t[:ns], t[ns:], z, s)), out_axes=(None, 0)
            )
            (r, plain), (dr, _) = with_shapes(steps, steered, tangents)
        else:
            whole = jax.vmap(
                lambda t, z: jax.jvp(lambda u, v, w: f(u, v, w, None), (shared, mine, ready), (t[:ns], t[ns:], z)),
                out_axes=(None, 0),
            )
            (r, plain), (dr, _) = whole(steps, steered)
        return dr, r, plain

    return jax.vmap(channel)(own, numbers, (chunk.target, chunk.weight, chunk.saturated), *solved)


class Sums(NamedTuple):
    """What a pass over the data leaves: Gram matrix of [J r], and bread and meat of the sandwich covariance."""

    gram: Any
    bread: Any
    meat: Any


@partial(jax.jit, static_argnums=0)
def sums(made: Problem, x: Any, fixed: Any, scale: Scales, data: Any, used: Any) -> Sums:
    """Return the sums over the first `used` chunks (a traced number: one compilation serves subset and whole)."""
    ns, no = len(made.shared), len(made.own)
    channels = (data.shape[1] - len(ROWS)) // 2
    size = ns + channels * no
    # where the entries of each channel's block go in the whole
    place = np.zeros((channels, ns + no + 1, size + 1))
    for c in range(channels):
        to = [*range(ns), *range(ns + c * no, ns + (c + 1) * no), size]
        place[c, np.arange(ns + no + 1), to] = 1.0

    solved = _pushed(made, x, fixed)

    def step(n: Any, kept: Any) -> Any:
        rows = jax.lax.dynamic_index_in_dim(data, n, 0, keepdims=False)
        jac, r, plain = _chunk(made, x, fixed, solved, scale, unpack(rows))
        both = jnp.concatenate([jac, r[:, None]], 1)
        blocks = jnp.einsum("can,cbn->cab", both, both)
        bread = blocks[:, :-1, :-1]
        if made.robust:
            # the slope of the robust residual is undone before the curvature of its loss is put in
            weight = curvature(plain, scale.robust) / _slope(plain, scale.robust) ** 2
            bread = jnp.einsum("can,cn,cbn->cab", jac, weight, jac)
        # one direction is one cluster: noise that its channels share does not average out
        pull = jac * r[:, None]
        score = jnp.concatenate([pull[:, :ns].sum(0), pull[:, ns:].reshape(channels * no, pull.shape[-1])], 0)
        return kept[0] + blocks, kept[1] + bread, kept[2] + score @ score.T

    m = ns + no
    start = (jnp.zeros((channels, m + 1, m + 1)), jnp.zeros((channels, m, m)), jnp.zeros((size, size)))
    blocks, bread, meat = jax.lax.fori_loop(0, used, step, start)
    less = place[:, :-1, :-1]
    whole = jnp.einsum("cas,cab,cbt->st", place, blocks, place)
    return Sums(whole, jnp.einsum("cas,cab,cbt->st", less, bread, less), meat)


def _slope(r: Any, scale: Any) -> Any:
    """Return d soft_l1 / d r."""
    return jax.jvp(lambda q: soft_l1(q, scale), (r,), (jnp.ones_like(r),))[1]


def compress(gram: Any) -> tuple[Any, Any]:
    """Return residual (m + 1,) and Jacobian (m + 1, m) with the same cost, gradient and J^T J as the whole data."""
    d = jnp.where(jnp.diag(gram) > 0.0, jnp.sqrt(jnp.diag(gram)), 1.0)
    n = gram.shape[0]
    # above the rounding of sums over 1e5 directions: residuals that J explains wholly make the matrix singular
    lower = jnp.linalg.cholesky(gram / d / d[:, None] + 1e-12 * jnp.eye(n))
    root = lower.T * d
    return root[:, -1], root[:, :-1]


@partial(jax.jit, static_argnums=0)
def predict(made: Problem, x: Any, fixed: Any, d: Directions) -> Any:
    """Return the fitted sum (C, N) in 1/sr at packed directions (N,)."""
    return values(made, x, fixed, d)
