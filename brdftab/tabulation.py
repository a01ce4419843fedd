"""model x grid -> Table, with its estimated error and what it cost."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numba
import numpy as np
from numpy.typing import DTypeLike, NDArray

from brdftab import models
from brdftab._version import __version__
from brdftab.cells import axis_nodes, mirror_average
from brdftab.engine import Engine, Progress
from brdftab.errors import GridError, ParameterError, SingularDirectionError
from brdftab.estimate import Estimate, estimate
from brdftab.evaluation import ORDERS, check_tolerance, singular, singular_setup
from brdftab.grid import Grid
from brdftab.models.setup import Setup, component_names, resolve
from brdftab.provenance import machine, physics, verdict
from brdftab.table import Table

Array = NDArray[np.float64]
DEFAULT_GRID = "90x90x180"
DEFAULT_ANISOTROPIC = "15x24x15x24"
TOLERANCE = 1e-3
MIRROR_NODES = (7, 11)
AVERAGE_NODES = (3, 5, 8)


@contextlib.contextmanager
def thread_count(threads: int | None) -> Iterator[int]:
    """Run with a number of Numba threads and restore the former one."""
    most = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]  # set at run time
    if threads is not None and not (isinstance(threads, int) and 1 <= threads <= most):
        raise ParameterError.out_of_range("threads", threads, f"[1, {most}]", "NUMBA_NUM_THREADS sets the upper end")
    before = numba.get_num_threads()
    numba.set_num_threads(threads or before)
    try:
        yield threads or before
    finally:
        numba.set_num_threads(before)


def _singular_cells(setup: Setup, grid: Grid) -> NDArray[np.int64]:
    """Return the cells that must hold an average, or refuse point values there."""
    none = np.empty((0, len(grid.shape)), dtype=np.int64)
    if singular_setup(setup) is None:
        return none
    cells = np.asarray(grid.mirror_cells()).reshape(-1, len(grid.shape))
    axes = grid.axes
    normal = (
        np.argwhere(np.isclose(axes["theta_i"], 0.0, atol=1e-12)),
        np.argwhere(np.isclose(axes["theta_o"], 0.0, atol=1e-12)),
    )
    if normal[0].size and normal[1].size:
        # at normal incidence and view the half vector is the normal for every azimuth
        ranges = [
            [0] if name.startswith("theta") else range(n) for name, n in zip(grid.axis_names, grid.shape, strict=True)
        ]
        cells = np.unique(np.concatenate([cells, np.array(list(itertools.product(*ranges)))]), axis=0)
    if grid.cell != "point" or not len(cells):
        return cells
    theta_i, theta_o = axes["theta_i"][cells[:, 0]], axes["theta_o"][cells[:, -2]]
    azimuth = np.zeros(len(cells)) if grid.isotropic else axes["phi_i"][cells[:, 1]]
    phi = axes["phi"][cells[:, 2]] if grid.isotropic else axes["phi_o"][cells[:, 3]] - azimuth
    bad = singular(setup, theta_i, theta_o, phi, azimuth)
    if bad.any():
        at = int(np.argmax(bad))
        raise SingularDirectionError(
            f"cell = point is refused: the grid holds {int(bad.sum())} mirror directions (theta_i = theta_o = "
            f"{math.degrees(theta_i[at]):g}, phi = {math.degrees(phi[at]):g} degrees), where {setup.model.name} has no "
            "finite value; use cell = center or average, or positions aside"
        )
    return none


def _fill(engine: Engine, grid: Grid, out: NDArray[np.floating], progress: Progress | None) -> None:
    """Fill out (P, *grid, C) with the values at the grid's positions."""
    _fill_at(engine, grid, [grid.axes[name] for name in grid.axis_names], out, progress)


def _fill_at(
    engine: Engine, grid: Grid, axes: list[Array], out: NDArray[np.floating], progress: Progress | None
) -> None:
    if grid.isotropic:
        engine.fill(axes[0], axes[1], axes[2], out, progress)
        return
    incoming = np.stack(np.meshgrid(axes[0], axes[1], indexing="ij"), -1).reshape(-1, 2)
    outgoing = np.stack(np.meshgrid(axes[2], axes[3], indexing="ij"), -1).reshape(-1, 2)
    flat = out.reshape(out.shape[0], len(incoming), len(outgoing), out.shape[-1])
    engine.fill_azimuths(incoming, outgoing, flat, progress)


def _fill_averages(
    engine: Engine, grid: Grid, nodes: int, out: NDArray[np.floating], progress: Progress | None
) -> None:
    """Fill out (P, *grid, C) with cell averages by Gauss nodes along every axis, exactly reciprocal on square grids."""
    rules = [axis_nodes(grid.edges[name], nodes, name.startswith("theta")) for name in grid.axis_names]
    total = np.zeros(out.shape)
    part = np.empty(out.shape)
    picks = list(itertools.product(range(nodes), repeat=len(rules)))
    half = len(rules) // 2 if not grid.isotropic else 1
    swapped = (0, 2, 1, 3, 4) if grid.isotropic else (0, 3, 4, 1, 2, 5)
    for number, pick in enumerate(picks):
        incoming, outgoing = pick[:half], pick[half : 2 * half]
        if grid.square and outgoing < incoming:
            continue
        _fill_at(engine, grid, [rule[0][p] for rule, p in zip(rules, pick, strict=True)], part, None)
        for axis, (rule, p) in enumerate(zip(rules, pick, strict=True)):
            part *= np.expand_dims(rule[1][p], tuple(k for k in range(part.ndim) if k != axis + 1))
        total += part
        if grid.square and outgoing > incoming:
            total += part.transpose(swapped)
        if progress is not None:
            progress((number + 1) / len(picks))
    out[:] = total


class _Run:
    """One attempt at one tolerance: engine, values, cost."""

    def __init__(self, setup: Setup, grid: Grid, dtype: DTypeLike, tolerance: float, orders: int, fast: bool) -> None:
        self.setup, self.grid, self.orders = setup, grid, orders
        self.cells = _singular_cells(setup, grid)
        self.nodes = 0
        started = time.perf_counter()
        self.engine = Engine(setup, tolerance, orders, fast)
        self.kernel_time = time.perf_counter() - started
        self.values = np.empty((self.engine.layers, *grid.shape, len(setup.channels)), dtype=dtype)

    def compute(self, nodes: int, progress: Progress | None) -> None:
        """Fill the table; nodes is the number of Gauss nodes along each coordinate of an averaged cell."""
        started = time.perf_counter()
        if self.grid.cell == "average":
            self.nodes = nodes
            _fill_averages(self.engine, self.grid, nodes, self.values, progress)
        else:
            _fill(self.engine, self.grid, self.values, progress)
        if len(self.cells):
            mean = mirror_average(
                self.engine, self.grid, self.cells, nodes if self.grid.cell == "center" else MIRROR_NODES[0]
            )
            self._store(mean)
        self.kernel_time += time.perf_counter() - started

    def refine(self, worst: tuple[int, ...]) -> bool:
        """Make the averages of the mirror cells again with more nodes if the worst cell is one of them."""
        if self.grid.cell != "center" or worst not in {tuple(c) for c in self.cells.tolist()}:
            return False
        started = time.perf_counter()
        self._store(mirror_average(self.engine, self.grid, self.cells, MIRROR_NODES[1]))
        self.kernel_time += time.perf_counter() - started
        return True

    def _store(self, mean: Array) -> None:
        """Write the averages of mirror cells; both halves of a square grid get the same number."""
        cells = self.cells
        if self.grid.square:
            swap = cells[:, [1, 0, 2]] if self.grid.isotropic else cells[:, [2, 3, 0, 1]]
            lookup = {tuple(c): n for n, c in enumerate(cells.tolist())}
            partner = np.array([lookup.get(tuple(c), n) for n, c in enumerate(swap.tolist())])
            mean = 0.5 * (mean + mean[partner])
        self.values[(slice(None), *cells.T)] = mean.transpose(1, 0, 2)

    @property
    def total(self) -> NDArray[np.floating]:
        """Return the sum over the components."""
        if self.engine.layers == 1:
            return self.values[0]
        return self.values.sum(axis=0, dtype=np.float64).astype(self.values.dtype)


def _check_memory(grid: Grid, channels: int, dtype: DTypeLike, layers: int) -> None:
    """Refuse a table that the machine cannot hold, rather than let the system end the process."""
    needed = grid.nbytes(channels, dtype) * (layers + 1)
    try:
        there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return
    if needed > 0.8 * there:
        raise GridError(
            f"grid = {'x'.join(map(str, grid.shape))} needs {needed / 2**30:.3g} GiB, outside the "
            f"{0.8 * there / 2**30:.3g} GiB that this machine offers; ask for a coarser grid, float32 or no components"
        )


def _warm_up(setup: Setup, tolerance: float, orders: int, dtype: DTypeLike) -> float:
    """Compile the kernels on a handful of cells and return the time it took."""
    started = time.perf_counter()
    engine = Engine(setup, tolerance, orders, trial=True)
    angle = np.array([0.3, 0.7])
    if setup.isotropic:
        engine.fill(angle, angle, angle, np.empty((engine.layers, 2, 2, 2, len(setup.channels)), dtype))
    engine.points(angle, angle[::-1].copy(), angle, angle)
    return time.perf_counter() - started


def _attempts(setup: Setup, grid: Grid, tolerance: float, orders: int) -> list[tuple[float, bool, int]]:
    """Return (tolerance, fast, nodes) of the runs to try until the estimate holds."""
    if grid.cell == "average":
        return [(tolerance, True, nodes) for nodes in AVERAGE_NODES]
    return [
        (tolerance, True, MIRROR_NODES[0]),
        (tolerance, False, MIRROR_NODES[0]),
        (max(0.01 * tolerance, 1e-13), False, MIRROR_NODES[1]),
    ]


def tabulate(
    model: str,
    grid: Grid | str | Mapping[str, Any] | None = None,
    *,
    cell: str | None = None,
    dtype: str = "float32",
    tolerance: float = TOLERANCE,
    components: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
    **parameters: Any,
) -> Table:
    """Tabulate a model on a grid.

    Parameters
    ----------
    model : str
        Registry name.
    grid : Grid, str or mapping, optional
        ``"90x90x180"`` (theta_i, theta_o, phi; the default), ``"15x24x15x24"`` (theta_i, phi_i, theta_o, phi_o; the
        default of anisotropic surfaces), a `Grid`, or keyword arguments of `Grid.from_axes`.
    cell : {"center", "average", "point"}, optional
        Values at cell centres (mirror cells of singular models hold averages), averages of all cells, or points.
    dtype : {"float32", "float64"}, optional
        Type of the stored values.
    tolerance : float, optional
        Relative error asked, in [1e-14, 0.5]; the estimate is stored beside it.
    components : bool, optional
        Store every component as its own layer.
    threads : int, optional
        Numba threads.
    progress : callable, optional
        Called with the finished share of the work.
    **parameters
        Parameters of the model by name.

    Returns
    -------
    Table
        Values in 1/sr without cosine, with provenance: parameters, error, kernel_time_s, total_time_s, cells_per_s.

    Raises
    ------
    ParameterError
        If a parameter, the grid or the tolerance is malformed.
    SingularDirectionError
        If point values are asked where the model has none.
    """
    started = time.perf_counter()
    asked = check_tolerance(tolerance)
    if str(dtype) not in ("float32", "float64"):
        raise ParameterError(f"dtype = {dtype} is not known; choose float32 or float64")
    setup = resolve(model, **parameters)
    if grid is None:
        grid = DEFAULT_GRID if setup.isotropic else DEFAULT_ANISOTROPIC
    layout = Grid.resolve(grid, cell)
    if layout.isotropic and not setup.isotropic:
        raise ParameterError(
            f"alpha_x = {setup.alpha_x:g}, alpha_y = {setup.alpha_y:g} need a grid of four axes, not "
            f"{'x'.join(map(str, layout.shape))}; give theta_i x phi_i x theta_o x phi_o, as {DEFAULT_ANISOTROPIC}"
        )
    orders = ORDERS if components else 0
    _check_memory(layout, len(setup.channels), dtype, len(component_names(setup, orders)) if components else 0)
    with thread_count(threads) as used:
        compile_time = _warm_up(setup, asked, orders, np.float64 if layout.cell == "average" else dtype)
        run, judged = _until_met(setup, layout, dtype, asked, orders, progress)
        names = component_names(setup, orders) if components else ()
        provenance = {
            "model": setup.model.name,
            "parameters": setup.parameters,
            "grid": "x".join(map(str, layout.shape)),
            "cell": layout.cell,
            "tolerance": asked,
            "components": components,
            "error": {"tolerance": asked, **judged.to_json(), **verdict(judged, asked, dtype)},
            "averaged_cells": len(run.cells) if layout.cell != "average" else layout.size,
            "method": "prepared" if run.engine.is_fast else "direct",
            **physics(setup, run.engine, asked),
            "kernel_time_s": run.kernel_time,
            "compile_time_s": compile_time,
            "total_time_s": 0.0,
            "cells_per_s": layout.size / max(run.kernel_time, 1e-9),
            "threads": used,
            "machine": machine(),
        }
    layers = dict(zip(names, run.values, strict=True)) if components else {}
    table = Table(run.total, layout, setup.channels, layers, None, provenance, __version__)
    table.provenance["total_time_s"] = time.perf_counter() - started
    return table


def _until_met(
    setup: Setup, grid: Grid, dtype: DTypeLike, tolerance: float, orders: int, progress: Progress | None
) -> tuple[_Run, Estimate]:
    """Compute with ever finer rules until the estimate is at or below the tolerance, or no finer rule is left."""
    best: tuple[_Run, Estimate] | None = None
    cost = 0.0
    floor = 1.2e-7 if np.dtype(dtype) == np.float32 else 0.0
    for asked, fast, nodes in _attempts(setup, grid, tolerance, orders):
        if best is not None and not fast and best[0].engine.is_fast is False and asked == tolerance:
            continue
        run = _Run(setup, grid, dtype, asked, orders, fast)
        run.compute(nodes, progress)
        judged = estimate(setup, grid, run.total, run.cells, tolerance, nodes)
        if judged.largest > max(tolerance, floor) and run.refine(judged.worst):
            # only the averages of the mirror cells fall short: they alone are made again
            judged = estimate(setup, grid, run.total, run.cells, tolerance, MIRROR_NODES[1])
        cost += run.kernel_time
        if best is None or judged.largest < best[1].largest:
            best = run, judged
        if best[1].largest <= max(tolerance, floor):
            break
    assert best is not None
    best[0].kernel_time = cost
    return best


def retabulate(table: Table, threads: int | None = None) -> Table:
    """Tabulate again from a table's own provenance.

    Raises
    ------
    ParameterError
        If the provenance lacks what is needed or names an unknown model or parameter.
    """
    made = table.provenance
    missing = [key for key in ("model", "parameters", "tolerance", "components") if key not in made]
    if missing:
        raise ParameterError(
            f"provenance lacks {', '.join(missing)}; only tables that brdftab tabulated can be verified"
        )
    if made["model"] not in models.names():
        raise ParameterError(f"model = {made['model']} is not known; choose one of {', '.join(models.names())}")
    return tabulate(
        made["model"],
        table.grid,
        dtype=str(table.dtype),
        tolerance=made["tolerance"],
        components=bool(made["components"]),
        threads=threads,
        **made["parameters"],
    )
