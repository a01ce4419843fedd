"""Tables made as a plan says, checked against the model itself, and made finer where the check fails."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from brdftab._version import __version__
from brdftab.evaluation import delta
from brdftab.evaluation.engine import Engine, Progress
from brdftab.evaluation.points import has_mirror_averages, is_stochastic
from brdftab.models.resolve import LUMINANCE, Setup, resolve
from brdftab.scene import albedo
from brdftab.scene.bounce_zones import engine as engine_of
from brdftab.scene.cost import mirror_nodes
from brdftab.scene.fallbacks import as_it_is, finer, is_doubtful, is_everywhere, plain, unfolded
from brdftab.scene.interpolation import interpolate
from brdftab.scene.plan import Plan, Planned, added_up
from brdftab.scene.resolution_isotropic import largest_error
from brdftab.scene.test_pairs import probes
from brdftab.system import machine
from brdftab.tables.table import Table
from brdftab.tabulation.albedo_table import AlbedoTable
from brdftab.tabulation.cell_averages import mirror_average
from brdftab.tabulation.error_estimate import cell_angles
from brdftab.tabulation.monte_carlo import LAYER
from brdftab.tabulation.provenance import ALBEDO_ANGLES
from brdftab.tabulation.refinement import MIRROR_NODES, Run
from brdftab.tabulation.tabulate import tabulate
from brdftab.timing import Clock
from brdftab.typing import Array

CHECKS = 256
# the check may find this share of what is promised; a maximum over all cells exceeds one over a few
PART = 0.33
# references ask for this share of the quadratures' own tolerance
REFERENCE = 0.25
# standard errors that are stated of estimates with noise
SIGMAS = 5.0
# cells that hold averages among those that are checked
MIRRORS = 3
DEFINITION = (
    "largest channel difference to the unplanned model by direct evaluation, over the cell's largest channel or the "
    "plan's floor, the maximum over seeded pairs of positions of the unplanned grid, looked up in the planned table"
)


def filled(plan: Plan, engine: Engine | None, progress: Progress | None = None) -> tuple[Table, Run]:
    """Return the table of a plan by quadrature, unchecked."""
    assert plan.grid is not None
    setup = plan.setup()
    # cells that hold averages do so whatever is left out
    whole = resolve(plan.model, **plan.given)
    run = Run(setup, plan.grid, plan.dtype, plan.rules, 0, True, engine or engine_of(setup, plan), whole)
    run.compute(mirror_nodes(plan), progress)
    values = added_up(run.total, plan.luminance)
    channels = ("Y",) if plan.luminance else setup.channels
    provenance: dict[str, Any] = {
        "model": plan.model,
        "parameters": plan.given,
        "tolerance": plan.tolerance,
        "components": False,
    }
    table = Table(values, plan.grid, channels, {}, None, provenance, __version__)
    # plain JSON already
    table.provenance["plan"] = plan.to_json()
    return table, run


def drawn(plan: Plan, progress: Progress | None = None) -> Table:
    """Return the table of a plan of estimates with noise; its standard errors stand beside the values."""
    table = tabulate(
        plan.model, plan.grid, dtype=plan.dtype, tolerance=plan.rules, progress=progress, **plan.parameters
    )
    spread = table.components[LAYER]
    noise = SIGMAS * float(
        (spread.max(axis=-1) / np.maximum(np.abs(table.values).max(axis=-1), plan.floor)).max(initial=0.0)
    )
    # a number of paths that was given decides the noise, not the tolerance
    items = tuple(replace(i, cell=noise, albedo=1.1 * noise) if i.name == "rules" else i for i in plan.items)
    plan = replace(plan, items=items)
    if plan.luminance:
        # channels share their paths: the errors add up at worst
        spread = (np.abs(spread) @ np.array(LUMINANCE))[..., None].astype(spread.dtype)
    channels = ("Y",) if plan.luminance else table.channels
    values = added_up(table.values, plan.luminance)
    made = dict(table.provenance) | {"parameters": plan.given, "plan": plan.to_json()}
    return Table(values, table.grid, channels, {LAYER: spread}, None, made, __version__)


def check(table: Table, plan: Plan, seed: int = 2) -> dict[str, Any]:
    """Compare looked-up values with the unplanned model at seeded pairs of directions.

    Returns
    -------
    dict
        As `Estimate.to_json`, with tolerance, met and reason.
    """
    assert plan.full is not None
    pairs = probes(plan.full, plan.floor, CHECKS, seed)
    setup = resolve(plan.model, **plan.given)
    reference = added_up(pairs.values(setup, REFERENCE * plan.rules)[0][:, 0], plan.luminance)
    found = interpolate(table, pairs.theta_i, pairs.theta_o, pairs.phi, phi_i=pairs.phi_i)
    if found.shape[1] < reference.shape[1]:
        found = np.broadcast_to(found, reference.shape)
    angles = np.stack([pairs.theta_i, pairs.theta_o, pairs.phi, pairs.phi_i])
    mirror = _mirror_cells(table, plan, setup)
    if mirror is not None:
        angles, found, reference = (
            np.concatenate(both, axis=-1 if n == 0 else 0)
            for n, both in enumerate(zip((angles, found, reference), mirror, strict=True))
        )
    scale = np.maximum(np.abs(reference).max(axis=1), plan.floor)
    error = np.abs(found - reference).max(axis=1) / scale
    worst = int(np.argmax(error))
    elsewhere = error[: pairs.theta_i.size]
    return {
        "tolerance": plan.tolerance,
        "estimate": float(error[worst]),
        "p95": float(np.quantile(error, 0.95)),
        "rms": float(math.sqrt(np.mean(error * error))),
        "cells": int(error.size),
        "away_from_mirror": float(elsewhere.max(initial=0.0)),
        "mirror_cells": 0 if mirror is None else int(mirror[0].shape[1]),
        "worst_degrees": [math.degrees(a[worst]) for a in angles],
        "definition": DEFINITION,
        "promised": plan.cell_error,
        "met": bool(error[worst] <= plan.cell_error),
        "reason": "" if error[worst] <= plan.cell_error else "no position was left out, and the quadratures leave this",
    }


def _mirror_cells(table: Table, plan: Plan, setup: Setup) -> tuple[Array, Array, Array] | None:
    """Return angles (4, K), looked-up and finer averages (K, C) of some cells that hold averages; None without any."""
    assert plan.full is not None
    if not has_mirror_averages(setup) or plan.full.cell != "center":
        return None
    cells = np.asarray(plan.full.mirror_cells()).reshape(-1, len(plan.full.shape))
    if not len(cells):
        return None
    some = cells[np.unique(np.linspace(0, len(cells) - 1, MIRRORS).round().astype(int))]
    engine = Engine(setup, REFERENCE * plan.rules, fast=False)
    # other nodes than the table's own, where finer ones than the finest would take long
    nodes = min(mirror_nodes(plan) + 1, MIRROR_NODES[0] + 1)
    reference = added_up(mirror_average(engine, plan.full, some, nodes)[:, 0], plan.luminance)
    ti, to, phi, az = cell_angles(plan.full, some)
    found = interpolate(table, ti, to, phi, phi_i=az)
    return np.stack([ti, to, phi, az]), np.broadcast_to(found, reference.shape), reference.astype(np.float64)


def carry_out(planned: Planned, progress: Progress | None = None) -> Table | AlbedoTable:
    """Make the table of a planned material.

    Where the check finds more than a third of the promised error, the table is made again with more positions, then
    with all that the scene sees, and at last without symmetry; the plan in the file is the one that was followed.

    Returns
    -------
    Table or AlbedoTable
        With the plan in its provenance.
    """
    clock = Clock()
    plan = planned.plan
    if plan.quantity == "albedo" and plan.cosines:
        return albedo.make(planned)
    if is_stochastic(plan.setup()):
        return drawn(plan, progress)
    kernel = 0.0
    for attempt in (as_it_is, finer, plain, unfolded):
        if attempt is unfolded and not plan.symmetric:
            break
        planned = attempt(planned)
        plan = planned.plan
        table, run = filled(plan, planned.engine, progress)
        kernel += run.kernel_time
        allowed = PART * plan.cell_error
        thinned = "resolution" in {i.name for i in plan.items}
        seen = largest_error(run.engine, table, plan, 3) if thinned else 0.0
        if seen > allowed:
            continue
        error = check(table, plan)
        if error["estimate"] <= allowed:
            break
        if plan.symmetric and error["away_from_mirror"] > plan.cell_error:
            # positions on the edges of a model's bins: rounding alone decides, and reflections are not the same
            continue
        if not any(map(is_doubtful, plan.items)):
            break
        if error["away_from_mirror"] <= allowed and not any(map(is_everywhere, plan.items)):
            # more positions do not mend averages
            break
    setup: Setup = plan.setup()
    table.provenance |= {
        "grid": "x".join(map(str, table.grid.shape)),
        "cell": table.grid.cell,
        "error": error,
        "averaged_cells": len(run.cells),
        "delta": delta.described(resolve(plan.model, **plan.given), table.grid, ALBEDO_ANGLES),
        "method": run.method,
        "variant": setup.model.variant,
        "citation": setup.model.citation,
        "doi": setup.model.doi,
        "kernel_time_s": kernel,
        "planning_time_s": planned.seconds,
        "total_time_s": planned.seconds + clock.seconds,
        "machine": machine(),
    }
    return table


def repeat(table: Table) -> Table:
    """Make a planned table again from the plan that it holds, following it as it is."""
    plan = Plan.from_json(table.provenance["plan"])
    if is_stochastic(plan.setup()):
        return drawn(plan)
    return filled(plan, None)[0]
