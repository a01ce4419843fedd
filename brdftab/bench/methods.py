"""What can compute a setup: found from the registry, so that a new model takes part by being there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.bench.measures import all_angles
from brdftab.errors import ParameterError
from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import is_stochastic
from brdftab.models.resolve import Setup, resolve
from brdftab.tables.grid import Grid
from brdftab.tabulation.filling import fill_grid

# fills the whole grid and returns (*grid, C)
Kernel = Callable[[], NDArray[Any]]
# tolerance of tables, and of runs that vary something else
USUAL = 1e-3
CLOSE = 1e-4


@dataclass(frozen=True)
class Method:
    """One way to compute a setup.

    Attributes
    ----------
    family : str
        Methods of a family differ in one number alone; a figure joins them.
    name : str
        Names the method among all of its setup.
    settings : dict
        What it runs with, JSON-able.
    make : callable
        Prepares everything from the parameters on and returns the kernel.
    seeded : callable or None
        The same with another seed, for methods with noise.
    """

    family: str
    name: str
    settings: dict[str, Any]
    make: Callable[[], Kernel]
    seeded: Callable[[int], Method] | None = field(default=None)


def filled(setup: Setup, grid: Grid, tolerance: float, fast: bool, dtype: str = "float64") -> Callable[[], Kernel]:
    """Return what prepares the engine of a setup and gives a kernel that fills the grid."""

    def make() -> Kernel:
        engine = Engine(setup, tolerance, fast=fast)
        out = np.empty((1, *grid.shape, len(setup.channels)), dtype=dtype)

        def work() -> NDArray[Any]:
            fill_grid(engine, grid, out, None)
            return out[0]

        return work

    return make


def ladder(setup: Setup, grid: Grid, tolerances: tuple[float, ...], fast: bool, dtype: str = "float64") -> list[Method]:
    """Return the rules of each tolerance: direct quadrature, or the model's prepared path if it has one."""
    if fast and not Engine(setup, tolerances[0], trial=True).is_fast:
        return []
    word = ("prepared" if fast else "direct") + ("" if dtype == "float64" else f" {dtype}")
    return [
        Method(
            word,
            f"{word} {tolerance:.0e}",
            {"tolerance": tolerance, "dtype": dtype, "prepared": fast},
            filled(setup, grid, tolerance, fast, dtype),
        )
        for tolerance in tolerances
    ]


def _other(setup: Setup, **changed: Any) -> Setup | None:
    """Return a setup with some parameters changed, or None where the model refuses that."""
    try:
        return resolve(setup.model.name, **{**setup.parameters, **changed})
    except ParameterError:
        return None


def caps(setup: Setup, grid: Grid, most: tuple[int, ...]) -> Iterator[Method]:
    """Yield sums cut off after so many bounces, where the model has a cap above them."""
    declared = setup.model
    found: list[tuple[str, Any, Setup | None]] = []
    if declared.shares("max_bounces"):
        found += [("max_bounces", n, _other(setup, max_bounces=n)) for n in most]
    if declared.shares("bounces"):
        found += [("bounces", word, _other(setup, bounces=word)) for word in declared.param("bounces").choices]
    for name, value, capped in found:
        cap = None if capped is None else capped.max_bounces
        if capped is None or cap is None or is_stochastic(capped):
            continue
        if setup.max_bounces is None or cap < setup.max_bounces:
            yield Method(
                name, f"{name} {value}", {name: value, "tolerance": CLOSE}, filled(capped, grid, CLOSE, fast=True)
            )


def _drawn(setup: Setup, grid: Grid, family: str, samples: int, seed: int) -> Method:
    """Return an estimator at a number of samples a cell."""
    fixed = replace(setup, values={**setup.values, "samples": samples, "seed": seed})

    def make() -> Kernel:
        module = models.estimator(fixed.model.name)
        return lambda: module.estimate_table(fixed, grid.axes, orders=0, tolerance=0.5, progress=None).values[0]

    return Method(
        family,
        f"{family} {samples}",
        {"model": setup.model.name, "samples": samples, "seed": seed},
        make,
        lambda other: _drawn(setup, grid, family, samples, other),
    )


def estimators(setup: Setup, grid: Grid, samples: tuple[int, ...], family: str = "") -> Iterator[Method]:
    """Yield Monte Carlo estimators: those of the setup itself, or those that one of its choices turns on."""
    if not setup.model.shares("samples"):
        return
    found: dict[str, Setup] = {}
    if is_stochastic(setup):
        found[family or str(setup.values.get("estimator", setup.model.name))] = setup
    for param in setup.model.params:
        if param.kind != "choice" or is_stochastic(setup):
            continue
        for word in param.choices:
            other = _other(setup, **{param.name: word})
            # a word such as auto settles on another one
            if other is not None and is_stochastic(other) and other.parameters.get(param.name) == word:
                found[word] = other
    for name, other in found.items():
        for count in samples:
            yield _drawn(other, grid, name, count, int(other.values.get("seed") or 0))


def stand_ins(setup: Setup, grid: Grid, samples: tuple[int, ...]) -> Iterator[Method]:
    """Yield what the model's folder names as rougher, and the models that say that they approximate this one."""
    for name, values in setup.model.methods.items():
        for value in values:
            other = _other(setup, **{name: value})
            if other is None or other.parameters == setup.parameters:
                continue
            if is_stochastic(other):
                yield from estimators(other, grid, samples, f"{setup.model.name} {name} {value}")
            else:
                yield Method(
                    name, f"{name} {value}", {name: value, "tolerance": CLOSE}, filled(other, grid, CLOSE, fast=True)
                )
    for name in models.names():
        without = models.spec(name).approximates.get(setup.model.name)
        if without is None:
            continue
        given = {n: v for n, v in setup.parameters.items() if n not in without}
        try:
            other = resolve(name, **given)
        except ParameterError:
            # it does without something that this surface has
            continue
        if is_stochastic(other):
            yield from estimators(other, grid, samples, name)
        else:
            yield Method(name, name, {"model": name, "tolerance": CLOSE}, filled(other, grid, CLOSE, fast=True))


def twins(setup: Setup, grid: Grid, tolerances: tuple[float, ...]) -> Iterator[Method]:
    """Yield the model's twin in JAX, NumPy arrays in and out."""
    if not models.has_twin(setup.model.name) or is_stochastic(setup):
        return
    from brdftab.models.twins import evaluate

    angles = all_angles(grid)
    for tolerance in tolerances:

        def make(tolerance: float = tolerance) -> Kernel:
            return lambda: evaluate(setup, *angles, tolerance=tolerance).reshape(*grid.shape, -1)

        yield Method("twin", f"twin {tolerance:.0e}", {"tolerance": tolerance, "dtype": "float64"}, make)
