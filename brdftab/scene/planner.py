"""From a material of a scene to its plan."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from brdftab.errors import GridError, ParameterError
from brdftab.evaluation.points import is_stochastic
from brdftab.models.resolve import Setup, luminance
from brdftab.scene import albedo, scratch_layers
from brdftab.scene.bounce_zones import fewer_near_the_normal
from brdftab.scene.cost import half_of, stored
from brdftab.scene.plan import SHARES, Item, Plan, Planned
from brdftab.scene.positions import both, resolved, share_saved
from brdftab.scene.scene import Material, Scene
from brdftab.scene.simplify import reduced
from brdftab.scene.subgrid import quarter, reached
from brdftab.scene.test_pairs import probes
from brdftab.tables.grid import Grid
from brdftab.tabulation.tabulate import default_grid
from brdftab.timing import Clock

PAIRS = 192
# a share of the quadratures' own tolerance that estimates with noise ask, so that five standard errors stay below
NOISE = 0.2


def budget(material: Material) -> tuple[float, float]:
    """Return tolerance of a cell and floor (1/sr) that keep the albedo's error below its own tolerance, too.

    An error below t f + t floor everywhere changes an albedo by at most t E + t pi floor; E of a colour reaches 1.1.
    """
    floor = material.floor
    most = material.albedo_tolerance / (1.1 + math.pi * floor)
    return min(material.tolerance, most), floor


def _whole(material: Material, setup: Setup) -> Grid:
    """Return the grid that would be taken without a plan."""
    try:
        whole = Grid.resolve(material.grid or default_grid(setup))
    except GridError as error:
        raise GridError(f"{material.name}: grid = {material.grid!r}: {error}") from None
    if whole.isotropic and not setup.isotropic:
        raise ParameterError(
            f"{material.name}: grid = {material.grid} has three axes, but {setup.model.name} has a direction of its "
            "own here; give theta_i x phi_i x theta_o x phi_o, as 15x24x15x24"
        )
    return whole


def plan_material(material: Material) -> Planned:
    """Plan one material.

    Raises
    ------
    ParameterError
        If its grid or ranges do not go with the model.
    """
    clock = Clock()
    setup = material.setup()
    noisy = is_stochastic(setup)
    if material.quantity == "albedo" and setup.isotropic and not noisy:
        planned = albedo.plan(material, setup)
        planned.seconds = clock.seconds
        return planned
    whole = _whole(material, setup)
    near = reached(whole, material)
    tolerance, floor = budget(material)
    items = []
    if near.size < whole.size:
        saved = share_saved(whole.size, near.size)
        items.append(Item("directions", _told(whole, near), "exact", time=saved, size=saved))
    rules = SHARES["rules"] * tolerance if not noisy else NOISE * tolerance
    small, more, summed = reduced(setup, material, probes(near, floor, PAIRS, 1), tolerance)
    items += more
    computed = luminance(small) if summed else small
    grid, symmetric = near, False
    fourth = None if noisy else quarter(computed, near, rules)
    if fourth is not None:
        saved = share_saved(near.size, fourth.size)
        told = f"{fourth.shape[1]} of {near.shape[1]} azimuths of the light: the surface is symmetric about both axes"
        items.append(Item("symmetry", told, "exact", time=saved, size=saved))
        grid, symmetric = fourth, True
    used = sum(item.cell for item in items if item.name == "bounces")
    near_normal = fewer_near_the_normal(computed, grid, lambda some: probes(some, floor, PAIRS, 5), tolerance, used)
    zones, more = ((), []) if near_normal is None else (near_normal[0], [near_normal[1]])
    items += more
    if near.isotropic and near.square and not near.below and setup.model.reciprocal and not noisy:
        told = "f is the same with light and view exchanged: of each two polar angles one order is stored"
        items.append(Item("reciprocity", told, "exact", size=1.0 - half_of(near)))
    plan = Plan(
        model=setup.model.name,
        given=setup.parameters,
        parameters=small.parameters,
        luminance=summed,
        quantity=material.quantity,
        grid=grid,
        full=near,
        whole=whole,
        symmetric=symmetric,
        zones=zones,
        floor=floor,
        tolerance=tolerance,
        rules=rules,
        dtype=material.dtype,
        items=(*items, Item("rules", _rules(rules, noisy), "measured", *both(5.0 * rules if noisy else rules))),
    )
    planned = Planned(material, plan)
    if not noisy:
        planned = resolved(planned, computed)
    planned.plan = replace(planned.plan, predicted=stored(planned.plan, setup) | planned.plan.predicted)
    planned.seconds = clock.seconds
    return planned


def _rules(rules: float, noisy: bool) -> str:
    if noisy:
        return f"as many paths as a standard error of {rules:.1e} takes; stated are five of them"
    return f"quadratures, nodes and modes for an error of {rules:.1e}"


def _told(whole: Grid, near: Grid) -> str:
    ends = []
    for name in ("theta_i", "theta_o"):
        axis = near.axes[name]
        if axis.size < whole.axes[name].size:
            ends.append(f"{name} {math.degrees(axis[0]):g} to {math.degrees(axis[-1]):g} degrees")
    return "no light or view outside " + ", ".join(ends)


def plan_scene(scene: Scene) -> list[Planned]:
    """Plan all materials of a scene.

    Raises
    ------
    ParameterError
        If a material is malformed, or what the plan needs exceeds the scene's memory or files.
    """
    found = [scratch_layers.plan(m) if m.layers else plan_material(m) for m in scene.materials]
    total = 0.0
    for planned in found:
        size = planned.plan.predicted.get("bytes", 0.0)
        if 2.0 * size > scene.memory:
            raise ParameterError(
                f"memory = {scene.memory / 1e6:.3g} MB is too little for {planned.material.name}, which needs "
                f"{2.0 * size / 1e6:.3g} MB; raise it, or the tolerance, or narrow the ranges"
            )
        total += size
    if total > scene.files:
        raise ParameterError(
            f"files = {scene.files / 1e6:.3g} MB is too little for the scene's {total / 1e6:.3g} MB; raise it, or the "
            "tolerance, or narrow the ranges"
        )
    return found


def as_json(planned: Planned) -> dict[str, Any]:
    """Return what is told of a planned material as plain JSON."""
    return {"name": planned.material.name, "planning_s": planned.seconds, **planned.plan.to_json()}
