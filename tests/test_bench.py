"""`brdftab bench`: errors that are known, methods found from the registry, comparisons, files, and what is refused."""

import copy
import json
import math
import time

import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from benchmarks.papers import COMMAND, lee, page
from brdftab import models
from brdftab.bench import methods, peers
from brdftab.bench.compare import compare
from brdftab.bench.front import front
from brdftab.bench.lists import document, read_list, read_results
from brdftab.bench.measures import NAMES, all_angles, measure, view_weights
from brdftab.bench.report import seconds, table
from brdftab.bench.run import QUICK
from brdftab.bench.timing import forget, timed
from brdftab.cli import main
from brdftab.errors import BrdftabError, FileFormatError, ParameterError
from brdftab.models.resolve import resolve
from brdftab.quadrature import unit_gauss
from brdftab.tables.grid import Grid

GOLD = {"eta": [0.143, 0.375, 1.442], "k": [3.983, 2.386, 1.603]}


@pytest.fixture(scope="module")
def diffuse():
    """Return results of the cheapest model."""
    return brdftab.benchmark("lambert", quick=True, peer=False)


@pytest.fixture
def run():
    return lambda *words: CliRunner().invoke(main, ["bench", *map(str, words)])


def row(result, name):
    return next(r for r in result["methods"] if r["name"] == name or name in r["same"])


# ---------------------------------------------------------------- measures


@pytest.mark.parametrize("text", ["4x8x16", "3x4x6x8", "3x8+8x16"])
def test_weights_are_the_cosine_over_all_views(text):
    grid = Grid.parse(text)
    below = 2.0 if grid.below else 1.0
    total = view_weights(grid).sum(axis=(1, 2) if grid.isotropic else (2, 3))
    assert np.allclose(total, below * math.pi, rtol=1e-13)


def test_measures_of_known_errors():
    grid = Grid.parse("3x4x6")
    ti, to, phi, _ = all_angles(grid)
    right = (1.0 + np.cos(to) * np.cos(ti) + 0.2 * np.cos(phi)).reshape(*grid.shape, 1) * np.array([1.0, 0.3])
    kept = np.ones(grid.shape, bool)
    same = measure(1.03 * right, right, grid, kept)
    assert np.allclose([getattr(same, n) for n in NAMES], 0.03, rtol=1e-12)
    # one dark cell: the largest error sees it against the cell's own brightness
    wrong = right.copy()
    wrong[1, 2, 3, 1] += 0.5 * right[1, 2, 3, 0]
    one = measure(wrong, right, grid, kept)
    assert one.max == pytest.approx(0.5)
    w = view_weights(grid)
    assert one.l1 == pytest.approx(w[1, 2, 3] * 0.5 * right[1, 2, 3, 0] / (w[..., None] * right).sum())
    assert one.albedo == pytest.approx(w[1, 2, 3] * 0.5 * right[1, 2, 3, 0] / (w[1] * right[1, :, :, 1]).sum())
    assert one.l2 > one.l1
    kept[1, 2, 3] = False
    assert measure(wrong, right, grid, kept) == measure(right, right, grid, kept)


# ---------------------------------------------------------------- times


def test_times_are_medians_of_so_many_runs():
    calls = []
    slept = iter([0.0, 0.03, 0.0, 0.0, 0.0])

    def work():
        calls.append(1)
        time.sleep(next(slept))

    found = timed(work, 5, 10.0)
    assert found.repeats == len(calls) == 5
    assert found.min <= found.median < 0.03 <= found.max
    assert timed(lambda: time.sleep(0.02), 50, 0.03).repeats == 3
    assert timed(lambda: time.sleep(0.05), 50, 0.03).repeats == 1


def test_end_to_end_starts_from_nothing():
    unit_gauss(7)
    assert unit_gauss.cache_info().currsize
    forget()
    assert not unit_gauss.cache_info().currsize


def test_the_front_holds_what_nothing_beats():
    made = {"a": (1.0, 0.5), "b": (2.0, 0.1), "c": (3.0, 0.2), "d": (4.0, 1e-12), "e": (5.0, 1e-14)}
    rows = [{"name": n, "kernel_s": {"median": t}, "error": {"l1": e}} for n, (t, e) in made.items()]
    # d and e are both below what the reference resolves: the faster one stands for both
    assert front(rows, {"l1": 1e-10}) == ["a", "b", "d"]
    assert front(rows, {"l1": 0.0}) == ["a", "b", "d", "e"]


@pytest.mark.parametrize(("value", "shown"), [(1.5, "1.5 s"), (0.0213, "21.3 ms"), (4e-6, "4 us"), (3e-9, "3 ns")])
def test_times_are_shown_in_their_unit(value, shown):
    assert seconds(value) == shown


# ---------------------------------------------------------------- methods from the registry


@pytest.mark.parametrize("name", models.names())
def test_methods_are_found_for_every_model(name):
    setup = resolve(name)
    grid = Grid.parse("2x2x2" if setup.isotropic else "2x2x2x2")
    found = [
        *methods.caps(setup, grid, QUICK.caps),
        *methods.estimators(setup, grid, QUICK.samples),
        *methods.stand_ins(setup, grid, QUICK.samples),
        *methods.twins(setup, grid, QUICK.twin_tolerances),
    ]
    names = [m.name for m in found]
    assert len(set(names)) == len(names)
    json.dumps([m.settings for m in found], allow_nan=False)
    assert any(m.family == "twin" for m in found) == (models.has_twin(name) and not methods.is_stochastic(setup))
    assert any("max_bounces" in m.settings for m in found) == (
        setup.model.has("max_bounces") and not methods.is_stochastic(setup)
    )
    assert any(m.seeded for m in found) >= setup.model.has("samples")


@pytest.mark.parametrize("name", models.names())
def test_what_folders_say_holds(name):
    declared = models.spec(name)
    for parameter, values in models.spec(name).methods.items():
        for value in values:
            resolve(name, **{parameter: value})
        assert declared.has(parameter)
    for other, without in models.spec(name).approximates.items():
        assert all(models.spec(other).has(parameter) for parameter in without)
        kept = [p.name for p in models.spec(other).params if p.name not in without]
        assert any(declared.has(parameter) for parameter in kept)
    module = models.mitsuba(name)
    assert module is None or isinstance(module.plugin(resolve(name)), dict | str)


def test_stand_ins_need_what_they_do_without():
    grid = Grid.parse("2x2x2x2")
    rough = resolve("smith-multi", alpha_x=0.2, alpha_y=0.4)
    assert {m.family for m in methods.stand_ins(rough, grid, (1,))} <= {"smith-walk"}
    plain = resolve("smith-multi", alpha=0.4)
    names = {m.family for m in methods.stand_ins(plain, Grid.parse("2x2x2"), (1,))}
    assert {"kulla-conty", "turquin", "smith-walk"} <= names
    assert not [m for m in methods.stand_ins(resolve("ilm", ndf="ggx"), grid, (1,)) if m.family == "ilm-approx"]


def test_closed_forms_and_their_storage():
    found = brdftab.benchmark("smith", quick=True, ndf="ggx", alpha=0.3, masking="separable", **GOLD)
    assert found["reference"]["uncertainty"]["max"] < 1e-15
    direct = row(found, "direct 1e-02")
    assert direct["same"] == ["direct 1e-04"]
    assert not any(direct["resolved"].values())
    # measured 1.1e-13; 2.2e-15; 5.5e-7, float32 arithmetic
    assert row(found, "prepared 1e-04")["error"]["max"] < 5e-13
    assert row(found, "twin 1e-03")["error"]["max"] < 1e-14
    stored = row(found, "prepared float32 1e-04")
    assert 1e-9 < stored["error"]["max"] < 1.2e-6
    assert all(stored["resolved"].values())
    missing = {left["name"] for left in found["left_out"]}
    for variant in (peers.SCALAR, peers.LLVM):
        if not any(variant in name for name in missing):
            # measured 1.4e-6
            assert row(found, f"mitsuba {variant}")["error"]["max"] < 3e-6
    assert "kernel l1" in direct["pareto"] or "total l1" in direct["pareto"] or len(found["methods"]) > 1


def test_peers_that_cannot_compute_a_surface_say_why():
    lines = peers.missing(resolve("smith", ndf="ggx"))
    assert len(lines) == 1
    assert "separable" in lines[0]["reason"]
    assert peers.missing(resolve("cook-torrance")) == []
    assert peers.methods(resolve("smith", ndf="phong"), Grid.parse("2x2x2")) == []


def test_a_library_that_does_not_serve_is_named(monkeypatch):
    mitsuba = pytest.importorskip("mitsuba")

    def refuse(variant):
        raise ImportError("the LLVM backend is inactive")

    monkeypatch.setattr(mitsuba, "set_variant", refuse)
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/lib/libLLVM-14.so")
    setup = resolve("smith", ndf="ggx", alpha=0.3, masking="separable", **GOLD)
    made = peers.methods(setup, Grid.parse("2x2x2"))
    (vector,) = [m for m in made if m.name == f"mitsuba {peers.LLVM}"]
    with pytest.raises(BrdftabError, match=r"libLLVM-14\.so does not serve Mitsuba; set it to libLLVM 19"):
        vector.make()


def test_caps_lose_what_lies_above_them():
    found = brdftab.benchmark("vgroove-sym", quick=True, ndf="ggx", alpha=0.6, material="mirror")
    one, three = row(found, "max_bounces 1"), row(found, "max_bounces 3")
    assert 0.1 < one["error"]["albedo"] < 1.0
    assert three["error"]["l1"] < 0.5 * one["error"]["l1"]
    coarse, fine = row(found, "direct 1e-02"), row(found, "direct 1e-04")
    assert fine["error"]["max"] <= max(coarse["error"]["max"], 1e-4)
    assert found["reference"]["uncertainty"]["l1"] < 1e-6


def test_noise_falls_with_samples():
    found = brdftab.benchmark("smith-walk", quick=True, alpha=0.8, material="mirror")
    few, many = row(found, "smith-walk 1"), row(found, "smith-walk 8")
    assert many["error"]["l2"] < 0.7 * few["error"]["l2"]
    low, high = few["error_range"]["l1"]
    assert low < few["error"]["l1"] < high
    assert found["reference"]["samples"] >= 64
    assert 0.0 < found["reference"]["uncertainty"]["l1"] < few["error"]["l1"]


def test_rungs_after_a_slow_one_are_left_out():
    found = brdftab.benchmark("oren-nayar", quick=True, peer=False, limit=1e-9)
    assert all("took" in left["reason"] for left in found["left_out"])
    # the first rung of each family runs, and the table names the others
    assert {"direct 1e-04", "direct float32 1e-04"} <= {left["name"] for left in found["left_out"]}
    assert any("left out: direct 1e-04" in line for line in table(found))


def test_what_is_refused():
    with pytest.raises(ParameterError, match=r"repeats = 0 is outside \[1, inf\)"):
        brdftab.benchmark("lambert", quick=True, repeats=0)
    with pytest.raises(ParameterError, match=r"seconds = 0 is outside \(0, inf\)"):
        brdftab.benchmark("lambert", quick=True, seconds=0)
    with pytest.raises(ParameterError, match=r"limit = 0 is outside \(0, inf\)"):
        brdftab.benchmark("lambert", quick=True, limit=0)
    with pytest.raises(ParameterError, match="grid = 4x4x8 has three axes"):
        brdftab.benchmark("smith", "4x4x8", alpha_x=0.1, alpha_y=0.2)
    with pytest.raises(ParameterError, match="threads = 1000 is outside"):
        brdftab.benchmark("lambert", quick=True, threads=1000)


# ---------------------------------------------------------------- comparisons


def slower(data, factor, name="direct 1e-02"):
    """Return a document in which one method takes `factor` times as long."""
    changed = copy.deepcopy(data)
    took = row(changed["results"][0], name)["kernel_s"]
    took["min"] *= factor
    return changed


def test_comparisons_tell_slower_worse_and_gone(diffuse):
    old = document([diffuse])
    same = compare(old, old)
    assert {c.status for c in same} == {"same"}
    assert not any(c.failed for c in same)
    new = slower(old, 2.0)
    found = {c.method: c for c in compare(old, new)}
    assert found["direct 1e-02"].status == found["direct 1e-04"].status == "slower"
    assert found["direct 1e-02"].time_ratio == pytest.approx(2.0)
    assert not any(c.failed for c in compare(old, new, slower=2.5))
    assert {c.status for c in compare(new, old)} == {"same", "better"}
    worse = copy.deepcopy(old)
    row(worse["results"][0], "twin 1e-03")["error"]["max"] = 1e-9
    bad = next(c for c in compare(old, worse) if c.failed)
    assert (bad.method, bad.status, bad.error) == ("twin 1e-03", "worse", "max")
    # a change below what the references resolve is none
    row(worse["results"][0], "twin 1e-03")["error"]["max"] = 5e-16
    assert not any(c.failed for c in compare(old, worse))
    less = copy.deepcopy(old)
    less["results"][0]["methods"].pop()
    assert [c.status for c in compare(old, less) if c.failed] == ["gone"]
    assert [c.status for c in compare(less, old) if c.status != "same"] == ["new"]


def test_other_runs_do_not_compare(diffuse):
    old = document([diffuse])
    other = copy.deepcopy(old)
    other["results"][0]["parameters"] = {"kd": 0.9}
    with pytest.raises(ParameterError, match="share no model, parameters, grid and method"):
        compare(old, other)
    with pytest.raises(ParameterError, match=r"slower = 1 is outside \(1, inf\)"):
        compare(old, old, slower=1)


# ---------------------------------------------------------------- the command


def test_command_writes_what_it_measured(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "list.toml").write_text('[[bench]]\nmodel = "lambert"\nkd = [0.1, 0.2, 0.3]\n')
    words = ("--list", "list.toml", "--quick", "--no-peers", "--out", "a.json", "--figure", "a.svg")
    found = run(*words)
    assert found.exit_code == 0, found.stderr
    assert "lambert  kd [0.1, 0.2, 0.3]" in found.stdout
    assert "* direct" in found.stdout or "* twin" in found.stdout
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")
    data = read_results("a.json")
    assert data["machine"]["versions"]["brdftab"] == brdftab.__version__
    assert data["results"][0]["seed"] == 0
    assert run(*words).exit_code == 2
    assert run("--compare", "a.json", "a.json").exit_code == 0
    (tmp_path / "b.json").write_text(json.dumps(slower(data, 9.0)))
    failed = run("--compare", "a.json", "b.json", "--json")
    assert failed.exit_code == 1
    assert json.loads(failed.stdout)["failed"] is True
    text = run("--compare", "a.json", "b.json")
    assert text.exit_code == 1
    assert "2 slower, worse or gone" in text.stdout


def test_command_prints_json(run):
    found = run("--model", "lambert", "--kd", "0.3", "--quick", "--no-peers", "--json")
    assert found.exit_code == 0, found.stderr
    data = json.loads(found.stdout)
    assert data["format"] == "brdftab-bench"
    assert data["results"][0]["parameters"] == {"kd": 0.3}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "nothing to measure is named; give one of --model"),
        (("--model", "smith", "--all"), "--model and --all exclude each other"),
        (("--all", "--alpha", "0.3"), "alpha belong to --model, not to --all"),
        (("--model", "smith", "--slower", "2"), "slower = 2.0 has no meaning for --model"),
        (("--model", "nonsense"), "model = nonsense is not known"),
        (("--model", "lambert", "--kd", "2"), "kd = 2 is outside"),
        (("--model", "lambert", "--figure", "x.gif"), "figure = x.gif has no known ending"),
        (("--list", "missing.toml"), "missing.toml cannot be read"),
        (("--compare", "missing.json", "missing.json"), "missing.json cannot be read"),
    ],
    ids=str,
)
def test_command_refuses_in_one_line(run, words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = run(*words)
    assert found.exit_code == 2
    assert message in found.stderr
    assert found.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[bench]\n", "cannot be read"),
        ("", "must hold tables"),
        ("bench = 3\n", "must hold tables"),
        ('[[bench]]\nmodel = "smith"\n[more]\n', "must hold tables"),
        ("[[bench]]\nalpha = 3\n", "number 1 has no model"),
    ],
)
def test_lists_that_are_none(tmp_path, text, message):
    file = tmp_path / "list.toml"
    file.write_text(text)
    with pytest.raises(FileFormatError, match=message):
        read_list(file)


def test_angles_of_lists_are_degrees(tmp_path):
    file = tmp_path / "list.toml"
    file.write_text('[[bench]]\nmodel = "oren-nayar"\nsigma = 20\n[[bench]]\nmodel = "smith"\nalpha = 0.2\n')
    assert read_list(file) == [("oren-nayar", {"sigma": math.radians(20)}), ("smith", {"alpha": 0.2})]
    file.write_text('[[bench]]\nmodel = "oren-nayar"\nroughness = 20\n')
    with pytest.raises(ParameterError, match="roughness is not a parameter of oren-nayar"):
        read_list(file)


@pytest.mark.parametrize("text", ["[]", "{", '{"format": "brdftab-bench", "format_version": 1, "results": [{}]}', "3"])
def test_files_of_results_that_are_none(tmp_path, text):
    file = tmp_path / "a.json"
    file.write_text(text)
    with pytest.raises(FileFormatError, match=r"a\.json"):
        read_results(file)


def test_angles_are_shown_in_degrees():
    found = brdftab.benchmark("oren-nayar", quick=True, peer=False, sigma=math.radians(20))
    assert "sigma [degrees] 20" in next(table(found))
    # the short form of the same paper is a rougher method, measured 5 % off
    assert 0.01 < row(found, "variant qualitative")["error"]["l1"] < 0.2


# ---------------------------------------------------------------- the papers


def test_rays_reproduce_table_1():
    found = lee.ray_errors("symmetric", lee.RAYS, True, 10)
    largest, mean = lee.TABLE_1["symmetric"]
    assert found.max() < 1.2 * largest
    assert 0.5 * mean < found.mean() < 1.2 * mean
    # independent rays are 30 times as far off
    assert lee.ray_errors("symmetric", lee.RAYS, False, 30).mean() > 20.0 * mean


def test_page_names_its_command_and_what_is_missing():
    sheet = {"title": "Table 9", "columns": ("a", "b"), "rows": [(1, "x")], "notes": ("Read with care.",)}
    section = {"title": "T", "paper": "P", "sheets": [sheet], "missing": ["scipy is not installed"], "seconds": 1.0}
    machine = {"versions": {"brdftab": "1"}, "processor": "", "architecture": "A", "cpus": 2, "load_average": None}
    found = {"machine": machine | {"python": "3"}, "quick": True, "threads": 1, "seconds": 2.0, "sections": [section]}
    text = page(found)
    assert COMMAND in text
    for line in ("## T", "### Table 9", "| a | b |", "| 1 | x |", "Read with care.", "the numbers mean nothing"):
        assert line in text
    assert "Not measured: scipy is not installed." in text
