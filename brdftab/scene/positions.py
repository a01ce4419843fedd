"""The positions of a planned table: chosen by lines of directions, with more effort by more lines."""

from __future__ import annotations

from dataclasses import replace

from brdftab.models.resolve import Setup
from brdftab.scene.bounce_zones import engine as engine_of
from brdftab.scene.cost import seconds
from brdftab.scene.plan import SHARES, Item, Planned
from brdftab.scene.resolution_anisotropic import keep_azimuths
from brdftab.scene.resolution_isotropic import keep, pace
from brdftab.timing import Clock

# what interpolation may cost as a share of what it is granted, and how many times as many lines are looked at, at first
# and where a check fails; edges between the lines are not seen, and kinked models have them
EFFORTS = {False: ((0.5, 1), (0.25, 6)), True: ((0.25, 6), (0.12, 9))}


def share_saved(before: int, after: int) -> float:
    """Return the share that a smaller count saves."""
    return 1.0 - after / max(before, 1)


def both(cell: float) -> tuple[float, float]:
    """Return the error of a cell with the error of the albedo that it allows."""
    return cell, 1.1 * cell


def with_margin(items: tuple[Item, ...], tolerance: float) -> tuple[Item, ...]:
    """Return items of which the last that is measured takes up what the others leave of the tolerance."""
    last = max(n for n, item in enumerate(items) if item.name in ("rules", "resolution"))
    rest = tolerance - sum(item.cell for n, item in enumerate(items) if n != last)
    if rest <= items[last].cell:
        return items
    cell, albedo = both(rest)
    return (*items[:last], replace(items[last], cell=cell, albedo=albedo), *items[last + 1 :])


def resolved(planned: Planned, setup: Setup, effort: int = 0) -> Planned:
    """Choose the positions of a plan's table; with more effort by more lines, each to a smaller error."""
    plan, clock = planned.plan, Clock()
    assert plan.full is not None
    assert plan.grid is not None
    engine = planned.engine or engine_of(setup, plan)
    build = clock.seconds
    share, times = EFFORTS[setup.kinked][effort]
    items = tuple(item for item in plan.items if item.name != "resolution")
    grid, apart, rate = plan.grid, 0, (0.0, 0.0)
    if not plan.full.below:
        before, allowed = plan.folded, SHARES["resolution"] * plan.tolerance
        asked = (share * allowed, plan.floor, plan.dtype, times)
        if before.isotropic:
            found = keep(engine, before, *asked)
        else:
            found = keep_azimuths(engine, before, plan.symmetric, *asked)
        grid, rate = found.grid, (found.rate, found.step)
        if grid.size < before.size:
            apart, saved = found.apart, share_saved(before.size, grid.size)
            told = f"{'x'.join(map(str, grid.shape))} positions, with cubics in log f between them"
            items = (*items, Item("resolution", told, "measured", *both(allowed), time=saved, size=saved))
    if rate == (0.0, 0.0):
        rate = (pace(engine, plan.folded, plan.dtype), 0.0)
    items = with_margin(items, plan.tolerance)
    predicted = seconds(engine, replace(plan, grid=grid, items=items), build, rate)
    new = replace(plan, grid=grid, apart=apart, items=items, predicted=plan.predicted | predicted)
    return Planned(planned.material, new, engine, planned.seconds)
