"""From packed data to the best parameters: many starts on few points, then all points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from brdftab.errors import ParameterError
from brdftab.fit import losses, normal_equations, program, solver
from brdftab.fit.data import Dataset
from brdftab.fit.parameters import Sum
from brdftab.fit.starts import guess_albedo, spread
from brdftab.models import twin
from brdftab.models._shared.twin.frame import Directions, directions
from brdftab.models.protocols import HasRuleNodes
from brdftab.models.twins import integrates
from brdftab.system import cache_folder
from brdftab.timing import Clock
from brdftab.typing import Array

# chunks of the program that serves starts (its first chunk) and the first stage (all of them)
SMALL = 20
STARTS = 8
# share of the cost whose promised decrease ends a start, and how close costs count as the same minimum
ROUGHLY, AGREE = 1e-4, 2e-3
# a solve ends when its next step would be shorter than this many standard errors
NEGLIGIBLE = 0.02
# rules of models that integrate, coarse to fine
RULES = (1e-2, 1e-3, 1e-4, 1e-5)
# a bias by the rule below this many standard errors is let be
BIAS = 0.2
CHECKED = 384
# directions that are predicted at a time
BLOCK = 1024


@dataclass
class Options:
    """How to fit; see `brdftab.fit_model`."""

    loss: str = "log"
    robust: float | str | None = None
    noise_floor: float = 0.0
    method: str = solver.SOLVERS[0]
    starts: int = STARTS
    start: dict[str, Any] = field(default_factory=dict)
    max_steps: int = solver.MAX_STEPS
    seed: int = 0


@dataclass
class Outcome:
    """What the stages leave: coordinates, sums there, and how they came about."""

    x: Array
    sums: normal_equations.Sums
    cost: float
    verdict: str
    steps: int
    tried: int
    agreed: int
    start_costs: list[float]
    scale: float
    rule: float
    bias: Array
    times: dict[str, float]
    residuals: int


def use_compilation_cache() -> None:
    """Keep compiled programs on disk beside the Numba kernels, unless the user has chosen a folder for JAX."""
    if getattr(jax.config, "jax_compilation_cache_dir", None) is not None:
        return
    jax.config.update("jax_compilation_cache_dir", str(cache_folder() / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


class Points(NamedTuple):
    """Directions (N,) with values, transformed data, weights (0 where unused) and marks of saturation, (N, C)."""

    theta_i: Array
    theta_o: Array
    phi: Array
    values: Array
    target: Array
    weight: Array
    saturated: NDArray[np.bool_]

    @classmethod
    def of(cls, data: Dataset, options: Options, pick: Any, floor: float) -> Points:
        """Return the picked points of a data set as the loss sees them."""
        theta_i, theta_o, phi = (a[pick] for a in (data.theta_i, data.theta_o, data.phi))
        values, valid, saturated = (a[pick] for a in (data.values, data.valid, data.saturated))
        used = valid & losses.usable(options.loss, np.where(valid, values, 1.0))
        safe = np.where(used, values, 1.0)
        cosine = np.cos(theta_i)
        target = losses.transform(options.loss, safe, cosine[:, None], floor)
        weight = np.where(used, losses.noise_weight(options.loss, safe, options.noise_floor), 0.0)
        return cls(theta_i, theta_o, phi, safe, target, weight, saturated & used)

    @property
    def residuals(self) -> int:
        """How many values count."""
        return int((self.weight > 0.0).sum())

    def packed(self, chunks: int) -> Array:
        """Return the array that the compiled programs read."""
        return normal_equations.pack(
            self.theta_i, self.theta_o, self.phi, self.target, self.weight, self.saturated, chunks
        )


class Fitter:
    """One sum of models on one data set.

    Parameters
    ----------
    total : Sum
        What is fitted.
    data : Dataset
        Where and to what.
    options : Options
        How.
    """

    def __init__(self, total: Sum, data: Dataset, options: Options) -> None:
        use_compilation_cache()
        self.total, self.data, self.options = total, data, options
        self.channels = data.values.shape[1]
        self.times = {"starts": 0.0, "first_stage": 0.0, "polish": 0.0}
        self.robust = options.robust is not None
        self.angles = (data.theta_i, data.theta_o, data.phi)
        self._pack()
        self.low, self.high = total.bounds(self.channels)
        if self.residuals <= len(self.low):
            raise ParameterError(
                f"samples: {self.residuals} valid values cannot tell {len(self.low)} parameters of {total.name}; give "
                "more directions, or fit fewer parameters"
            )

    def _pack(self) -> None:
        """Transform the data once; a random sample of the points goes into the small program."""
        data, options = self.data, self.options
        count = data.theta_i.size
        pick = np.random.default_rng(options.seed + 1).permutation(count)[: SMALL * normal_equations.CHUNK]
        self.floor = losses.dark(data.values[data.valid])
        self.few = Points.of(data, options, pick, self.floor)
        self.small = self.few.packed(SMALL)
        self.large, self.residuals = None, self.few.residuals
        if count > pick.size:
            whole = Points.of(data, options, slice(None), self.floor)
            self.large, self.residuals = whole.packed(-(-count // normal_equations.CHUNK)), whole.residuals

    def run(self) -> Outcome:
        """Fit; the rule of models that integrate is made finer until its bias no longer counts."""
        rules = RULES if self.integrates else RULES[-1:]
        outcome: Outcome | None = None
        for rule in rules:
            before = outcome
            outcome = self._fit(rule, None if before is None else before.x[None])
            if before is not None:
                # the finer rule went on from the best of all starts
                outcome.tried, outcome.agreed, outcome.start_costs = before.tried, before.agreed, before.start_costs
                outcome.steps += before.steps
            if not self.integrates:
                break
            # at the finest rule, too: what it leaves is told
            outcome.bias = self._bias(outcome)
            errors = np.sqrt(np.diag(covariance(outcome, self.low, self.high)[0]))
            if (np.abs(outcome.bias) <= BIAS * np.where(errors > 0.0, errors, np.inf)).all():
                break
        assert outcome is not None
        return outcome

    @property
    def integrates(self) -> bool:
        """Tell whether a model of the sum has nodes to choose."""
        return any(integrates(s.model.name) for s in self.total.terms)

    def _solve(self, made: program.Problem, starts: Array, count: int, scale: float, data: Any, used: int) -> Any:
        """Run the compiled solver, whose compilation is timed apart."""
        # many starts only need to tell their minima apart
        if used == 1 and count > 1:
            pace = (solver.FAR, ROUGHLY)
        else:
            # a step that promises this share of the cost moves the answer by NEGLIGIBLE standard errors
            pace = (solver.NEAR, NEGLIGIBLE**2 / max(self.residuals, 1))
        scales = normal_equations.Scales(scale, self.floor)
        args = (starts, count, self.low, self.high, self.fixed, scales, data, used, pace)
        options = self.options
        call = _compiled(made, options.method, options.max_steps, starts.shape, data.shape, _Shapes(args))
        return jax.tree.map(np.asarray, call(*args))

    def _fit(self, rule: float, starts: Array | None) -> Outcome:
        """Run all stages with one rule."""
        options, clock = self.options, Clock()
        made, fixed = program.problem(self.total, options.loss, self.robust, rule)
        self.made, self.fixed = (
            made,
            (program.channel_fixed(fixed, self.channels), program.rules(made, rule, self.angles)),
        )
        scale = 1e6 if self.robust else 1.0
        chunks = -(-self.few.theta_i.size // normal_equations.CHUNK)
        many = starts
        if many is None:
            albedo = guess_albedo(self.few.values, self.few.weight > 0.0)
            many = spread(self.total, albedo, options.starts, options.seed, options.start)
        room = np.zeros((max(options.starts, 1), many.shape[1]))
        room[: len(many)] = many
        found = self._solve(made, room, len(many), scale, self.small, 1)
        costs = np.where(np.isfinite(found.cost), found.cost, np.inf)[: len(many)]
        best = found.x[_candidates(costs, found.x)]
        self.times["starts"] += clock.seconds
        clock = Clock()
        room[: len(best)] = best
        first = self._solve(made, room, len(best), scale, self.small, chunks)
        lead = int(np.argmin(np.where(np.isfinite(first.cost), first.cost, np.inf)[: len(best)]))
        if self.robust:
            scale = self._scale(first.x[lead])
            room[0] = first.x[lead]
            first, lead = self._solve(made, room, 1, scale, self.small, chunks), 0
        self.times["first_stage"] += clock.seconds
        steps, end = int(first.steps[lead]), first
        if self.large is not None:
            clock = Clock()
            end = self._solve(made, first.x[lead][None], 1, scale, self.large, self.large.shape[0])
            lead, steps = 0, steps + int(end.steps[0])
            self.times["polish"] += clock.seconds
        return Outcome(
            x=end.x[lead],
            sums=normal_equations.Sums(*(s[lead] for s in end.sums)),
            cost=float(end.cost[lead]),
            verdict=solver.VERDICTS[int(end.verdict[lead])],
            steps=steps,
            tried=len(many),
            agreed=int((costs <= costs.min() * (1.0 + AGREE) + 1e-12 * self.residuals).sum()),
            start_costs=[float(c) for c in costs],
            scale=scale if self.robust else float("nan"),
            rule=rule,
            bias=np.zeros_like(self.low),
            times=self.times,
            residuals=self.residuals,
        )

    def _scale(self, x: Array) -> float:
        """Return the scale of the robust loss: the user's, or the spread of the first stage's residuals."""
        if isinstance(self.options.robust, int | float) and not isinstance(self.options.robust, bool):
            return float(self.options.robust)
        few = self.few
        fitted = self.predict(x, few.theta_i, few.theta_o, few.phi)
        cosine = np.cos(few.theta_i)[:, None]
        r = (losses.transform(self.options.loss, fitted, cosine, self.floor) - few.target) * few.weight
        return max(1.5 * losses.robust_scale(r[few.weight > 0.0]), 1e-12)

    def predict(self, x: Array, theta_i: Array, theta_o: Array, phi: Array, rule: float | None = None) -> Array:
        """Return the fitted sum (N, C) in 1/sr by the twins; `rule` asks for other nodes than those of the fit.

        The directions are some of the data's.
        """
        made, fixed = self.made, self.fixed
        if rule is not None:
            made = replace(made, statics=tuple(replace(s, tolerance=_traced(s, rule)) for s in made.statics))
            fixed = (fixed[0], program.rules(made, rule, self.angles))
        d = directions(theta_i, theta_o, phi, np.zeros_like(theta_i))
        parts = []
        # many points are worth a program of their own
        block = BLOCK if theta_i.size <= SMALL * normal_equations.CHUNK else SMALL * normal_equations.CHUNK
        for at in range(0, theta_i.size, block):
            part = [np.resize(a[at : at + block], block) for a in d]
            parts.append(np.asarray(normal_equations.predict(made, x, fixed, Directions(*part))).T)
        return np.concatenate(parts)[: theta_i.size]

    def _bias(self, outcome: Outcome) -> Array:
        """Return how far the coordinates are off because the integration rule is coarse.

        The values of a rule finer by two steps at the answer are fitted again with the present one, without noise.
        """
        few = Points._make(a[:CHECKED] for a in self.few)
        exact = self.predict(outcome.x, few.theta_i, few.theta_o, few.phi, rule=0.01 * outcome.rule)
        target = losses.transform(self.options.loss, exact, np.cos(few.theta_i)[:, None], self.floor)
        clean = few._replace(
            target=target, weight=np.where(few.saturated, 0.0, few.weight), saturated=np.zeros_like(few.saturated)
        )
        packed = clean.packed(SMALL)
        room = np.tile(outcome.x, (max(self.options.starts, 1), 1))
        again = self._solve(self.made, room, 1, max(outcome.scale, 1e-6) if self.robust else 1.0, packed, 1)
        return np.asarray(again.x[0] - outcome.x)


def _traced(static: Any, rule: float) -> float:
    """Return the tolerance that a term is compiled for: its nodes may be numbers instead."""
    return static.tolerance if isinstance(twin(static.model), HasRuleNodes) else rule


def _candidates(costs: Array, ends: Array) -> list[int]:
    """Return up to three starts worth going on with: the best, and others with nearly its cost that ended elsewhere."""
    order = np.argsort(costs)
    kept = [int(order[0])]
    for n in order[1:]:
        # the same cost elsewhere is a valley of one minimum
        apart = all(np.abs(ends[n] - ends[k]).max() > 1e-2 and costs[n] > (1.0 + AGREE) * costs[k] for k in kept)
        if costs[n] <= 1.3 * costs[order[0]] and apart and len(kept) < 3:
            kept.append(int(n))
    return kept


def covariance(outcome: Outcome, low: Array, high: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the sandwich and the classical covariance of the coordinates, and which of them lie on a bound.

    The bread is J^T J, the meat sums the scores of whole directions. Coordinates on a bound have no spread. By
    hand, for libraries of statistics want the whole Jacobian in memory, which the normal equations never hold.
    """
    x, sums = outcome.x, outcome.sums
    at_bound = (x <= low) | (x >= high)
    free = ~at_bound
    n = len(x)
    sandwich, classical = np.zeros((n, n)), np.zeros((n, n))
    if free.any():
        pick = np.ix_(free, free)
        bread = sums.bread[pick]
        scale = np.sqrt(np.maximum(np.diag(bread), 1e-300))
        inverse = np.linalg.pinv(bread / scale / scale[:, None], rcond=1e-13, hermitian=True) / scale / scale[:, None]
        degrees = max(outcome.residuals - int(free.sum()), 1)
        sandwich[pick] = inverse @ sums.meat[pick] @ inverse * outcome.residuals / degrees
        classical[pick] = inverse * (2.0 * outcome.cost / degrees)
    return sandwich, classical, at_bound


class _Shapes:
    """Arguments of which only shapes and types count as a key."""

    def __init__(self, args: Any) -> None:
        self.args = args
        leaves, tree = jax.tree.flatten(args)
        self.key = (tree, tuple((np.shape(v), np.asarray(v).dtype.str) for v in leaves))

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Shapes) and self.key == other.key


@lru_cache(maxsize=64)
def _compiled(
    made: program.Problem,
    method: str,
    steps: int,
    starts: tuple[int, ...],
    data: tuple[int, ...],
    shapes: _Shapes,
) -> Callable[..., Any]:
    """Return the compiled solver for these shapes; kept, so that a second fit does not wait."""
    call = solver.solve.lower(made, method, steps, *shapes.args).compile()
    shapes.args = None
    return call
