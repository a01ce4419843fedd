"""A fit with nothing said: every model finds its own table again, and what it holds is told."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab import models
from brdftab.cli import main
from brdftab.errors import ParameterError
from brdftab.fit.parameters import parse
from brdftab.golden.settings import settings as golden_settings
from brdftab.models import twins
from brdftab.models.common_params import FRESNEL_PARAMS
from brdftab.models.declaration import Model, Param
from brdftab.models.resolve import resolve
from brdftab.validate import differences, sweep

FITTABLE = [name for name in models.names() if models.has_twin(name)]
OWN = """
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="own-k", title="Two numbers", summary="kd (1 + k sin(theta_i) sin(theta_o)) / pi",
    params=(
        Param("kd", "", 0.5, (0.0, 1.0), "albedo", "channels", role="albedo"),
        Param("k", "", 1.5, (1.0, 9.0), "its own parameter, no extinction"),
        Param("exponent", "", 2.0, (0.0, 20.0), "its own, too"),
    ),
    components=("diffuse",), citation="none", doi="", variant="none",
)
"""
OWN_TWIN = """
import math

SHAPE_PARAMS = ()


def shapes(static, p, d):
    return (d.si * d.so, d.ci * d.co)


def value(static, p, shapes, d):
    return p["kd"] * (1.0 + p["k"] * shapes[0] + p["exponent"] * shapes[1]) / math.pi
"""

# every name here has another meaning in some model of the registry, or in what serves them
NAMES = """
from brdftab.models.declaration import Model, Param
from brdftab.models.common_params import NDF_NO_PHONG

SPEC = Model(
    name="own-names", title="Names", summary="sums of numbers that bear the names of others",
    params=(
        *NDF_NO_PHONG[:2],
        Param("kd", "", 0.5, (0.0, 9.0), "a number"),
        Param("weights", "", 1.5, (1.0, 9.0), "a number"),
        Param("max_bounces", "", 2.5, (0.0, 20.0), "a number"),
        Param("eta", "", 2.0, (0.0, 20.0), "a number"),
        Param("sigma", "rad", 0.3, (0.0, 1.0), "an angle"),
        Param("material", "", "wood", None, "a word", "choice", ("wood", "stone")),
        Param("seed", "", "round", None, "a word", "choice", ("round", "long")),
        Param("ior", "", 1.0, (0.0, 1.0), "a number a channel", "channels"),
    ),
    components=("facets",), ndfs=("ggx",), citation="none", doi="", variant="none",
)
"""
NAMES_TWIN = """
SHAPE_PARAMS = ("alpha_x", "alpha_y")


def shapes(static, p, d):
    return (p["alpha_x"] * d.ci * d.co, d.si * d.so, d.ci**2 * d.co**2, d.si**2 * d.so**2)


def value(static, p, s, d):
    return p["kd"] * (1.0 + s[0] + p["weights"] * s[1] + p["eta"] * s[2] + p["max_bounces"] * s[3])
"""
NAMES_KERNEL = """
import numpy as np


def points(setup, theta_i, theta_o, phi, phi_i, *, orders, tolerance):
    c, s = np.cos(theta_i) * np.cos(theta_o), np.sin(theta_i) * np.sin(theta_o)
    v = setup.values
    found = v["kd"] * (1.0 + setup.alpha_x * c + v["weights"] * s + v["eta"] * c**2 + v["max_bounces"] * s**2)
    return found[:, None, None]
"""


def told(*words):
    """Run the command line and return what it prints."""
    done = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def truth(table, result):
    """Return found and true values of the free parameters of one model."""
    known = table.provenance["parameters"]
    return {n: (np.ravel(v), np.ravel(known[n])) for n, v in result.values.items()}


@pytest.mark.parametrize("name", FITTABLE)
def test_every_model_finds_its_own_table_again(name):
    table = brdftab.tabulate(name, "10x10x12")
    result = brdftab.fit_model(table, name)
    # data without noise have standard errors below what the finest rule of ilm leaves, which is told
    assert [w for w in result.warnings if "quadrature rule" not in w] == []
    for found, true in truth(table, result).values():
        # the rules of the V-grooves err most, by the averages of the mirror cells: measured 1.6e-4
        np.testing.assert_allclose(found, true, rtol=5e-4)
    made = table.provenance["parameters"]
    kept = {n: v for n, v in made.items() if n not in result.values}
    assert result.fixed[name] == kept
    assert all(result.fixed_from[name][n] == "file" for n in ("ndf", "masking", "material", "variant") if n in kept)


@pytest.mark.parametrize(("ndf", "masking"), [("ggx", "smith-walter"), ("phong", "separable")])
def test_the_fit_of_a_prediction_is_the_same(tmp_path, ndf, masking):
    first, second, facts = tmp_path / "a.npz", tmp_path / "b.npz", tmp_path / "b.json"
    choices = ("--ndf", ndf, "--masking", masking)
    told("tabulate", "--model", "smith", *choices, "--f0", ".9,.6,.3", "--grid", "12x12x18", "--out", first)
    text = told("fit", first, "--model", "smith", "--predict", second, "--grid", "12x12x18")
    assert f"smith.ndf = {ndf} (from the file), smith.masking = {masking} (from the file)" in text
    assert "warning" not in text
    told("fit", second, "--model", "smith", "--out", facts)
    found = json.loads(facts.read_text())
    assert found["fixed_from"]["smith"] == {"ndf": "file", "masking": "file"}
    assert found["values"]["alpha"] == pytest.approx(0.5, rel=1e-6)
    np.testing.assert_allclose(found["values"]["f0"], [0.9, 0.6, 0.3], rtol=1e-6)
    assert found["metrics"]["log_rms"] < 1e-5
    assert brdftab.read(second).provenance["parameters"]["ndf"] == ndf
    assert "repeats in all" in told("verify", second)
    assert told("info", second)
    assert told("compare", first, second, "--rtol", 1e-4)


def test_what_the_user_says_goes_before_the_file():
    made = {"parameters": {"ndf": "ggx", "masking": "separable", "material": "Cu", "alpha": 0.2}}
    kept = parse("smith", None, {"ndf": "phong"}, made)
    assert kept.terms[0].fixed == {"ndf": "phong", "masking": "separable", "material": "Cu"}
    assert kept.terms[0].carried == ("masking", "material")
    assert [v.name for v in kept.variables] == ["alpha"]
    for free, fixed in ((["alpha", "f0"], {}), (None, {"ior": 1.5}), (None, {"f0": 0.5})):
        assert "material" not in parse("smith", free, fixed, made).terms[0].fixed
    # a value that the model does not take is passed over
    assert parse("ilm-approx", None, {}, made).terms[0].fixed == {}
    nested = {"parameters": {"smith": {"ndf": "ggx"}, "smith2": {"ndf": "phong"}, "lambert": {"kd": 0.5}}}
    assert [t.fixed for t in parse("smith+smith", None, {}, nested).terms] == [{"ndf": "ggx"}, {"ndf": "phong"}]
    for odd in ({}, {"parameters": None}, {"parameters": {"ndf": ["ggx"]}}, {"plan": {}}):
        assert parse("smith", None, {}, odd).terms[0].fixed == {}


def test_a_value_on_its_bound_can_be_evaluated():
    for name, free in (("smith", "alpha"), ("smith", "eta"), ("ilm", "sigma")):
        fixed = {"k": 1.0} if free == "eta" else {}
        total = parse(name, None, fixed)
        variable = next(v for v in total.variables if v.name == free)
        for bound in (variable.low, variable.high):
            assert variable.outer(variable.inner(bound)) == bound
        ends = total.unpack(total.bounds(1)[1] * (1.0 + 1e-15), 1)
        assert ends[free] <= models.spec(name).param(free).bounds[1]


def test_tails_that_no_one_measures_do_not_count():
    table = brdftab.tabulate("smith", "12x12x18", ndf="beckmann", alpha=0.1, f0=0.5, dtype="float64")
    result = brdftab.fit_model(table, "smith")
    assert table.values.min() < 1e-30
    assert result.loss["floor"] == pytest.approx(1e-6 * 0.2, rel=1.0)
    # the tails are lost in whatever stands there
    dirty = brdftab.Table(np.maximum(table.values, 1e-12), table.grid, table.channels)
    again = brdftab.fit_model(dirty, "smith")
    assert again.values["alpha"] == pytest.approx(0.1, rel=1e-5)
    assert again.metrics["log_rms"] < 1e-4
    assert again.warnings == []
    # the floor goes with the unit
    times = brdftab.fit_model(
        brdftab.Table(7.0 * table.values, table.grid, table.channels), "smith+lambert", samples=2000
    )
    plain = brdftab.fit_model(table, "smith+lambert", samples=2000)
    assert times.loss["floor"] == pytest.approx(7.0 * plain.loss["floor"])


def test_poor_is_judged_by_what_the_data_are_worth():
    one = brdftab.tabulate("smith", "16x16x24", ndf="beckmann", alpha=0.4, f0=0.5, dtype="float64")

    def poor(noise, other=0.0):
        rng = np.random.default_rng(3)
        values = one.values * np.exp(noise * rng.standard_normal(one.values.shape)) + other
        result = brdftab.fit_model(brdftab.Table(values, one.grid, one.channels), "smith")
        return result.metrics["log_rms"], any("poor fit" in line for line in result.warnings)

    # noise that the data themselves show, as large as what was once called poor
    level, warned = poor(0.5)
    assert level > 0.4
    assert not warned
    # a body that the model does not have, seen in its dark directions alone
    level, warned = poor(0.01, 1e-6)
    assert 0.2 < level < 0.3
    assert warned


def warned(values, table, name, **fixed):
    """Return the log-RMS of a fit of other values on a table's grid, and its lines on a poor fit."""
    result = brdftab.fit_model(brdftab.Table(values, table.grid, table.channels), name, **fixed)
    return result.metrics["log_rms"], [line for line in result.warnings if line.startswith("poor fit")]


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.2, 0.6])
@pytest.mark.parametrize("copies", [False, True])
def test_noise_is_no_misfit(noise, copies):
    table = brdftab.tabulate("ilm", "16x16x24", kd=[0.5, 0.3, 0.2], ior=1.7, sigma=0.4, dtype="float64")
    factors = np.exp(noise * np.random.default_rng(3).standard_normal(table.values.shape))
    if copies:
        # data that are reciprocal by construction hold each value twice, and show no floor
        factors = np.where((table.grid.theta_i[:, None] <= table.grid.theta_o)[..., None, None], factors, 0.0)
        factors = factors + np.where(factors == 0.0, factors.transpose(1, 0, 2, 3), 0.0)
    level, lines = warned(table.values * factors, table, "ilm")
    assert level == pytest.approx(noise, rel=0.1, abs=1e-4)
    assert lines == []


def test_a_misfit_is_no_noise_and_its_cause_is_named():
    table = brdftab.tabulate("ilm", "16x16x24", kd=[0.5, 0.3, 0.2], dtype="float64")
    result = brdftab.fit_model(table, "ilm", ndf="ggx")
    assert result.metrics["log_rms"] < 0.1
    (line,) = [line for line in result.warnings if line.startswith("poor fit")]
    assert "the data were made with ndf = beckmann, this fit holds ndf = ggx" in line
    # the same without a word of where they come from, and under 2 % of noise
    noisy = table.values * np.exp(0.02 * np.random.default_rng(3).standard_normal(table.values.shape))
    _, (line,) = warned(noisy, table, "ilm", ndf="ggx")
    assert "try another ndf, model or sum of models" in line
    bright = brdftab.fit_model(brdftab.Table(table.values + 1.0, table.grid, table.channels), "lambert")
    assert any(line.startswith("poor fit") and "end on a bound" in line for line in bright.warnings)


@pytest.mark.parametrize("name", ["smith", "cook-torrance", "ilm"])
@pytest.mark.parametrize("optics", [{"ior": 1.6}, {"f0": 0.3}, {"eta": 0.4, "k": 2.2}])
def test_the_source_of_reflectance_is_that_of_the_table(name, optics):
    if name == "ilm" and "eta" in optics:
        pytest.skip("interfaces are dielectrics")
    table = brdftab.tabulate(name, "12x12x18", **optics)
    result = brdftab.fit_model(table, name)
    for key, true in optics.items():
        # eta and k make up for each other, to a ten thousandth
        np.testing.assert_allclose(result.values[key], true, rtol=1e-3)
    assert result.metrics["log_rms"] < 1e-4
    # of the user's own word first
    assert "f0" in brdftab.fit_model(table, name, "f0", samples=500).values


def test_a_source_that_no_fit_has_is_passed_over():
    made = {"parameters": {"ndf": "ggx", "ior": [1.4, 1.5, 1.6]}}
    assert [v.param for v in parse("smith", None, {}, made).variables] == ["alpha", "f0"]
    through = {"parameters": {"ndf": "ggx", "ior": 1.5}}
    assert [v.param for v in parse("smith-multi", None, {}, through).variables] == ["alpha", "f0"]


def test_the_roughness_of_a_fit_can_be_evaluated():
    for ndf, high in (("phong", math.sqrt(2.0)), ("ggx", 10.0)):
        (variable,) = [v for v in parse("vgroove-nonsym", None, {"ndf": ndf}).variables if v.param == "alpha"]
        assert 0.99 * high < variable.high <= high
        brdftab.evaluate("vgroove-nonsym", 0.3, 0.5, 2.0, ndf=ndf, alpha=variable.high, tolerance=1e-2)


# ---------------------------------------------------------------- a model's own parameters


@pytest.fixture
def own_k(tmp_path, monkeypatch):
    """Register models whose own parameters bear the names of optical and other ones."""
    parts = {"own_k": (OWN, OWN_TWIN, ""), "own_names": (NAMES, NAMES_TWIN, NAMES_KERNEL)}
    for name, (spec, twin, kernel) in parts.items():
        folder = tmp_path / name
        folder.mkdir()
        (folder / "__init__.py").write_text(spec)
        (folder / "twin.py").write_text(twin)
        (folder / "kernel.py").write_text(kernel)
    monkeypatch.setattr(models, "__path__", [*models.__path__, str(tmp_path)])
    yield
    for name in [n for n in sys.modules if n.startswith(("brdftab.models.own_k", "brdftab.models.own_names"))]:
        del sys.modules[name]


@pytest.mark.usefixtures("own_k")
def test_a_models_own_k_is_free():
    grid = brdftab.Grid.parse("10x10x8")
    ti, to = (np.asarray(a).reshape(s) for a, s in ((grid.theta_i, (-1, 1, 1)), (grid.theta_o, (1, -1, 1))))
    shape = 1.0 + 4.0 * np.sin(ti) * np.sin(to) + 7.0 * np.cos(ti) * np.cos(to)
    values = 0.1 / math.pi * np.broadcast_to(shape, grid.shape)[..., None]
    result = brdftab.fit_model(brdftab.Table(values.copy(), grid, ("Y",)), "own-k")
    assert result.values["k"] == pytest.approx(4.0, rel=1e-5)
    assert result.values["exponent"] == pytest.approx(7.0, rel=1e-5)
    assert result.fixed == {"own-k": {}}
    held = brdftab.fit_model(brdftab.Table(values.copy(), grid, ("Y",)), "own-k", "kd,exponent")
    assert held.fixed == {"own-k": {"k": 1.5}}
    assert held.fixed_from == {"own-k": {"k": "default"}}


@pytest.mark.usefixtures("own_k")
def test_names_mean_what_their_model_says(tmp_path):
    given = {"kd": 0.7, "weights": 4.0, "max_bounces": 7.5, "eta": 3.0, "alpha": 0.4, "material": "stone"}
    setup = resolve("own-names", **given)
    assert setup.fresnel is None
    assert setup.max_bounces is None
    assert setup.values["material"] == "stone"
    assert setup.values["max_bounces"] == 7.5
    # through the command line, where the same options serve the other models
    out = tmp_path / "a.npz"
    words = [f"--{n.replace('_', '-')}={v}" for n, v in given.items()]
    call = (
        f"from brdftab import models; models.__path__.append({str(tmp_path)!r}); from brdftab.cli import main; main()"
    )
    words += ["--sigma=30", "--grid=10x10x8", f"--out={out}"]
    subprocess.run([sys.executable, "-c", call, "tabulate", "--model=own-names", *words], check=True)
    table = brdftab.read(out)
    assert table.provenance["parameters"]["sigma"] == pytest.approx(math.radians(30.0))
    assert table.provenance["parameters"]["max_bounces"] == 7.5
    free = [n for n in given if n not in ("material", "alpha")]
    result = brdftab.fit_model(table, "own-names", free, alpha=0.4)
    for name in free:
        assert result.values[name] == pytest.approx(given[name], rel=1e-5)
    # the word of the file holds; numbers are not what a cap or a spectrum is
    assert result.fixed_from["own-names"] == {
        "ndf": "file",
        "alpha": "user",
        "sigma": "default",
        "material": "file",
        "seed": "file",
        "ior": "default",
    }
    assert result.fixed["own-names"]["material"] == "stone"
    # as each is moved by itself
    angles = np.full(3, 0.3), np.full(3, 0.8), np.full(3, 2.0), np.zeros(3)
    for name in ("weights", "kd", "eta"):
        step = 1e-6
        moved = [brdftab.evaluate("own-names", *angles[:3], **{**given, name: given[name] + d}) for d in (-step, step)]
        exact = twins.derivative(setup, name, *angles)
        np.testing.assert_allclose(exact, (moved[1] - moved[0]) / (2.0 * step), rtol=1e-7)
        assert differences.entry(setup, name, 0) == given[name]
    assert set(golden_settings("own-names")) == {"ggx", "material stone", "seed long"}
    assert all("eta" in v.free and "weights" in v.free for v in sweep.variants("own-names"))


def test_names_that_twins_use_are_refused():
    for name, more in (("a", FRESNEL_PARAMS), ("prepared", ())):
        with pytest.raises(ValueError, match=f"{name} of model x is what twins call something else"):
            Model("x", "", "", (Param(name, "", 1.0, (0.0, 1.0), ""), *more), ("one",), "", "", "")


def test_an_angle_in_one_term_and_a_number_in_another_is_asked_for(tmp_path):
    data = tmp_path / "x.npz"
    brdftab.write(brdftab.tabulate("lambert", "4x4x4"), data)
    done = CliRunner().invoke(main, ["fit", str(data), "--model", "ilm+oren-nayar", "--start", "sigma=20"])
    assert done.exit_code == 2
    assert "ilm.sigma, oren-nayar.sigma" in done.output


# ---------------------------------------------------------------- several models


def test_several_models_in_one_call(tmp_path):
    table = brdftab.tabulate("lambert", "8x8x8", kd=0.3, dtype="float64")
    coat = brdftab.tabulate("smith", "8x8x8", ndf="ggx", alpha=0.35, f0=0.04, dtype="float64")
    coat.values = coat.values + table.values
    best, *others = brdftab.rank_models(coat, ["lambert", "smith+lambert", "smith"], alpha=0.35, samples=500)
    assert best.model == "smith+lambert"
    assert {r.model for r in others} == {"smith", "lambert"}
    assert best.fixed["smith"]["alpha"] == 0.35
    assert best.values["kd"][0] == pytest.approx(0.3, rel=1e-6)
    with pytest.raises(ParameterError, match="sigma is not a parameter of any of"):
        brdftab.rank_models(coat, ["smith", "lambert"], sigma=0.3)
    with pytest.raises(ParameterError, match="rank_models"):
        brdftab.fit_model(coat, "smith,lambert")
    with pytest.raises(ParameterError, match="model = 3 is no name"):
        brdftab.fit_model(coat, 3)
    for wrong in ("smith", [], ["lambert", 3]):
        with pytest.raises(ParameterError, match="is no list of names"):
            brdftab.rank_models(coat, wrong)
    data, out = tmp_path / "a.npz", tmp_path / "b.npz"
    brdftab.write(coat, data)
    text = told("fit", data, "--model", "lambert,smith+lambert", "--predict", out, "--grid", "8x8x8")
    assert f"{out} (smith+lambert, the best by BIC)" in text
    np.testing.assert_allclose(brdftab.read(out).values, coat.values, rtol=1e-5)
    assert told("info", out)
    assert told("compare", data, out, "--rtol", 1e-4)
