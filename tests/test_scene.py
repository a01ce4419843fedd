"""Scenes: plans, the tables that follow them, their promises over random scenes, files, the cache, the commands."""

import json
import math
import multiprocessing
import os
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from random_scenes import scenes

import brdftab
from brdftab.cli import main
from brdftab.errors import BrdftabError, FileFormatError
from brdftab.scene import cache, carry_out, expand, interpolate, parse, plan_material, plan_scene, verify
from brdftab.scene.albedo import interpolate_albedo
from brdftab.scene.cubic import choose, matrix, to_log
from brdftab.scene.interpolation import expanded
from brdftab.scene.plan import SHARES, Plan
from brdftab.scene.subgrid import part
from brdftab.tables.grid import Grid

D = math.pi / 180.0
CHEAP = ("lambert", "oren-nayar", "cook-torrance", "smith", "ashikhmin-shirley", "vgroove-sym")


def material(**keys):
    return parse({"material": [keys]}).materials[0]


def made(**keys):
    one = material(**keys)
    planned = plan_material(one)
    return one, planned.plan, carry_out(planned)


def test_shares_add_up():
    assert sum(SHARES.values()) == 1.0


# ---------------------------------------------------------------- the promise


@pytest.mark.parametrize("seed", range(10))
def test_measured_errors_keep_the_promise(seed):
    """200 random materials in all, every cell of the unplanned grid."""
    for one in scenes(20, seed, names=CHEAP, grooves=False):
        planned = plan_material(one)
        found = verify(one, carry_out(planned))
        assert found["holds"], (one, found)
        assert found["promised"]["cell_error"] <= one.tolerance * (1.0 + 1e-12), one


def test_a_broken_promise_is_seen():
    one, _, table = made(model="smith", grid="12x12x24", parameters={"alpha": 0.4})
    table.values[3, 4, 5] *= 1.2
    assert not verify(one, table)["holds"]


# ---------------------------------------------------------------- items


def names(plan):
    return {item.name for item in plan.items}


def test_directions_cover_the_ranges():
    _, plan, table = made(model="smith", grid="18x18x12", theta_i=[12, 51], theta_o=[0, 33])
    assert "directions" in names(plan)
    # cells of 5 degrees: one position at or beyond each end
    assert np.allclose(np.degrees(plan.full.theta_i[[0, -1]]), [7.5, 52.5])
    assert np.allclose(np.degrees(plan.full.theta_o[[0, -1]]), [2.5, 37.5])
    assert np.isfinite(interpolate(table, 51 * D, 33 * D, 1.0)).all()
    with pytest.raises(BrdftabError, match=r"theta_i = 80 degrees is outside \[5, 55\]"):
        interpolate(table, 80 * D, 0.1, 1.0)


def test_luminance_is_the_sum_of_the_channels():
    for keys in ({"model": "smith"}, {"model": "lambert", "parameters": {"kd": [0.9, 0.4, 0.1]}}):
        _, plan, table = made(**keys, quantity="luminance", grid="6x6x8", floor=1e-3)
        rgb = brdftab.tabulate(keys["model"], "6x6x8", **keys.get("parameters", {}))
        assert "channels" in names(plan)
        assert table.channels == ("Y",)
        wanted = rgb.values @ np.array([0.2126, 0.7152, 0.0722])
        # six wavelengths instead of eight: 1.5e-5
        assert np.allclose(expanded(table, rgb.grid)[..., 0], wanted, rtol=5e-5)


def test_equal_channels_become_one():
    _, plan, table = made(model="oren-nayar", grid="6x6x8", parameters={"kd": [0.3, 0.3, 0.3]})
    assert "channels" in names(plan)
    assert table.channels == ("Y",)


def test_a_quarter_of_the_azimuths_gives_the_others():
    _, plan, table = made(model="smith", grid="4x8x4x8", parameters={"alpha_x": 0.2, "alpha_y": 0.5})
    assert "symmetry" in names(plan)
    assert table.values.shape[:4] == (4, 2, 4, 8)
    whole = brdftab.tabulate("smith", "4x8x4x8", alpha_x=0.2, alpha_y=0.5, tolerance=1e-4)
    # six wavelengths instead of eight: 3e-5
    assert np.allclose(expand(table).values, whole.values, rtol=1e-4)


def test_a_scratch_that_leans_keeps_its_azimuths(tmp_path):
    heights = tmp_path / "saw.txt"
    heights.write_text(
        "\n".join(str(x) for x in np.concatenate([np.linspace(0.0, -0.5, 40), np.linspace(-0.5, 0.0, 9)]))
    )
    keys = {"bins": 32, "rays": 64, "psi": 20.0}
    found = [
        plan_material(material(model="scratch", grid="4x8x4x8", parameters={**keys, "profile": profile})).plan
        for profile in (f"file:{heights}", "v:30")
    ]
    assert [("symmetry" in names(plan)) for plan in found] == [False, True]


def test_a_quarter_that_rounding_spoils_is_given_up():
    """Light at these azimuths lies on edges of the flux bins: rounding alone decides, and folded 20 times f is lost."""
    keys = {"profile": "u:100:100", "material": "mirror", "bins": 16, "rays": 64}
    one, plan, table = made(model="scratch", grid="4x6x4x6", parameters=keys)
    assert "symmetry" in names(plan)
    assert "symmetry" not in names(Plan.from_json(table.provenance["plan"]))
    assert table.provenance["error"]["met"]
    assert verify(one, table)["holds"]


def test_bounces_are_judged_at_the_angles_of_the_scene():
    """Steep facets, which a second bounce takes, are seen at grazing angles only."""
    keys = {"model": "vgroove-sym", "grid": "12x12x16", "parameters": {"alpha": 0.2}, "floor": 1e-3}
    caps = []
    for reach in (25, 90):
        plan = plan_material(material(**keys, theta_i=[0, reach], theta_o=[0, reach])).plan
        caps.append(plan.parameters.get("max_bounces", math.inf))
    assert caps[0] == 1 < caps[1]


def test_caps_are_judged_at_the_mirror_cells_too():
    """Averages there hold bounces that points beside do not: .9 % of a cell at 65 degrees."""
    keys = {"model": "vgroove-sym", "grid": "9x16x9x16", "theta_o": [0, 60], "floor": 1e-3, "tolerance": 0.03}
    one, plan, table = made(**keys, parameters={"alpha_x": 0.08, "alpha_y": 0.12})
    assert plan.parameters.get("max_bounces") == 2
    assert verify(one, table)["holds"]


def test_a_faint_lobe_goes_and_a_visible_one_stays():
    keys = {"model": "ashikhmin-shirley", "grid": "4x4x4x4", "floor": 1e-3}
    found = []
    for kd in (1e-6, 1e-2):
        parameters = {"kd": [kd, kd, 0.5 * kd], "f0": 0.5, "nu": 10.0, "nv": 10.0}
        found.append(plan_material(material(**keys, parameters=parameters)).plan)
    assert ["lobe" in names(plan) for plan in found] == [True, False]
    assert found[0].parameters["kd"] == 0.0
    assert found[1].parameters["kd"][0] == 1e-2


def test_albedo_alone_needs_no_table_of_directions():
    one, plan, table = made(model="smith", quantity="albedo", theta_i=[0, 80], parameters={"alpha": 0.5})
    assert isinstance(table, brdftab.AlbedoTable)
    assert "table" in names(plan)
    lights = np.radians([0, 33, 79])
    right = brdftab.albedo("smith", lights, alpha=0.5)
    assert np.abs(interpolate_albedo(table, lights) - right).max() <= plan.albedo_error <= 1e-2
    assert verify(one, table)["holds"]
    with pytest.raises(BrdftabError, match="layer = transmitted is not known; choose one of reflected"):
        interpolate_albedo(table, lights, layer="transmitted")


def test_singular_models_keep_their_mirror_cells():
    keys = {"model": "vgroove-sym", "grid": "12x12x72", "parameters": {"alpha": 0.5, "material": "mirror"}}
    _, plan, table = made(**keys)
    assert plan.apart == 1
    assert table.values.shape[:2] == (12, 12)
    whole = brdftab.tabulate("vgroove-sym", "12x12x72", alpha=0.5, material="mirror", tolerance=1e-4)
    # the averages of mirror cells, by 4 nodes instead of 7: 2.5e-4
    assert np.allclose(expand(table).values[:, :, -1], whole.values[:, :, -1], rtol=3e-4)


def test_layers_of_scratches_below_the_tolerance_go(tmp_path):
    layers = {"base": {"model": "lambert"}, "layer": [
        {"profile": "v:20", "material": "Fe", "area": area, "width": 0.02, "length": 0.3} for area in (0.1, 2e-3, 3e-3)
    ]}  # fmt: skip
    lines = ['[base]\nmodel = "lambert"\n']
    for layer in layers["layer"]:
        lines.append("[[layer]]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in layer.items()))
    (tmp_path / "layers.toml").write_text("".join(lines))
    (tmp_path / "scene.toml").write_text('[[material]]\nlayers = "layers.toml"\nsize = 64\nalbedo_tolerance = 0.006\n')
    result = CliRunner().invoke(
        main, ["tabulate", "--scene", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "o"), "--json"]
    )
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)["materials"][0]
    assert found["promised"] == {"cell_error": 0.0, "albedo_error": pytest.approx(5e-3)}
    from brdftab.scratch_layers import mapfile

    assert len(mapfile.read(found["file"]).facts["layers"]) == 1


def test_budgets_are_kept():
    keys = {"material": [{"model": "smith", "grid": "30x30x60"}]}
    assert plan_scene(parse(keys))
    for budget in ("memory", "files"):
        with pytest.raises(BrdftabError, match=f"{budget} = 0.001 MB is too little"):
            plan_scene(parse({**keys, "scene": {budget: "1 kB"}}))


# ---------------------------------------------------------------- interpolation


@given(st.lists(st.floats(0.01, 1.0), min_size=4, max_size=9), st.lists(st.floats(-2, 2), min_size=4, max_size=4))
def test_cubics_are_exact(steps, coefficients):
    knots = np.cumsum(steps)
    x = np.linspace(knots[0], knots[-1], 33)
    cubic = np.polynomial.Polynomial(coefficients)
    assert np.allclose(matrix(knots, x) @ cubic(knots), cubic(x), rtol=0, atol=1e-7 * (1.0 + knots[-1] ** 3))


def test_positions_give_their_own_values_and_even_axes_go_on():
    phi = np.radians(np.arange(5.0, 180.0, 10.0))
    even = matrix(phi, np.array([0.0, math.pi]), even=(0.0, math.pi)) @ np.cos(phi)
    one_sided = matrix(phi, np.array([0.0, math.pi])) @ np.cos(phi)
    # 1 - cos 5 degrees is 3.8e-3; the cubic leaves 2.2e-5 evenly and 2.6e-4 one-sidedly
    assert np.abs(even - [1.0, -1.0]).max() < 2.5e-5
    assert np.abs(one_sided - [1.0, -1.0]).max() > 1e-4
    table = brdftab.tabulate("smith", "5x5x6", alpha=0.6, dtype="float64")
    ti, to, ph = np.meshgrid(table.theta_i, table.theta_o, table.phi, indexing="ij")
    assert np.allclose(interpolate(table, ti, to, ph), table.values, rtol=1e-12)
    assert np.allclose(interpolate(table, ti, to, ph + 2.0 * math.pi), table.values, rtol=1e-9)


def test_negative_channels_are_looked_up():
    """The base below gold's highlight has a red outside the gamut."""
    parameters = {"nu": 20.0, "nv": 5.0, "kd": [0.5, 0.4, 0.6], "material": "Au"}
    one, _, table = made(model="ashikhmin-shirley", grid="6x8x6x8", parameters=parameters)
    assert table.values.min() < -1e-3
    assert verify(one, table)["holds"]


def test_lights_that_never_meet_their_own_mirror_direction():
    one, plan, table = made(model="vgroove-sym", grid="18x18x24", theta_i=[0, 20], theta_o=[50, 80])
    assert not len(plan.full.mirror_cells())
    assert verify(one, table)["holds"]


@pytest.mark.parametrize("grid", ["1x1x1", "2x1x1", "1x2x3", "1x1x1x1", "2x2x1x3"])
@pytest.mark.parametrize("model", ["smith", "vgroove-sym"])
def test_grids_of_a_few_cells_are_planned(model, grid):
    """All of their cells may hold the mirror direction, and leave no other pair to look at."""
    one, _, table = made(model=model, grid=grid, parameters={"alpha": 0.4})
    assert table.provenance["error"]["cells"] > 0
    assert verify(one, table)["holds"]


def test_a_promise_that_the_checks_see_broken_is_told(tmp_path):
    """Grooves a hundred thousand times rougher along one axis: averages at the mirror direction are not resolved."""
    (tmp_path / "scene.toml").write_text(
        '[[material]]\nname = "e"\nmodel = "vgroove-nonsym"\ngrid = "3x4x3x4"\n'
        "parameters = { alpha_x = 1e-4, alpha_y = 10, f0 = 0.5 }\n"
    )
    words = ["tabulate", "--scene", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out"), "--no-cache"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    assert "missed: the probes exceed the promise" in result.output
    (tmp_path / "scene.toml").write_text('[[material]]\nname = "a"\nmodel = "lambert"\nquantity = "albedo"\n')
    assert "missed" not in CliRunner().invoke(main, [*words, "--overwrite"]).output


def test_coarse_grids_promise_what_was_asked():
    """Averages of wide cells take more than the rules' own share: what no other item uses is theirs."""
    parameters = {"ior": 1.1282393132837922, "ndf": "ggx", "alpha": 0.17546655986686935}
    one, plan, table = made(
        model="vgroove-nonsym", grid="6x6x12", tolerance=5.4e-3, theta_i=[0, 67], parameters=parameters
    )
    assert "resolution" not in {item.name for item in plan.items}
    assert plan.cell_error == pytest.approx(plan.tolerance)
    assert verify(one, table)["holds"]


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"kept": {"theta_i": [3, 2]}}, "kept.theta_i must increase"),
        ({"kept": {"theta_i": [0, 99]}}, "from 0 to 8 at most"),
        ({"kept": {"phi_i": [0]}}, "kept.phi_i must list"),
        ({"kept": {"theta_i": [0.5]}}, "kept.theta_i must list"),
        ({"kept": [1]}, "kept needs a mapping"),
        ({"text": "9x", "cell": "center"}, "9x"),
        ({"axes": 1}, "axes and edges"),
    ],
)
def test_damaged_grids_of_a_plan_are_refused(damage, words):
    _, plan, _ = made(model="lambert", grid="9x9x18")
    data = plan.to_json()
    assert data["whole"] == {"text": "9x9x18", "cell": "center"}
    assert Plan.from_json(data).full == plan.full
    with pytest.raises(FileFormatError, match=words):
        Plan.from_json(data | {"full": damage})


def test_absolute_azimuths_are_periodic():
    table = brdftab.tabulate("ashikhmin-shirley", "3x12x3x12", nu=3.0, nv=1.0, dtype="float64")
    f = interpolate(table, 0.5, 0.6, 0.3, phi_i=np.array([0.1, 0.1 + 2.0 * math.pi, 6.2, 6.2 - 2.0 * math.pi]))
    assert np.allclose(f[0], f[1])
    assert np.allclose(f[2], f[3])


def test_choice_meets_its_tolerance_with_few_positions():
    x = np.linspace(0.0, 1.5, 90)
    lines = np.exp(-np.outer(np.tan(np.minimum(x, 1.4)) ** 2, [1.0, 4.0])) + 0.01
    kept, error = choose(x, to_log(lines, 1e-9), 1e-3)
    found = np.exp(matrix(x[kept], x) @ np.log(lines[kept]))
    assert error == pytest.approx(float((np.abs(found - lines) / lines).max()), rel=1e-3)
    assert error <= 1e-3
    assert kept.size < 45


def test_part_of_a_grid_keeps_the_edges_of_neighbours():
    grid = Grid.parse("9x9x18")
    some = part(grid, {"phi": np.array([0, 4, 8, 16, 17])})
    assert np.array_equal(some.phi_edges[-2:], grid.phi_edges[-2:])
    assert np.array_equal(some.theta_i_edges, grid.theta_i_edges)
    assert some.phi_edges[1] == pytest.approx(0.5 * (grid.phi[0] + grid.phi[4]))


# ---------------------------------------------------------------- files and commands


def test_the_example_is_planned_as_the_readme_says():
    root = Path(__file__).resolve().parents[1]
    result = CliRunner().invoke(main, ["plan", str(root / "examples" / "scene.toml")])
    assert result.exit_code == 0, result.output
    shown = (root / "docs" / "examples.md").read_text()
    # lines that tell no time; of the other materials the page shows no plan
    first = result.output[: result.output.index("brushed")].splitlines()
    lines = [x for x in first if x.startswith(("gold", "  wavelengths", "  directions", "  resolution", "  promised"))]
    assert len(lines) == 5
    for line in [*lines, result.output.splitlines()[-1]]:
        assert line in shown


def test_a_planned_table_repeats_from_its_file(tmp_path):
    one, plan, table = made(model="smith", grid="12x12x20", theta_i=[0, 60], quantity="luminance")
    brdftab.write(table, tmp_path / "t.exr")
    assert Plan.from_json(json.loads(json.dumps(plan.to_json()))).grid == plan.grid
    result = CliRunner().invoke(main, ["verify", str(tmp_path / "t.exr")])
    assert result.exit_code == 0, result.output
    assert verify(one, brdftab.read(tmp_path / "t.exr"))["holds"]


SCENE = """
[scene]
theta_o = [0, 60]
grid = "12x12x20"
[[material]]
name = "a"
model = "smith"
[[material]]
name = "b"
model = "lambert"
theta_i = [0, 30]
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BRDFTAB_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "scene.toml").write_text(SCENE)
    return lambda *words: CliRunner().invoke(main, [str(w) for w in words])


def test_commands(run):
    told = json.loads(run("plan", "scene.toml", "--json").stdout)["materials"]
    assert [one["name"] for one in told] == ["a", "b"]
    for one in told:
        assert {"time_saved", "bytes_saved", "cell_error", "albedo_error", "told", "kind"} <= one["items"][0].keys()
        assert one["predicted"]["bytes"] < one["predicted"]["bytes_unplanned"]
    text = run("plan", "scene.toml").stdout
    assert "no light or view outside" in text
    result = run("tabulate", "--scene", "scene.toml", "--verify-plan", "--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)["materials"]
    assert [one["file"] for one in found] == [os.path.join("scene", "a.exr"), os.path.join("scene", "b.exr")]
    assert all(one["verified"]["holds"] for one in found)
    refused = run("tabulate", "--scene", "scene.toml")
    assert refused.exit_code == 2
    assert "exists" in refused.stderr
    again = run("tabulate", "--scene", "scene.toml", "--overwrite", "--json")
    assert all(one["cached"] for one in json.loads(again.stdout)["materials"])
    assert "measured" in run("tabulate", "--scene", "scene.toml", "--out", "n/{name}.npz", "--verify-plan").stdout
    assert brdftab.read("n/a.npz").provenance["plan"]["items"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("tabulate", "--scene", "scene.toml", "--model", "smith"), "model = smith goes with --model"),
        (("tabulate", "--scene", "scene.toml", "--alpha", "0.3"), "alpha = 0.3 goes with --model"),
        (("tabulate", "--scene", "scene.toml", "--out", "x.exr"), "out = x.exr is one file"),
        (("tabulate", "--scene", "none.toml"), "cannot be opened"),
        (("tabulate",), "model is missing"),
        (("tabulate", "--model", "smith", "--verify-plan"), "verify_plan goes with --scene"),
        (("plan", "none.toml"), "cannot be opened"),
        (("tabulate", "--scene", "scene.toml", "--out", "/proc/x"), "out = /proc/x cannot be made a folder"),
    ],
)
def test_bad_commands_end_in_one_line(run, words, told):
    result = run(*words)
    assert result.exit_code == 2
    assert told in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({}, "model is missing"),
        ({"model": "phong"}, "model = 'phong' is not known"),
        ({"model": "smith", "layers": "x"}, "exclude each other"),
        ({"model": "smith", "theta_i": [50, 20]}, r"theta_i = \[50, 20\] is outside"),
        ({"model": "smith", "theta_i": 3}, "is no range"),
        ({"model": "smith", "tolerance": 2}, "tolerance = 2 is outside"),
        ({"model": "smith", "quantity": "hue"}, "quantity = 'hue' is not known"),
        ({"model": "smith", "quantity": "wavelengths"}, "wavelengths is missing"),
        ({"model": "smith", "wavelengths": [500]}, "goes with quantity"),
        ({"model": "lambert", "quantity": "wavelengths", "wavelengths": [500]}, "has no wavelengths"),
        ({"model": "smith", "parameters": {"alpha": -1}}, "alpha = -1 is outside"),
        ({"model": "smith", "parameters": 3}, "is no table"),
        ({"model": "smith", "colour": 3}, "colour = 3 is no key"),
        ({"model": "smith", "name": "../x"}, "cannot name a file"),
        ({"model": "smith", "grid": 3}, "grid = 3 is no text"),
    ],
)
def test_bad_materials_are_named(keys, told):
    with pytest.raises(BrdftabError, match=told):
        parse({"material": [keys]})


def test_bad_scenes_are_named(tmp_path):
    smith = {"model": "smith"}
    for table, told in (
        ({}, "material is missing"),
        ({"material": [smith, smith]}, "stands twice"),
        ({"material": [smith], "scene": {"memory": "lots"}}, "is no size"),
        ({"material": [smith], "scene": {"materials": "nowhere"}}, "is no folder"),
        ({"material": [smith], "scene": {"dtype": "half"}}, "dtype = 'half' is not known"),
        ({"material": 3}, "is no list"),
    ):
        with pytest.raises(BrdftabError, match=told):
            parse(table, folder=tmp_path)
    with pytest.raises(BrdftabError, match="misses the grid's"):
        plan_material(material(model="smith", grid="4x4x4", theta_i=[100, 120]))
    with pytest.raises(BrdftabError, match="smith: grid = '0x4x4': grid asks for 0 positions"):
        plan_material(material(model="smith", grid="0x4x4"))
    with pytest.raises(BrdftabError, match="size = 100 is"):
        plan_scene(parse({"material": [{"layers": "none.toml", "size": 100}]}))
    with pytest.raises(BrdftabError, match="has three axes"):
        plan_material(material(model="smith", grid="4x4x4", parameters={"alpha_x": 0.1, "alpha_y": 0.2}))


def test_a_folder_of_materials(tmp_path):
    (tmp_path / "some").mkdir()
    (tmp_path / "some" / "chalk.toml").write_text('model = "lambert"\n[parameters]\nkd = 0.4\n')
    found = parse({"scene": {"materials": "some", "tolerance": 0.02}}, folder=tmp_path).materials
    assert [(m.name, m.model, m.tolerance) for m in found] == [("chalk", "lambert", 0.02)]


# ---------------------------------------------------------------- the cache


def test_cache_keeps_by_content_and_throws_the_oldest_away(run, monkeypatch):
    first, second = (material(name=n, model="lambert", grid="6x6x8") for n in "xy")
    other = material(model="lambert", grid="6x6x8", tolerance=0.02)
    assert cache.key(first) == cache.key(second) != cache.key(other)
    table = carry_out(plan_material(first))
    assert cache.get(first) is None
    cache.put(first, table)
    assert np.array_equal(cache.get(second).values, table.values)
    os.utime(cache.entries()[0].path, (1.0, 1.0))
    cache.put(other, carry_out(plan_material(other)))
    size = max(entry.size for entry in cache.entries())
    monkeypatch.setenv("BRDFTAB_CACHE_SIZE", str(size))
    cache.shrink(cache.limit())
    assert cache.get(first) is None
    assert cache.get(other) is not None
    cache.entries()[0].path.write_bytes(b"PK\x03\x04 damaged")
    assert cache.get(other) is None
    assert cache.entries() == []
    monkeypatch.setenv("BRDFTAB_CACHE_SIZE", "much")
    result = run("cache")
    assert result.exit_code == 2
    assert "BRDFTAB_CACHE_SIZE = 'much' is outside" in result.stderr


def test_cache_command(run):
    assert run("tabulate", "--scene", "scene.toml").exit_code == 0
    assert json.loads(run("cache", "--json").stdout)["tables"] == 2
    assert "removed      2" in run("cache", "--clear").stdout
    assert json.loads(run("cache", "--json").stdout)["tables"] == 0


def _fill(number, folder):
    os.environ["BRDFTAB_CACHE_DIR"] = folder
    one = material(model="lambert", grid="6x6x8", parameters={"kd": 0.5})
    table = brdftab.tabulate("lambert", "6x6x8", kd=0.5)
    for _ in range(20):
        cache.put(one, table)
        found = cache.get(one)
        assert found is None or np.array_equal(found.values, table.values)
        cache.shrink(0 if number else 10**9)


def test_two_processes_share_the_cache(tmp_path):
    context = multiprocessing.get_context("spawn")
    both = [context.Process(target=_fill, args=(n, str(tmp_path))) for n in range(2)]
    for process in both:
        process.start()
    for process in both:
        process.join(120)
        assert process.exitcode == 0
    assert not [name for name in os.listdir(tmp_path) if name.startswith("unfinished-")]
