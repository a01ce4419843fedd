"""model x grid -> Table, with its estimated error and what it cost."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numba
from numpy.typing import DTypeLike

from brdftab import system
from brdftab._version import __version__
from brdftab.errors import GridError, ParameterError
from brdftab.evaluation.engine import Progress
from brdftab.evaluation.points import ORDERS, check_tolerance, is_stochastic
from brdftab.models.resolve import Setup, component_names, resolve
from brdftab.system import machine
from brdftab.tables.grid import Grid
from brdftab.tables.table import Table
from brdftab.tabulation.error_estimate import Estimate
from brdftab.tabulation.monte_carlo import LAYER, Drawn, Spread, draw
from brdftab.tabulation.provenance import physics, verdict
from brdftab.tabulation.refinement import Run, until_met
from brdftab.tabulation.row_energies import energies
from brdftab.timing import Clock

DTYPES = ("float32", "float64")
DEFAULT_GRID = "90x90x180"
DEFAULT_ANISOTROPIC = "15x24x15x24"
DEFAULT_BELOW = "45x45+45x90"
TOLERANCE = 1e-3


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


def _check_memory(grid: Grid, channels: int, dtype: DTypeLike, layers: int) -> None:
    """Refuse a table that the machine cannot hold, rather than let the system end the process."""
    needed, there = grid.nbytes(channels, dtype) * (layers + 1), system.offered()
    if needed > there:
        raise GridError(
            f"grid = {'x'.join(map(str, grid.shape))} needs {needed / 2**30:.3g} GiB, outside the "
            f"{there / 2**30:.3g} GiB that this machine offers; ask for a coarser grid, float32 or no components"
        )


def _energy(run: Run | Drawn, judged: Estimate | Spread, tolerance: float) -> dict[str, Any] | None:
    """Return the light that rows of a table hold beside their albedo; None of points, of estimates with noise."""
    if isinstance(judged, Spread):
        return None
    if run.grid.cell != "center":
        return judged.energy
    return energies(run.setup, run.grid, run.total, tolerance, run.engine if run.engine.layers == 1 else None)


def default_grid(setup: Setup) -> str:
    """Return the grid that is taken where none is given."""
    if not setup.isotropic:
        return DEFAULT_ANISOTROPIC
    return DEFAULT_BELOW if setup.transmits else DEFAULT_GRID


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
        default of anisotropic surfaces), ``"45x45+45x90"`` (views above and below the surface; the default of surfaces
        that transmit), a `Grid`, or keyword arguments of `Grid.from_axes`.
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
    clock = Clock()
    asked = check_tolerance(tolerance)
    if str(dtype) not in DTYPES:
        raise ParameterError.not_known("dtype", dtype, DTYPES)
    setup = resolve(model, **parameters)
    layout = Grid.resolve(default_grid(setup) if grid is None else grid, cell)
    if layout.isotropic and not setup.isotropic:
        rough = setup.model.roughness
        why = (
            f"model = {setup.model.name} has a direction of its own and needs"
            if setup.model.grain
            else f"{rough}_x = {setup.alpha_x:g}, {rough}_y = {setup.alpha_y:g} need"
        )
        raise ParameterError(
            f"{why} a grid of four axes, not "
            f"{'x'.join(map(str, layout.shape))}; give theta_i x phi_i x theta_o x phi_o, as {DEFAULT_ANISOTROPIC}"
        )
    if layout.below and not setup.transmits:
        far = math.degrees(max(layout.theta_i[-1], layout.theta_o[-1]))
        raise ParameterError(
            f"grid reaches theta = {far:g} degrees, below the surface, where {setup.model.name} sends no light; stay "
            "within [0, 90], or take smith-multi with ior, which transmits"
        )
    orders = ORDERS if components else 0
    _check_memory(layout, len(setup.channels), dtype, len(component_names(setup, orders)) if components else 0)
    with thread_count(threads) as used:
        compute = draw if is_stochastic(setup) else until_met
        run, judged = compute(setup, layout, dtype, asked, orders, progress)
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
            "method": run.method,
            **physics(setup, run.engine, asked, layout),
            "energy": _energy(run, judged, asked),
            "kernel_time_s": run.kernel_time,
            "compile_time_s": clock.compiling,
            "total_time_s": 0.0,
            "cells_per_s": layout.size / max(run.kernel_time, 1e-9),
            "threads": used,
            "machine": machine(),
        }
    layers = dict(zip(names, run.values, strict=True)) if components else {}
    if isinstance(run, Drawn):
        layers[LAYER] = run.standard_error
    table = Table(run.total, layout, setup.channels, layers, None, provenance, __version__)
    # the albedo above compiles kernels, too
    table.provenance |= {"compile_time_s": clock.compiling, "total_time_s": clock.seconds}
    return table
