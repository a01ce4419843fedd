"""What a plan predicts: run time and bytes, beside those of the unplanned grid."""

from __future__ import annotations

from brdftab.grid import Grid
from brdftab.models.setup import Setup
from brdftab.scene.plan import Plan


def half_of(grid: Grid) -> float:
    """Return the share of a square grid with theta_o <= theta_i."""
    return 0.5 * (1.0 + 1.0 / grid.theta_i.size)


def seconds(plan: Plan, build: float, rate: tuple[float, float]) -> dict[str, float]:
    """Return the seconds that the table takes, and that of the whole grid without the plan."""
    if rate == (0.0, 0.0):
        return {}
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
    return {"seconds": build + planned, "seconds_unplanned": slower * (build + whole)}


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
