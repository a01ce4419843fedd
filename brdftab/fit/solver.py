"""Least squares in a box with Optimistix: damped Gauss-Newton steps that may end on a bound.

Optimistix takes no bounds. Transforms that reach a bound only at infinity walk for ever when the answer lies on it, so
the Levenberg-Marquardt step is solved on the free coordinates and what crosses a face is pinned there. The dogleg
solver is Optimistix's own; its coordinates run through a sine, which reaches both bounds at finite values.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from brdftab.fit.normal_equations import Sums, compress, sums
from brdftab.fit.program import Problem

SOLVERS = ("levenberg-marquardt", "dogleg")
MAX_STEPS = 200
# damping of the first step relative to the diagonal of J^T J: far from and near the answer
FAR, NEAR = 1.0, 1e-3


class _Step(eqx.Module):
    y: jax.Array
    f_info: Any


class BoxDescent(optx.AbstractDescent[Any, Any, Any]):
    """Marquardt-damped Gauss-Newton step on the free set of a box.

    Attributes
    ----------
    low, high : Array (n,)
        Bounds.
    damping : float
        Of the first step, relative to the diagonal of J^T J.
    """

    low: jax.Array
    high: jax.Array
    damping: Any

    def init(self, y: Any, f_info_struct: Any) -> _Step:
        """Return a state of the right shape."""

        def zero(s: Any) -> Any:
            return jnp.zeros(s.shape, s.dtype) if isinstance(s, jax.ShapeDtypeStruct) else s

        return _Step(y, jax.tree.map(zero, f_info_struct, is_leaf=lambda s: isinstance(s, jax.ShapeDtypeStruct)))

    def query(self, y: Any, f_info: Any, state: _Step) -> _Step:
        """Remember where the step starts."""
        return _Step(y, f_info)

    def step(self, step_size: Any, state: _Step) -> tuple[Any, Any]:
        """Return the step; coordinates at a bound that the gradient pushes outward stay there."""
        y = state.y
        jac, r = state.f_info.jac.as_matrix(), state.f_info.residual
        hessian, gradient = jac.T @ jac, jac.T @ r
        scale = jnp.maximum(jnp.diag(hessian), 1e-14 * jnp.max(jnp.diag(hessian)) + 1e-300)
        hessian = hessian + self.damping / jnp.maximum(step_size, 1e-15) * jnp.diag(scale)
        pinned = ((y <= self.low) & (gradient > 0.0)) | ((y >= self.high) & (gradient < 0.0))
        moved = jnp.zeros_like(y)
        root = jnp.sqrt(scale)

        def once(_: Any, carry: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
            pinned, moved, _ = carry
            free = ~pinned
            right = jnp.where(free, -gradient - hessian @ jnp.where(pinned, moved, 0.0), 0.0)
            left = jnp.where(free[:, None] & free, hessian / root / root[:, None], jnp.eye(y.size))
            # damped and scaled, the matrix is positive definite
            lower = jax.lax.linalg.cholesky(left)
            half = jax.lax.linalg.triangular_solve(lower, (right / root)[:, None], left_side=True, lower=True)
            whole = jax.lax.linalg.triangular_solve(lower, half, left_side=True, lower=True, transpose_a=True)
            d = jnp.where(free, whole[:, 0] / root, moved)
            inside = jnp.clip(y + d, self.low, self.high) - y
            crossed = free & (inside != d)
            return pinned | crossed, jnp.where(crossed, inside, moved), d

        _, _, d = jax.lax.fori_loop(0, y.size, once, (pinned, moved, moved))
        return jnp.clip(y + d, self.low, self.high) - y, optx.RESULTS.successful


class BoxLevenbergMarquardt(optx.AbstractGaussNewton[Any, Any, Any]):
    """Levenberg-Marquardt in a box, stopped when the promised decrease of the cost is a small share of it."""

    rtol: float
    atol: float
    norm: Callable[..., Any]
    descent: BoxDescent
    search: optx.ClassicalTrustRegion[Any]
    verbose: Callable[..., None]
    promise: Any

    def __init__(self, low: Any, high: Any, damping: Any, promise: Any) -> None:
        self.rtol, self.atol, self.norm = 1e-10, 1e-12, optx.max_norm
        self.descent = BoxDescent(low, high, damping)
        self.search = optx.ClassicalTrustRegion()
        self.verbose = _quiet
        self.promise = promise

    def step(self, fn: Any, y: Any, args: Any, options: Any, state: Any, tags: Any) -> Any:
        """Take one step and look at what the next one promises."""
        y, state, aux = super().step(fn, y, args, options, state, tags)
        r, d = state.f_info.residual, state.y_eval - y
        push = state.f_info.jac.mv(d)
        decrease = -(r @ push + 0.5 * push @ push)
        done = decrease <= self.promise * 0.5 * (r @ r)
        return y, eqx.tree_at(lambda s: s.terminate, state, state.terminate | done), aux


def _quiet(**_: Any) -> None:
    """Say nothing: what a solve did is in its result."""


class Solved(NamedTuple):
    """Ends of S solves: coordinates, half the sum of squares, sums there, steps, verdict (index of `VERDICTS`)."""

    x: Any
    cost: Any
    sums: Sums
    steps: Any
    verdict: Any


VERDICTS = ("converged", "stopped at the most steps allowed", "the linear solve failed")


def _residual(made: Problem, turn: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return fn(u, args) -> (compressed residual, sums) whose Jacobian is the compressed one."""

    @jax.custom_jvp
    def fn(u: Any, args: Any) -> Any:
        found = sums(made, turn(u), *args)
        return compress(found.gram)[0], found

    @fn.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        u, args = primals
        found = sums(made, turn(u), *args)
        r, jac = compress(found.gram)
        moved = jac @ jax.jvp(turn, (u,), (tangents[0],))[1]
        still = jax.tree.map(jnp.zeros_like, found)
        return (r, found), (moved, still)

    return fn


def _solve(
    made: Problem, solver: str, steps: int, start: Any, low: Any, high: Any, args: tuple[Any, ...], pace: Any
) -> Solved:
    """Solve from one start (n,)."""
    if solver == "dogleg":
        half, middle = 0.5 * (high - low), 0.5 * (high + low)

        def turn(u: Any) -> Any:
            return middle + half * jnp.sin(u)

        y0 = jnp.arcsin(jnp.clip((start - middle) / half, -0.999, 0.999))
        method: Any = optx.Dogleg(rtol=1e-7, atol=1e-9)
    else:

        def turn(u: Any) -> Any:
            return u

        y0 = jnp.clip(start, low, high)
        method = BoxLevenbergMarquardt(low, high, *pace)
    fn = _residual(made, turn)
    solution: Any = optx.least_squares(fn, method, y0, args, has_aux=True, max_steps=steps, throw=False)
    state = solution.state
    limited = solution.result == optx.RESULTS.nonlinear_max_steps_reached
    verdict = jnp.where(solution.result == optx.RESULTS.successful, 0, jnp.where(limited, 1, 2))
    cost = 0.5 * jnp.sum(state.f_info.residual**2)
    return Solved(turn(solution.value), cost, state.aux, solution.stats["num_steps"], verdict)


@partial(jax.jit, static_argnums=(0, 1, 2))
def solve(
    made: Problem,
    solver: str,
    steps: int,
    starts: Any,
    count: Any,
    low: Any,
    high: Any,
    fixed: Any,
    scale: Any,
    data: Any,
    used: Any,
    pace: Any,
) -> Solved:
    """Solve from the first `count` starts, one after the other, on the first `used` chunks of the data.

    Both numbers are traced: one compiled program serves many starts on few points and one on all.

    Parameters
    ----------
    made : Problem
        What is fitted (static).
    solver : {"levenberg-marquardt", "dogleg"}
        Static.
    steps : int
        Most steps (static).
    starts : Array (S, n)
        Coordinates to start from.
    count : int
        How many of them.
    low, high : Array (n,)
        Bounds.
    fixed : tuple of dict
        From `channel_fixed`.
    scale : Scales
        Numbers of the loss.
    data : Array (B, rows, CHUNK)
        From `pack`.
    used : int
        Chunks to use.
    pace : tuple of float
        Damping of the first step, and the share of the cost whose promised decrease ends a solve
        (Levenberg-Marquardt).

    Returns
    -------
    Solved
        With a leading axis of S; rows from `count` on are 0.
    """
    args = (fixed, scale, data, used)

    def one(n: Any, kept: Solved) -> Solved:
        found = _solve(made, solver, steps, starts[n], low, high, args, pace)
        return jax.tree.map(lambda whole, part: whole.at[n].set(part), kept, found)

    many, size = starts.shape
    squares = Sums(*(jnp.zeros((many, k, k)) for k in (size + 1, size, size)))
    flags = jnp.zeros(many, int)
    empty = Solved(jnp.zeros((many, size)), jnp.zeros(many), squares, flags, flags)
    return jax.lax.fori_loop(0, count, one, empty)
