"""Plans of surfaces with a grain: fewer bounces near the normal, and positions on four axes."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from brdftab.models.resolve import LUMINANCE, resolve
from brdftab.scene import carry_out, expand, interpolate, parse, plan_material, verify
from brdftab.scene.bounce_zones import Zoned, within
from brdftab.scene.cubic import matrix
from brdftab.scene.execute import filled
from brdftab.scene.plan import SHARES, Plan
from brdftab.scene.subgrid import part
from brdftab.tables.grid import Grid


def material(**keys):
    return parse({"material": [keys]}).materials[0]


def item(plan, name, kind="measured"):
    return next((i for i in reversed(plan.items) if i.name == name and i.kind == kind), None)


# ---------------------------------------------------------------- bounces near the normal

GROOVES = {"model": "vgroove-nonsym", "theta_i": [0, 60], "theta_o": [0, 60], "grid": "9x8x9x8"}
STEEP = {"alpha_x": 0.15, "alpha_y": 0.25, "f0": 0.5}


def test_second_bounces_are_left_out_near_the_normal():
    one = material(**GROOVES, parameters=STEEP)
    plan = plan_material(one).plan
    ((limit, cap),) = plan.zones
    assert cap == 1
    assert math.radians(15.0) < limit < math.radians(45.0)
    told = item(plan, "bounces")
    assert "near the normal" in told.told
    assert sum(i.cell for i in plan.items if i.name == "bounces") <= SHARES["bounces"] * one.tolerance
    assert told.time > 0.0
    table = carry_out(plan_material(one))
    assert table.provenance["error"]["met"]
    # the table is the one without zones but for what the plan says, and keeps the promise beside all bounces
    whole, full = (filled(replace(plan, zones=(), parameters=p), None)[0] for p in (plan.parameters, plan.given))
    error, beside = (
        (np.abs(table.values - other.values) / np.maximum(other.values, plan.floor))[..., 0] for other in (whole, full)
    )
    assert beside.max() < plan.cell_error
    inside = within(plan.grid, limit).shape
    assert 0.0 < error[: inside[0], :, : inside[2]].max() <= told.cell
    assert error[inside[0] :].max() == 0.0
    assert error[:, :, inside[2] :].max() == 0.0
    assert Plan.from_json(json.loads(json.dumps(plan.to_json()))).zones == plan.zones


def test_rough_grooves_keep_their_bounces_everywhere():
    rough = {**GROOVES, "grid": "6x8x6x8", "parameters": {"alpha_x": 0.4, "alpha_y": 0.6, "f0": 0.5}}
    assert all(cap > 1 and limit < math.radians(10.0) for limit, cap in plan_material(material(**rough)).plan.zones)
    # where lights and views are all near the normal, there is no need of zones: single bounces are enough
    near = {**GROOVES, "theta_i": [0, 20], "theta_o": [0, 20], "parameters": {**STEEP, "alpha_y": 0.2}}
    plan = plan_material(material(**near)).plan
    assert (plan.zones, plan.parameters.get("max_bounces")) == ((), 1)


def test_each_pair_has_the_bounces_of_its_zone():
    setup = resolve("vgroove-nonsym", alpha_x=0.3, alpha_y=0.6, f0=0.5)
    ti, to = np.radians([[10.0, 10.0, 40.0, 70.0], [5.0, 40.0, 10.0, 5.0]])
    phi, az = np.array([0.3, 2.0, 1.0, 3.0]), np.array([0.2, 0.4, 1.3, 2.0])
    zoned = Zoned(setup, 1e-6, ((math.radians(20), 1), (math.radians(50), 2)))
    caps = (1, 2, 2, None)
    expected = [
        Zoned(resolve("vgroove-nonsym", alpha_x=0.3, alpha_y=0.6, f0=0.5, max_bounces=cap), 1e-6, ()).points(
            *(a[n : n + 1] for a in (ti, to, phi, az))
        )
        for n, cap in enumerate(caps)
    ]
    assert np.allclose(zoned.points(ti, to, phi, az), np.concatenate(expected), rtol=1e-12, atol=0)
    more = Zoned(setup, 1e-6, ()).points(ti, to, phi, az)
    assert np.all(more[:2] > zoned.points(ti, to, phi, az)[:2])


def test_luminance_has_zones_too():
    keys = {**GROOVES, "quantity": "luminance", "parameters": {**STEEP, "f0": [0.5, 0.6, 0.7]}}
    one = material(**keys)
    plan = plan_material(one).plan
    assert plan.luminance
    assert plan.zones
    table = filled(plan, None)[0]
    colour = filled(replace(plan, luminance=False), None)[0]
    assert table.channels == ("Y",)
    assert np.allclose(table.values[..., 0], colour.values @ np.array(LUMINANCE), rtol=1e-5)


# ---------------------------------------------------------------- positions on four axes


def test_cubics_go_around():
    x = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    fine = np.linspace(0.0, 2.0 * math.pi, 97, endpoint=False)
    around = matrix(x, fine, period=2.0 * math.pi)
    # cos x by cubics 15 degrees apart leaves 3/128 h^4 = 1.1e-4
    assert np.abs(around @ np.cos(x) - np.cos(fine)).max() < 1.2e-4
    assert np.abs(matrix(x, fine) @ np.cos(x) - np.cos(fine)).max() > 5e-4
    assert np.allclose(around.sum(axis=1), 1.0)
    # one position stands for all
    assert np.allclose(matrix(x[:1], fine, period=2.0 * math.pi), 1.0)


@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("smith", {"alpha_x": 0.5, "alpha_y": 0.8, "f0": 0.5}),
        ("ashikhmin-shirley", {"nu": 3.0, "nv": 2.0, "kd": 0.9, "f0": 0.04}),
    ],
)
def test_fine_grids_of_four_axes_lose_positions_and_keep_the_promise(model, parameters):
    one = material(model=model, parameters=parameters, grid="36x36x36x36", theta_i=[0, 60], theta_o=[0, 60], floor=1e-3)
    planned = plan_material(one)
    plan = planned.plan
    assert plan.symmetric
    kept = item(plan, "resolution")
    assert kept is not None
    assert plan.grid.size < 0.7 * plan.folded.size
    assert plan.folded.size == plan.full.size // 4
    assert plan.predicted["seconds"] < plan.predicted["seconds_unplanned"]
    table = carry_out(planned)
    found = verify(one, table)
    assert found["holds"], found
    assert table.provenance["error"]["met"]
    # as a product of four interpolations and one by one
    whole, rng = expand(table), np.random.default_rng(1)
    place = tuple(rng.integers(0, n, 40) for n in whole.grid.shape)
    ti, pi_, to, po = (whole.grid.axes[name][at] for name, at in zip(whole.grid.axis_names, place, strict=True))
    assert np.allclose(interpolate(table, ti, to, po - pi_, phi_i=pi_), whole.values[place], rtol=1e-6)


def test_an_effort_that_fails_starts_from_all_positions():
    from brdftab.scene.fallbacks import finer, plain

    one = material(
        model="smith", parameters={"alpha_x": 0.5, "alpha_y": 0.8, "f0": 0.5}, grid="36x36x36x36",
        theta_i=[0, 60], theta_o=[0, 60], floor=1e-3,
    )  # fmt: skip
    planned = plan_material(one)
    more = finer(planned).plan.grid
    assert planned.plan.grid.size < more.size
    assert plain(planned).plan.grid == planned.plan.folded


def test_coarse_and_singular_tables_of_four_axes_keep_all_positions():
    coarse = material(model="smith", parameters={"alpha_x": 0.5, "alpha_y": 0.8}, grid="9x16x9x16")
    assert item(plan_material(coarse).plan, "resolution") is None
    grooves = material(
        model="vgroove-sym", parameters={"alpha_x": 0.6, "alpha_y": 0.8, "material": "mirror"}, grid="30x36x30x36",
        theta_i=[0, 30], theta_o=[0, 30], floor=1e-2,
    )  # fmt: skip
    assert item(plan_material(grooves).plan, "resolution") is None


def test_parts_of_a_grid_by_polar_angle():
    grid = Grid.parse("9x8x9x8")
    assert within(grid, math.radians(45.0)).shape == (5, 8, 5, 8)
    assert within(grid, math.radians(4.0)) is None
    assert within(part(grid, {"theta_o": np.array([0, 1])}), math.radians(45.0)).shape == (5, 8, 2, 8)
