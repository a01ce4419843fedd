"""`brdftab check`: it is green on sound models, red on broken ones, and its table of known limits is not stale."""

import dataclasses
import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab import models, validate
from brdftab.cli import main
from brdftab.errors import ParameterError
from brdftab.models.protocols import Checks
from brdftab.models.resolve import resolve
from brdftab.validate import condition, limits, maps, properties, recovery
from brdftab.validate.finding import Finding
from brdftab.validate.jumps import jumps
from brdftab.validate.probe import Subject
from brdftab.validate.properties.gradient import resolved
from brdftab.validate.properties.reciprocity import between
from brdftab.validate.run import check
from brdftab.validate.settings import extremes, refusal, setups

HERE = (0.5, 0.7, 1.0, 0.0)


def run(*words):
    return CliRunner().invoke(main, ["check", *map(str, words)])


def broken(monkeypatch, model, change):
    """Replace the values of a model's kernel by change(values, angles)."""
    module = models.kernel(model)
    true = module.points

    def points(setup, *angles, orders, tolerance):
        return change(true(setup, *angles, orders=orders, tolerance=tolerance), angles, setup)

    monkeypatch.setattr(module, "points", points)


# ---------------------------------------------------------------- the command


def test_sound_model_is_green_and_tells_each_property():
    result = run("--model", "lambert", "--fast", "--json")
    assert result.exit_code == 0, result.stdout
    found = json.loads(result.stdout)
    assert list(found) == ["green", "fast", "version", "run_time_s", "rows"]
    assert found["green"]
    assert found["fast"]
    assert [row["property"] for row in found["rows"]] == properties.names()
    assert {row["status"] for row in found["rows"]} == {"ok", "skipped"}
    for row in found["rows"]:
        assert (row["status"] == "skipped") == bool(row["skipped"])
        if row["worst"]:
            assert row["worst"]["holds"]
            words = shlex.split(row["worst"]["command"])
            assert words[:4] == ["brdftab", "eval", "--model", "lambert"]
            assert CliRunner().invoke(main, words[1:]).exit_code == 0


def test_every_property_says_what_it_measures():
    assert {"positivity", "finiteness", "reciprocity", "energy", "furnace", "sampling"} <= set(properties.names())
    assert {"storage", "twin", "gradient", "continuity", "switches", "stiffness", "limits"} <= set(properties.names())
    for name in properties.names():
        module = properties.module(name)
        assert module.MEANING
        assert module.__doc__


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ((), "model"),
        (("--model", "lambert", "--all"), "exclude"),
        (("--model", "nonsense"), "nonsense"),
        (("--model", "lambert", "--property", "nonsense"), "nonsense"),
    ],
)
def test_bad_input_ends_with_one_line_and_2(words, named):
    result = run(*words)
    assert result.exit_code == 2
    assert named in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_failure_is_told_with_what_makes_it(monkeypatch):
    broken(monkeypatch, "lambert", lambda f, angles, setup: np.where(angles[0][:, None, None] > 1.5, np.nan, f))
    result = run("--model", "lambert", "--fast", "--property", "finiteness", "--property", "positivity")
    assert result.exit_code == 1
    assert "FAILED: lambert finiteness" in result.stdout
    command = next(line for line in result.stdout.splitlines() if line.startswith("  brdftab eval"))
    words = shlex.split(command)
    assert float(words[words.index("--theta-i") + 1]) > math.degrees(1.5)
    assert "1 of 2 rows failed" in result.stdout


# ---------------------------------------------------------------- each property sees what it is for


def asymmetric(f, angles, setup):
    return f * (1.0 + 1e-6 * (angles[0] > angles[1]))[:, None, None]


BREAKS = {
    "positivity": lambda f, angles, setup: f - 1.0,
    "reciprocity": asymmetric,
    "energy": lambda f, angles, setup: 1.01 * f,
    "furnace": lambda f, angles, setup: 0.99 * f,
    "twin": lambda f, angles, setup: f * (1.0 + 1e-9),
    "gradient": lambda f, angles, setup: f * (1.0 + 1e-3 * setup.values["kd"].max()),
    "continuity": lambda f, angles, setup: f * (1.0 + 1e-6 * (angles[1] > 0.777))[:, None, None],
}


@pytest.mark.parametrize("name", BREAKS)
def test_property_fails_on_a_model_that_lacks_it(name, monkeypatch):
    before = check("lambert", fast=True, only=[name])
    assert before.green
    assert before.rows[0].worst is not None or name == "continuity"
    broken(monkeypatch, "lambert", BREAKS[name])
    after = check("lambert", fast=True, only=[name])
    assert not after.green
    assert after.rows[0].failing[0].ratio > 1.0


def test_sampling_fails_where_the_density_is_wrong(monkeypatch):
    module = models.sampler("lambert")
    true = module.pdf
    # of the right mean weight: the albedo is the integral of f cos, whatever the density
    monkeypatch.setattr(module, "pdf", lambda setup, ti, to, phi, az: true(setup, ti, to, phi, az) * (0.7 + 0.5 * to))
    report = check("lambert", fast=True, only=["sampling"])
    assert {f.detail for f in report.rows[0].failing} >= {"moments against the density"}


def test_components_fail_where_they_do_not_add_up(monkeypatch):
    module = models.kernel("lambert")
    true = module.points
    monkeypatch.setattr(
        module,
        "points",
        lambda s, *a, orders, tolerance: true(s, *a, orders=orders, tolerance=tolerance) * (1.0 + 1e-6 * orders),
    )
    assert not check("lambert", fast=True, only=["components"]).green


def test_jump_is_measured_where_it_is():
    t = np.linspace(0.0, 1.0, 257)

    def f(x, line):
        return np.exp(np.sin(5.0 * x)) * (1.0 + 1e-7 * (x > math.pi / 7.0)) + np.abs(x - 0.3)

    found = jumps(f, t, f(t, 0)[:, None])
    worst = max(found, key=lambda jump: jump.size)
    value = f(np.array([math.pi / 7.0]), 0)[0]
    smooth = math.exp(math.sin(5.0 * math.pi / 7.0))
    assert worst.below <= math.pi / 7.0 <= worst.above
    assert worst.above - worst.below < 1e-12
    assert worst.size == pytest.approx(1e-7 * smooth / value, rel=1e-3)
    # the kink at 0.3 is none
    assert all(jump.size < 1e-12 for jump in found if jump is not worst)


def test_reciprocity_through_an_interface_counts_the_squared_index():
    """From above into glass f is n^2 times as large as from within out; reflections are the same both ways."""
    setup = resolve("smith-multi", ior=[1.5, 2.0, 1.5])
    theta_i, theta_o = np.radians([[30.0, 150.0, 20.0, 120.0], [160.0, 40.0, 60.0, 100.0]])
    expected = [[2.25, 4.0, 2.25], [1 / 2.25, 0.25, 1 / 2.25], [1.0] * 3, [1.0] * 3]
    np.testing.assert_allclose(between(setup, theta_i, theta_o), expected, rtol=1e-15)


def test_derivatives_are_left_out_where_a_limit_names_the_values():
    subject = Subject("vgroove-nonsym")
    for optics, sure in (
        ({"eta": [0.38, 0.007, 0.001], "k": [3e-4, 145.0, 822.0]}, False),
        ({"eta": [0.38, 0.007, 1.5], "k": [1.0, 145.0, 0.0]}, True),
        ({"ior": 1.5}, True),
    ):
        assert resolved(subject, resolve("vgroove-nonsym", **optics)) is sure
    assert resolved(Subject("vgroove-sym"), resolve("vgroove-sym", eta=0.5, k=0.0))


@pytest.mark.parametrize(("step", "seen"), [(0.0, False), (0.5, True)])
def test_a_root_at_zero_is_no_jump(step, seen):
    """sqrt(x) rises over all numbers next to 0; what jumps there jumps at the smallest of them, too."""
    t = np.linspace(0.0, 1.0, 257)

    def f(x, line):
        return 1.0 + np.sqrt(x) + step * (x > 0.0)

    found = [jump.size for jump in jumps(f, t, f(t, 0)[:, None]) if jump.below == 0.0]
    assert len(found) == 1
    assert found[0] == pytest.approx(step / (1.0 + step), abs=1e-12)
    assert (found[0] > 1e-6) is seen


# ---------------------------------------------------------------- settings


def test_extremes_of_the_list_and_of_the_bounds_are_taken():
    alpha = extremes(models.spec("smith").param("alpha"))
    assert {1e-4, 10.0} <= set(alpha)
    assert {1.0, 1.0 + 1e-12, 1e3} <= {
        x for x in extremes(models.spec("smith").param("ior")) if not isinstance(x, list)
    }
    assert {0.0, 1e3} <= {x for x in extremes(models.spec("smith").param("k")) if not isinstance(x, list)}
    assert 1e6 in extremes(models.spec("smith").param("exponent"))
    assert 100_000 in extremes(models.spec("vgroove-sym").param("max_bounces"))
    assert {0.0, 2.0} <= set(extremes(models.spec("ilm").param("sigma")))
    walls = {s.parameters["profile"] for s in setups("scratch", fast=True)}
    assert {"ellipse:1", "u:2:100"} <= walls


@pytest.mark.parametrize("name", models.names())
def test_every_model_takes_part(name):
    few, all_ = setups(name, fast=True), setups(name)
    assert 1 <= len(few) <= len(all_)
    # a number is met at both of its bounds, but for ranges that a choice narrows and slow models, which are thinned
    spec = models.spec(name)
    thinned = bool(models.checks(name).thin)
    for param in spec.params:
        if param.kind in ("float", "channels") and not thinned:
            met = [np.atleast_1d(s.parameters[param.name]) for s in all_ if s.parameters.get(param.name) is not None]
            assert met, param.name
            assert min(m.min() for m in met) < max(m.max() for m in met)


@pytest.mark.parametrize("name", models.names())
def test_words_and_bounds_are_never_thinned_out(name):
    """What is taken always holds every word and both bounds of each parameter that the model takes there."""
    few = [s.parameters for s in setups(name, fast=True)]
    for param in models.spec(name).params:
        met = [given[param.name] for given in few if given.get(param.name) is not None]
        if param.kind == "choice":
            taken = {word for word in param.choices if refusal(name, {param.name: word}) is None}
            assert taken <= {*met, param.default}, param.name
        elif param.kind in ("float", "channels"):
            ends = [b for b in param.bounds if refusal(name, {param.name: b}) is None]
            assert set(ends) <= {float(x) for m in met for x in np.atleast_1d(m)}, param.name


@pytest.mark.parametrize(("model", "param", "value"), [("lambert", "kd", 1.0), ("oren-nayar", "kd", 1.0)])
def test_ten_times_the_light_at_a_bound_alone_is_seen_by_the_fast_check(model, param, value, monkeypatch):
    def brighter(f, angles, setup):
        return f * (10.0 if np.all(setup.values[param] == value) else 1.0)

    broken(monkeypatch, model, brighter)
    assert not check(model, fast=True, only=["energy"]).green


def test_all_that_a_model_may_say_to_the_checks_is_read():
    folder = Path(validate.__file__).parent
    text = "".join(path.read_text() for path in sorted(folder.rglob("*.py")))
    for field in dataclasses.fields(Checks):
        assert re.search(rf"\bown\.{field.name}\b", text), field.name
        assert field.name in Checks.__doc__


# ---------------------------------------------------------------- known limits


def test_limits_are_sound():
    known = limits.limits()
    assert len({limit.name for limit in known}) == len(known)
    for limit in known:
        assert limit.model in models.names()
        assert limit.prop in properties.names()
        assert limit.why.endswith(".")
        assert limit.size > 0.0
        resolve(limit.model, **limit.example["parameters"])


def test_limit_covers_what_it_says_alone():
    entry = limits.Limit("words", "energy", "smith", "why.", 0.5, {"ndf": "phong", "alpha": [0.7, 2.0]})
    given = resolve("smith", ndf="phong", alpha=1.0).parameters
    made = Finding("energy", "smith", 0.4, 0.0003, given, HERE)
    assert entry.covers(made)
    for other in (
        Finding("energy", "smith", 0.6, 0.0003, given, HERE),
        Finding("furnace", "smith", 0.4, 0.0003, given, HERE),
        Finding("energy", "cook-torrance", 0.4, 0.0003, given, HERE),
        Finding("energy", "smith", 0.4, 0.0003, resolve("smith", ndf="phong", alpha=3.0).parameters, HERE),
        Finding("energy", "smith", 0.4, 0.0003, resolve("smith", ndf="ggx", alpha=1.0).parameters, HERE),
        Finding("energy", "smith", math.nan, 0.0003, given, HERE),
    ):
        assert not entry.covers(other)


def test_stale_limit_fails(monkeypatch):
    gone = limits.Limit("gone", "energy", "lambert", "why.", 0.1, {}, {"parameters": {"kd": 1.0}})
    monkeypatch.setattr(limits, "limits", lambda: (gone,))
    report = check("lambert", only=["limits"])
    assert not report.green
    assert report.rows[0].failing[0].detail == "gone"
    # a size far above what is measured is stale as well
    broken(monkeypatch, "lambert", lambda f, angles, setup: 1.01 * f)
    assert not check("lambert", only=["limits"]).green
    fitting = limits.Limit("gone", "energy", "lambert", "why.", 0.015, {}, {"parameters": {"kd": 1.0}})
    monkeypatch.setattr(limits, "limits", lambda: (fitting,))
    assert check("lambert", only=["limits", "energy"]).green


def test_api_refuses_unknown_names():
    with pytest.raises(ParameterError, match="nonsense"):
        brdftab.check("nonsense")
    with pytest.raises(ParameterError, match="property = nonsense"):
        brdftab.check("lambert", only=["nonsense"])


def test_declared_switch_is_measured(monkeypatch):
    own = Checks(switches=(("half", {}, "kd", 0.5),))
    monkeypatch.setattr(Subject, "own", own)
    assert check("lambert", only=["switches"]).green
    broken(monkeypatch, "lambert", lambda f, angles, setup: f * (1.0 + 1e-3 * (setup.values["kd"].max() > 0.5)))
    report = check("lambert", only=["switches"])
    assert not report.green
    worst = report.rows[0].failing[0]
    assert worst.value == pytest.approx(1e-3, rel=0.01)
    assert worst.along[0] == "kd"


def test_page_names_every_property():
    page = (Path(__file__).resolve().parents[1] / "docs" / "check.md").read_text()
    for name in properties.names():
        assert f"| `{name}` |" in page


# ---------------------------------------------------------------- how stiff a fit is


def test_condition_sees_what_data_cannot_tell_apart():
    values = np.linspace(1.0, 2.0, 20)
    apart = np.stack([values, values**2], axis=1)
    together = np.stack([values, values * (1.0 + 1e-9 * values)], axis=1)
    assert condition.condition(apart) < 100.0
    assert condition.condition(together) > 1e8
    assert condition.condition(np.stack([values, 0.0 * values], axis=1)) > 1e15


def test_derivatives_of_residuals():
    f, c = np.array([0.2, 3.0]), np.array([0.5, 0.9])
    slopes = np.ones((2, 1))
    expected = {"linear": 1.0 + 0.0 * f, "log": 1.0 / (f + 1e-9), "cosine": c, "l1p": 1.0 / (1.0 + f)}
    for residual, factor in expected.items():
        assert np.allclose(condition.residual_jacobian(residual, f, slopes, c)[:, 0], factor, rtol=1e-12)


def test_recovery_grows_with_the_noise_and_starts_from_nothing():
    at = condition.fit_directions()
    beckmann, ggx = (resolve("cook-torrance", alpha=0.3, f0=0.2, ndf=ndf) for ndf in ("beckmann", "ggx"))
    # without noise what is left is rounding, and the distribution is known to the fit
    assert all(recovery.recovery_error(setup, "f0", at, 0.0, 1) < 1e-9 for setup in (beckmann, ggx))
    small, large = (recovery.recovery_error(beckmann, "f0", at, noise, 2) for noise in (0.001, 0.02))
    # to first order twenty times the noise is twenty times the error; measured 19.9
    assert 18.0 < large / small < 22.0
    assert 1e-4 < large < 0.01


def test_map_is_drawn_and_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(maps.condition_map, "__defaults__", ((3, 2), None))
    path = tmp_path / "map.png"
    result = run("--model", "ilm-approx", "--map", path, "--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert np.shape(found["condition"]) == (3, 2)
    assert np.min(found["condition"]) > 1.0
    # 192 directions average the noise out. Measured 0.0009 to 0.007; fits of three draws: 0.4 to 2.2 of it
    assert 1e-4 < np.min(found["expected"]) < np.max(found["expected"]) < 0.02
    ratio = np.array(found["recovery"]) / found["expected"]
    assert 0.15 < ratio.min() < ratio.max() < 3.0
    assert 0.6 < np.sqrt(np.mean(ratio**2)) < 1.5
    assert path.read_bytes()[:4] == b"\x89PNG"
    assert run("--model", "ilm-approx", "--map", path).exit_code == 2
    assert run("--model", "lambert", "--map", tmp_path / "other.png").exit_code == 2
    assert run("--all", "--map", tmp_path / "other.png").exit_code == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.png"]
