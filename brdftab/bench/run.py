"""One setup, every method: errors, run times, and which of them nothing beats."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab._version import __version__
from brdftab.bench import methods as ways
from brdftab.bench import peers
from brdftab.bench.front import mark
from brdftab.bench.measures import NAMES, Measures, mean, measure
from brdftab.bench.methods import Method
from brdftab.bench.reference import Reference, converge
from brdftab.bench.timing import forget, timed
from brdftab.errors import BrdftabError, ParameterError
from brdftab.evaluation.engine import Progress
from brdftab.evaluation.points import is_stochastic
from brdftab.models.resolve import Setup, resolve
from brdftab.system import machine
from brdftab.tables.grid import Grid
from brdftab.tabulation.tabulate import thread_count

FORMAT = "brdftab-bench"
GRID, QUICK_GRID = "16x16x32", "4x4x8"
ANISOTROPIC, QUICK_ANISOTROPIC = "8x12x8x12", "3x4x3x4"
BELOW, QUICK_BELOW = "12x12+12x24", "4x4+4x8"
PACKAGES = ("numpy", "numba", "jax", "scipy", "mitsuba")
# finer rules than this are lost in float32
STORED = 1e-6
# first calls that compile for longer leave out the other tolerances of a twin
COMPILING = 20.0


@dataclass(frozen=True)
class Effort:
    """How much is measured.

    Attributes
    ----------
    tolerances, twin_tolerances : tuple of float
        Rungs of the rules and of the twin.
    samples, caps : tuple of int
        Samples a cell of estimators; bounces.
    seeds : int
        Runs behind the mean error of an estimator.
    repeats : int
        Most timed calls.
    seconds : float
        Time for the calls of one method.
    limit : float
        A run that takes more processor time ends its family.
    converging : float
        The same for the reference.
    """

    tolerances: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10)
    twin_tolerances: tuple[float, ...] = (1e-3, 1e-6)
    samples: tuple[int, ...] = (1, 4, 16, 64, 256)
    caps: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12)
    seeds: int = 3
    repeats: int = 25
    seconds: float = 0.5
    limit: float = 3.0
    converging: float = 5.0


QUICK = Effort((1e-2, 1e-4), (1e-3,), (1, 8), (1, 3), 2, 3, 0.02, 5.0, 0.5)


def recorded() -> dict[str, Any]:
    """Return machine and versions."""
    versions = {"brdftab": __version__}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    processor = platform.processor()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            processor = next((x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), processor)
    except OSError:
        pass
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {**machine(), "processor": processor, "load_average": load, "versions": versions}


def positions(setup: Setup, grid: Grid | str | None, quick: bool) -> Grid:
    """Return the grid that methods fill: the one given, or one that suits the surface.

    Raises
    ------
    ParameterError
        If an anisotropic surface is given a grid of three axes.
    """
    if grid is not None:
        found = Grid.resolve(grid, "center")
        if found.isotropic and not setup.isotropic:
            raise ParameterError(
                f"grid = {'x'.join(map(str, found.shape))} has three axes and the surface has a direction of its own; "
                f"give four, as {ANISOTROPIC}"
            )
        return found
    if setup.transmits:
        return Grid.parse(QUICK_BELOW if quick else BELOW)
    if setup.isotropic:
        return Grid.parse(QUICK_GRID if quick else GRID)
    return Grid.parse(QUICK_ANISOTROPIC if quick else ANISOTROPIC)


def families(setup: Setup, grid: Grid, effort: Effort, peer: bool) -> Iterator[list[Method]]:
    """Yield the methods of a setup, a list a family, in the order in which they are measured."""
    found: list[Method] = []
    if not is_stochastic(setup):
        found += ways.ladder(setup, grid, effort.tolerances, fast=False)
        prepared = ways.ladder(setup, grid, effort.tolerances, fast=True)
        found += prepared
        ends = (ways.USUAL, max(STORED, effort.tolerances[-1]))
        found += ways.ladder(setup, grid, ends, bool(prepared), "float32")
        found += ways.caps(setup, grid, effort.caps)
    found += ways.estimators(setup, grid, effort.samples)
    found += ways.stand_ins(setup, grid, effort.samples)
    found += ways.twins(setup, grid, effort.twin_tolerances)
    if peer:
        found += peers.methods(setup, grid)
    names = dict.fromkeys(m.family for m in found)
    yield from ([m for m in found if m.family == name] for name in names)


def _errors(
    method: Method, values: NDArray[Any], grid: Grid, known: Reference, seeds: int
) -> tuple[Measures, dict[str, list[float]] | None]:
    """Return the mean errors of a method and, of one with noise, the range over its seeds."""
    found = [measure(values, known.values, grid, known.kept)]
    if method.seeded is None:
        return found[0], None
    for seed in range(1, seeds):
        other = method.seeded(int(method.settings["seed"]) + seed)
        found.append(measure(other.make()(), known.values, grid, known.kept))
    spread = {name: [min(getattr(m, name) for m in found), max(getattr(m, name) for m in found)] for name in NAMES}
    return mean(found), spread


def _measured(
    method: Method, setup: Setup, grid: Grid, known: Reference, effort: Effort, before: NDArray[Any] | None
) -> tuple[dict[str, Any] | None, NDArray[Any]]:
    """Run one method; returns its row of the results, None if it gives the values `before` again, and its values."""
    started = time.perf_counter()
    kernel = method.make()
    values = np.array(kernel())
    first = time.perf_counter() - started
    if before is not None and method.seeded is None and np.array_equal(before, values):
        return None, values
    error, spread = _errors(method, values, grid, known, effort.seeds)

    def whole() -> None:
        resolve(setup.model.name, **setup.parameters)
        method.make()()

    row: dict[str, Any] = {
        "name": method.name,
        "family": method.family,
        "settings": method.settings,
        "error": error.to_json(),
        "error_range": spread,
        "resolved": {name: getattr(error, name) > getattr(known.uncertainty, name) for name in NAMES},
        "first_s": first,
        "kernel_s": timed(kernel, effort.repeats, effort.seconds).to_json(),
        "total_s": timed(whole, effort.repeats, effort.seconds, forget).to_json(),
        "same": [],
        "peer": method.family.startswith("mitsuba"),
    }
    return row, values


def _family(
    rungs: list[Method], setup: Setup, grid: Grid, known: Reference, effort: Effort
) -> tuple[list[dict[str, Any]], list[dict[str, str]]]:
    """Measure a family from coarse to fine; returns its rows and what was left out, with the reason."""
    rows: list[dict[str, Any]] = []
    before: NDArray[Any] | None = None
    for number, method in enumerate(rungs):
        try:
            row, before = _measured(method, setup, grid, known, effort, before)
        except BrdftabError as error:
            # a twin may refuse a choice, an estimator a surface
            return rows, [{"name": m.name, "reason": str(error)} for m in rungs[number:]]
        if row is None:
            rows[-1]["same"].append(method.name)
            continue
        rows.append(row)
        # processor time: what runs must not depend on what else the machine does
        slow = max(row[clock]["cpu_min"] for clock in ("kernel_s", "total_s"))
        reason = f"{method.name} took {slow:.2g} CPU s" if slow > effort.limit else ""
        if method.family == "twin" and row["first_s"] > COMPILING:
            reason = f"{method.name} compiled for {row['first_s']:.2g} s"
        if reason:
            return rows, [{"name": m.name, "reason": reason} for m in rungs[number + 1 :]]
    return rows, []


def benchmark(
    model: str,
    grid: Grid | str | None = None,
    *,
    quick: bool = False,
    repeats: int | None = None,
    seconds: float | None = None,
    limit: float | None = None,
    threads: int | None = None,
    peer: bool = True,
    progress: Progress | None = None,
    **parameters: Any,
) -> dict[str, Any]:
    """Measure error and run time of every method that can compute a model.

    Parameters
    ----------
    model : str
        Registry name.
    grid : Grid or str, optional
        Cells that every method fills; 16x16x32 by default, with four axes or views below where the surface asks.
    quick : bool, optional
        A small grid, few rungs and repeats: for tests.
    repeats : int, optional
        Most timed calls of a method, at least 1.
    seconds : float, optional
        Time for the timed calls of a method, above 0.
    limit : float, optional
        A run that takes more processor time, above 0, ends its family.
    threads : int, optional
        Numba threads; JAX and Mitsuba take their own.
    peer : bool, optional
        Measure other programs that compute the same, where installed.
    progress : callable, optional
        Called with the finished share of the work.
    **parameters
        Parameters of the model by name.

    Returns
    -------
    dict
        JSON-able: model, parameters, grid, pairs, seed, reference with its uncertainty, and ``methods``, a row each.

    Raises
    ------
    ParameterError
        If a parameter or the grid is malformed.
    """
    effort = _effort(quick, repeats, seconds, limit)
    with thread_count(threads) as used:
        found = _benchmark(resolve(model, **parameters), grid, effort, quick, peer, progress)
    return {**found, "threads": used}


def _effort(quick: bool, repeats: int | None, seconds: float | None, limit: float | None) -> Effort:
    """Return how much is measured."""
    effort = QUICK if quick else Effort()
    if repeats is not None:
        if repeats < 1:
            raise ParameterError.out_of_range("repeats", repeats, "[1, inf)", "give at least one timed call")
        effort = replace(effort, repeats=repeats)
    if seconds is not None:
        if not seconds > 0.0:
            raise ParameterError.out_of_range("seconds", seconds, "(0, inf)", "give the time of a method's calls")
        effort = replace(effort, seconds=seconds)
    if limit is not None:
        if not limit > 0.0:
            raise ParameterError.out_of_range("limit", limit, "(0, inf)", "a run that takes longer ends its family")
        effort = replace(effort, limit=limit)
    return effort


def _benchmark(
    setup: Setup, grid: Grid | str | None, effort: Effort, quick: bool, peer: bool, progress: Progress | None
) -> dict[str, Any]:
    """Measure a checked setup."""
    layout = positions(setup, grid, quick)
    known = converge(setup, layout, effort.converging)
    rows: list[dict[str, Any]] = []
    missing: list[dict[str, str]] = []
    groups = list(families(setup, layout, effort, peer))
    for number, rungs in enumerate(groups):
        found, skipped = _family(rungs, setup, layout, known, effort)
        rows, missing = rows + found, missing + skipped
        if progress is not None:
            progress((number + 1) / len(groups))
    if peer:
        missing += peers.missing(setup)
    mark(rows, known.uncertainty.to_json())
    return {
        "model": setup.model.name,
        "parameters": setup.parameters,
        "grid": "x".join(map(str, layout.shape)),
        "pairs": layout.size,
        "channels": list(setup.channels),
        "seed": int(setup.values.get("seed") or 0),
        "reference": known.to_json(),
        "methods": rows,
        "left_out": missing,
    }
