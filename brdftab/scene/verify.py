"""The true error of a planned table: every position of the unplanned grid, tabulated without a plan."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from brdftab.evaluation.points import is_stochastic
from brdftab.models.resolve import resolve
from brdftab.scene import albedo
from brdftab.scene.execute import carry_out
from brdftab.scene.interpolation import expanded
from brdftab.scene.plan import Plan, added_up
from brdftab.scene.planner import plan_material
from brdftab.scene.scene import Material
from brdftab.tables.grid import Grid
from brdftab.tables.table import Table
from brdftab.tabulation.albedo_table import AlbedoTable
from brdftab.tabulation.monte_carlo import LAYER
from brdftab.tabulation.tabulate import tabulate
from brdftab.timing import Clock
from brdftab.typing import Array

# the unplanned table is made this much finer than the plan's quadratures
FINER = 0.1


def _albedos(values: Array, grid: Grid) -> Array:
    """Return sums over the views of f cos(theta_o) domega for each light, (..., C)."""
    edges = grid.theta_o_edges
    if grid.phi is not None and grid.phi_edges is not None:
        share = np.abs(np.diff(np.sin(edges) ** 2))
        weight = share[:, None] * np.diff(grid.phi_edges)
        return np.einsum("iopc,op->ic", values, weight)
    assert grid.phi_o_edges is not None
    weight = 0.5 * np.abs(np.diff(np.sin(edges) ** 2))[:, None] * np.diff(grid.phi_o_edges)
    return np.einsum("iaopc,op->iac", values, weight)


def _within(table: Table, part: Grid) -> Array:
    """Return the values (float64) of an unplanned table at the positions of a part of its grid."""
    index = [np.searchsorted(table.grid.axes[n], part.axes[n] - 1e-9) for n in part.axis_names]
    return table.values[np.ix_(*index)].astype(np.float64)


def verify(material: Material, table: Table | AlbedoTable, *, timed: bool = False) -> dict[str, Any]:
    """Measure the true error of a planned table.

    Parameters
    ----------
    material : Material
        The material of the scene.
    table : Table or AlbedoTable
        From `carry_out`.
    timed : bool
        Also tabulate without a plan at the scene's own tolerance and state the ratio of run times.

    Returns
    -------
    dict
        cell_error, albedo_error (measured), promised (both), holds, worst_degrees; with `timed` also seconds,
        seconds_unplanned.
    """
    plan = Plan.from_json(table.provenance["plan"])
    promised = {"cell_error": plan.cell_error, "albedo_error": plan.albedo_error}
    if isinstance(table, AlbedoTable):
        found: dict[str, Any] = {"cell_error": 0.0, "albedo_error": albedo.error(table, plan, material)}
        holds = found["albedo_error"] <= promised["albedo_error"]
    else:
        found = _cells(plan, table)
        rounding = 2e-7 if plan.dtype == "float32" else 1e-15
        # the sums of both grids differ by the error of cells below the floor, too
        slack = plan.cell_error * math.pi * plan.floor
        holds = (
            found["cell_error"] <= promised["cell_error"] + rounding
            and found["albedo_error"] <= promised["albedo_error"] + slack + rounding
        )
    found |= {"promised": promised, "holds": bool(holds)}
    if timed:
        found |= _timed(plan, table, material)
    return found


def _cells(plan: Plan, table: Table) -> dict[str, Any]:
    """Return measured errors of cells and albedos."""
    assert plan.full is not None
    setup = resolve(plan.model, **plan.given)
    noisy = is_stochastic(setup)
    reference = tabulate(
        plan.model, plan.whole, dtype="float64", tolerance=plan.rules if noisy else FINER * plan.rules, **plan.given
    )
    right: Array = added_up(_within(reference, plan.full), plan.luminance).astype(np.float64)
    mine: Array = np.broadcast_to(expanded(table, plan.full), right.shape)
    scale = np.maximum(np.abs(right).max(axis=-1), plan.floor)
    error = np.abs(mine - right).max(axis=-1)
    if noisy:
        # the unplanned table is as noisy: its own five standard errors are granted beside
        spread = _within(Table(reference.components[LAYER], reference.grid, reference.channels, {}), plan.full)
        error = np.maximum(error - 5.0 * added_up(spread, plan.luminance).max(axis=-1), 0.0)
    error = error / scale
    worst = np.unravel_index(int(np.argmax(error)), error.shape)
    albedos = np.abs(_albedos(mine, plan.full) - _albedos(right, plan.full))
    return {
        "cell_error": float(error[worst]),
        "albedo_error": float(albedos.max()),
        "worst_degrees": {
            name: math.degrees(plan.full.axes[name][k]) for name, k in zip(plan.full.axis_names, worst, strict=True)
        },
    }


def _timed(plan: Plan, table: Table | AlbedoTable, material: Material) -> dict[str, float]:
    """Return run times with and without the plan, planning and checks included, kernels compiled."""
    clock = Clock()
    carry_out(plan_material(material))
    planned = clock.seconds
    clock = Clock()
    # who looks up albedos without a plan has a table of directions, too
    tabulate(plan.model, material.grid or None, dtype=material.dtype, tolerance=material.tolerance, **plan.given)
    return {"seconds": planned, "seconds_unplanned": clock.seconds}
