"""What methods are held against: the finest direct rule, or many samples, with an uncertainty of its own."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.bench.measures import NAMES, Measures, all_angles, measure
from brdftab.bench.methods import filled
from brdftab.evaluation.agreement import looser
from brdftab.evaluation.points import is_stochastic, singular
from brdftab.models.resolve import Setup
from brdftab.tables.grid import Grid
from brdftab.typing import Array

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
# samples a cell of the first reference with noise, the factor to the next one, and the most
SAMPLES, FACTOR, MOST = 64, 4, 1 << 16
# keeps the reference's random numbers apart from those of any method
SEED = 1_000_003
# what sums of float64 can differ by
ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
NAMED = {
    "direct": "difference between the last two rules that differ, at least the rounding of float64",
    "samples": "standard error of every cell taken as its error; in the albedo as if all had one sign",
}


@dataclass(frozen=True)
class Reference:
    """Converged values.

    Attributes
    ----------
    values : float64 (*grid, C)
        1/sr.
    uncertainty : Measures
        How far the values may be off themselves.
    settings : dict
        What made them.
    kept : bool (*grid)
        False at mirror directions where the model is infinite.
    """

    values: Array
    uncertainty: Measures
    settings: dict[str, Any]
    kept: NDArray[np.bool_]

    def to_json(self) -> dict[str, Any]:
        """Return what made the reference and how good it is, as plain JSON."""
        return {**self.settings, "uncertainty": self.uncertainty.to_json(), "left_out_cells": int((~self.kept).sum())}


def converge(setup: Setup, grid: Grid, seconds: float) -> Reference:
    """Return reference values of a setup over a grid.

    Parameters
    ----------
    setup : Setup
        The model.
    grid : Grid
        Where.
    seconds : float
        No finer rule is tried after one that took more processor time.
    """
    kept = ~singular(setup, *all_angles(grid)).reshape(grid.shape)
    return _sampled(setup, grid, seconds, kept) if is_stochastic(setup) else _refined(setup, grid, seconds, kept)


def _clocked(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return what a call gives and its processor time."""
    started = time.process_time()
    found = work()
    return found, time.process_time() - started


def _refined(setup: Setup, grid: Grid, seconds: float, kept: NDArray[np.bool_]) -> Reference:
    """Go through ever finer direct rules; those with the same values say nothing of their error."""
    coarser: Array | None = None
    gap: Measures | None = None
    used = TOLERANCES[0]
    for number, tolerance in enumerate(TOLERANCES):
        kernel = filled(setup, grid, tolerance, fast=False)()
        values, spent = _clocked(kernel)
        if spent > seconds and number < 2:
            # the first call may have compiled
            values, spent = _clocked(kernel)
        used, values = tolerance, np.array(values, dtype=np.float64)
        if coarser is not None:
            if not np.array_equal(coarser[kept], values[kept]):
                gap = _bounded(measure(coarser, values, grid, kept), math.inf)
            if spent > seconds:
                break
        coarser = values
    made = {"method": "direct", "tolerance": used, "uncertainty_is": NAMED["direct"]}
    return Reference(values, gap or _supported(setup, grid, values, kept), made, kept)


def _bounded(gap: Measures, most: float) -> Measures:
    """Return measures that are no smaller than rounding and no larger than `most`."""
    return Measures(*(max(min(getattr(gap, name), most), ROUNDING) for name in NAMES))


def _supported(setup: Setup, grid: Grid, values: Array, kept: NDArray[np.bool_]) -> Measures:
    """Return what looser rules support where the fine ones had the same values; rounding where there are no others."""
    equal = TOLERANCES[0]
    for tolerance in looser(equal):
        kernel = filled(setup, grid, tolerance, fast=False)()
        other = np.array(kernel(), dtype=np.float64)
        if not np.array_equal(other[kept], values[kept]):
            return _bounded(measure(other, values, grid, kept), equal)
        equal = tolerance
    return _bounded(Measures(0.0, 0.0, 0.0, 0.0), 0.0)


def _sampled(setup: Setup, grid: Grid, seconds: float, kept: NDArray[np.bool_]) -> Reference:
    """Draw ever more samples."""
    module = models.estimator(setup.model.name)
    samples, seed = SAMPLES, int(setup.values.get("seed") or 0) + SEED

    def drawn(count: int) -> Any:
        fixed = replace(setup, values={**setup.values, "samples": count, "seed": seed})
        return module.estimate_table(fixed, grid.axes, orders=0, tolerance=0.5, progress=None)

    drawn(1)
    found, spent = _clocked(partial(drawn, samples))
    while spent * FACTOR < seconds and samples * FACTOR <= MOST:
        samples *= FACTOR
        found, spent = _clocked(partial(drawn, samples))
    values = found.values[0]
    noise = measure(values + found.standard_error, values, grid, kept)
    made = {"method": "samples", "samples": samples, "seed": seed, "uncertainty_is": NAMED["samples"]}
    return Reference(values, noise, made, kept)
