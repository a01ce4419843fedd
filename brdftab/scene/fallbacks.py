"""What is tried where a planned table misses its promise: more positions, then all, at last without symmetry."""

from __future__ import annotations

from dataclasses import replace

from brdftab.models.resolve import resolve
from brdftab.scene.plan import Item, Planned
from brdftab.scene.positions import resolved, with_margin


def is_doubtful(item: Item) -> bool:
    """Tell whether an item rests on probes and can be given up."""
    return item.kind == "measured" and item.name != "rules"


def is_everywhere(item: Item) -> bool:
    """Tell whether giving up an item can change averages at the mirror direction, too."""
    return is_doubtful(item) and item.name != "resolution"


def as_it_is(planned: Planned) -> Planned:
    """Return the plan."""
    return planned


def finer(planned: Planned) -> Planned:
    """Return the plan with more positions, where it left some out."""
    if not any(item.name == "resolution" for item in planned.plan.items):
        return planned
    return resolved(planned, planned.plan.setup(), 1)


def plain(planned: Planned) -> Planned:
    """Return the plan with only what costs nothing left out."""
    plan = planned.plan
    setup = plan.setup()
    given = plan.given
    if len(setup.channels) < len(resolve(plan.model, **given).channels) and not plan.luminance:
        # equal channels stay one
        given = {
            name: plan.parameters.get(name, value) if isinstance(value, list) else value
            for name, value in given.items()
        }
    items = with_margin(tuple(item for item in plan.items if not is_doubtful(item)), plan.tolerance)
    new = replace(plan, parameters=given, grid=plan.folded, apart=0, zones=(), items=items)
    return Planned(planned.material, new, None, planned.seconds)


def unfolded(planned: Planned) -> Planned:
    """Return the plan with every azimuth of the light."""
    plan = planned.plan
    items = with_margin(tuple(item for item in plan.items if item.name != "symmetry"), plan.tolerance)
    new = replace(plan, grid=plan.full, symmetric=False, items=items)
    return Planned(planned.material, new, planned.engine, planned.seconds)
