"""What a plan predicts: run time and bytes, beside those of the unplanned grid."""

from __future__ import annotations

import numpy as np

from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import Setup
from brdftab.scene.plan import Plan
from brdftab.tables.grid import Grid
from brdftab.tabulation.cell_averages import mirror_average
from brdftab.tabulation.refinement import MIRROR_NODES, singular_cells
from brdftab.timing import Clock

# nodes of mirror cells from a tolerance on: with three axes 4 leave up to 2e-4 of a cell, with four axes, whose cells
# are wide, 6 leave 9e-4, 7 leave 3e-4 and 9 leave 1e-4
MIRROR_RULES = {
    True: ((2e-3, 4), (5e-4, MIRROR_NODES[0]), (0.0, MIRROR_NODES[1])),
    False: ((4e-3, 6), (2e-3, MIRROR_NODES[0]), (0.0, MIRROR_NODES[1])),
}
# mirror cells that are timed
TIMED = 2


def mirror_nodes(plan: Plan) -> int:
    """Return the nodes along each coordinate of a cell that holds the mirror direction."""
    assert plan.grid is not None
    return next(nodes for least, nodes in MIRROR_RULES[plan.grid.isotropic] if plan.tolerance >= least)


def averages(engine: Engine, plan: Plan) -> tuple[float, float]:
    """Return the seconds that averages over mirror cells take in the plan's table, and in that of the whole grid."""
    assert plan.grid is not None
    assert plan.whole is not None
    counts = [len(singular_cells(engine.setup, grid)) for grid in (plan.grid, plan.whole)]
    if not counts[0] or plan.grid.cell != "center":
        return 0.0, 0.0
    cells, nodes = singular_cells(engine.setup, plan.grid), mirror_nodes(plan)
    some = cells[np.unique(np.linspace(0, len(cells) - 1, TIMED).round().astype(int))]
    clock = Clock()
    mirror_average(engine, plan.grid, some, nodes)
    one = clock.seconds / len(some)
    finer = (MIRROR_NODES[0] / nodes) ** (3 if plan.grid.isotropic else 4)
    return counts[0] * one, counts[1] * one * finer


def half_of(grid: Grid) -> float:
    """Return the share of a square grid with theta_o <= theta_i."""
    return 0.5 * (1.0 + 1.0 / grid.theta_i.size)


def seconds(engine: Engine, plan: Plan, build: float, rate: tuple[float, float]) -> dict[str, float]:
    """Return the seconds that the table takes, and that of the whole grid without the plan."""
    assert plan.grid is not None
    assert plan.whole is not None
    slower = 1.0
    for item in plan.items:
        if item.name in ("wavelengths", "bounces", "lobe"):
            slower /= max(1.0 - item.time, 0.05)
    planned, whole = (
        (rate[0] * grid.size + rate[1] * grid.theta_i.size * grid.theta_o.size) * (0.5 if grid.square else 1.0)
        for grid in (plan.grid, plan.whole)
    )
    means = averages(engine, plan)
    return {"seconds": build + planned + means[0], "seconds_unplanned": slower * (build + whole + means[1])}


def stored(plan: Plan, setup: Setup) -> dict[str, float]:
    """Return the bytes of the values in the plan's file, and in that of the unplanned setup."""
    assert plan.grid is not None
    assert plan.whole is not None
    channels = 1 if plan.luminance else len(plan.setup().channels)
    share = 1.0
    for item in plan.items:
        if item.name == "reciprocity":
            share *= half_of(plan.grid)
        elif item.name == "channels" and channels > 1:
            share *= 1.0 - item.size
    return {
        "bytes": share * plan.grid.nbytes(channels, plan.dtype),
        "bytes_unplanned": float(plan.whole.nbytes(len(setup.channels), plan.dtype)),
    }
