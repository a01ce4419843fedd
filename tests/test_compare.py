"""Comparison of tables, its figure, and the commands on files."""

import json
import math
import sys
import types

import click
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from brdftab._version import __version__
from brdftab.commands import files
from brdftab.errors import BrdftabError, GridError, OutputExistsError, ParameterError
from brdftab.io import read, write
from brdftab.plotting.difference import difference
from brdftab.tables import comparison
from brdftab.tables.grid import Grid
from brdftab.tables.table import Table

compare = comparison.compare


def make(text="3x4x5", dtype=np.float64, channels=("R", "G", "B"), components=(), mask=None, seed=0):
    rng = np.random.default_rng(seed)
    grid = Grid.parse(text)
    shape = (*grid.shape, len(channels))
    parts = {name: rng.random(shape).astype(dtype) for name in components}
    return Table(rng.random(shape).astype(dtype) + 0.5, grid, channels, parts, mask, {"model": "lambert", "k": [1, 2]})


def changed(table, index=None, value=None, **fields):
    """Copy a table with one number or some fields changed."""
    given_ = {"values": table.values.copy(), "grid": table.grid, "channels": table.channels, "mask": table.mask}
    given_ |= {"components": {k: v.copy() for k, v in table.components.items()}, "provenance": table.provenance}
    copy = Table(**(given_ | fields))
    if index is not None:
        copy.values[index] = value
    return copy


def test_equal_tables():
    result = compare(make(), make())
    assert result.equal
    assert (result.differing, result.total) == (0, 60)
    assert (result.max_rel, result.max_abs, result.rms) == (0.0, 0.0, 0.0)
    assert compare(make(), make(), rtol=0.0, atol=0.0).equal


def test_worst_cell_is_found():
    a = make()
    b = changed(a, (2, 1, 3, 1), a.values[2, 1, 3, 1] * 1.5)
    b.values[0, 0, 0] *= 1.1
    result = compare(a, b, rtol=1e-3, atol=0.0)
    assert not result.equal
    assert result.differing == 2
    assert result.components == {"": 4}
    assert result.worst_index == (2, 1, 3, 1)
    assert result.channel == "G"
    assert result.directions == {"theta_i": 75.0, "theta_o": 33.75, "phi": 126.0}
    assert (result.value_a, result.value_b) == (a.values[2, 1, 3, 1], b.values[2, 1, 3, 1])
    assert result.rel_difference == result.max_rel == pytest.approx(1 / 3, rel=1e-15)
    # the same cell is the worst one where nothing is allowed
    assert compare(a, b, rtol=0.0, atol=0.0).worst_index == (2, 1, 3, 1)


def test_anisotropic_index():
    a = make("2x3x4x5", channels=("Y",))
    result = compare(a, changed(a, (1, 2, 3, 4, 0), 9.0))
    assert result.worst_index == (1, 2, 3, 4, 0)
    assert list(result.directions) == ["theta_i", "phi_i", "theta_o", "phi_o"]
    assert result.directions["phi_o"] == 324.0


@settings(max_examples=80, deadline=None)
@given(st.floats(0, 1), st.floats(0, 1), st.integers(0, 2**32))
def test_agrees_with_the_plain_definition(rtol, atol, seed):
    a, b = make(seed=seed), make(seed=seed + 1)
    result = compare(a, b, rtol=rtol, atol=atol)
    gap = np.abs(a.values - b.values)
    differs = gap > atol + rtol * np.maximum(np.abs(a.values), np.abs(b.values))
    assert result.differing == differs.any(axis=-1).sum()
    assert result.components[""] == differs.sum()
    assert result.max_abs == gap.max()
    # summed row by row in another order than here
    assert result.rms == pytest.approx(math.sqrt((gap**2).sum() / (a.values**2).sum()), rel=1e-13)
    assert compare(b, a, rtol=rtol, atol=atol).differing == result.differing


def test_not_finite_numbers():
    a = make()
    for x, y, differs in [
        (np.nan, np.nan, True),
        (np.nan, 1.0, True),
        (np.inf, np.inf, False),
        (np.inf, -np.inf, True),
        (np.inf, 1.0, True),
        (1.7e308, -1.7e308, True),
    ]:
        one, two = changed(a, (1, 1, 1, 0), x), changed(a, (1, 1, 1, 0), y)
        result = compare(one, two, rtol=0.5, atol=1.0)
        assert result.equal is not differs
        if differs:
            assert result.worst_index == (1, 1, 1, 0)
        json.dumps(result.to_json(), allow_nan=False)


def test_masks():
    a = make()
    mask = np.ones(a.shape, dtype=bool)
    mask[0, 0, 0, 0] = False
    one, two = changed(a, (0, 0, 0, 0), np.nan, mask=mask), changed(a, (0, 0, 0, 0), 7.0, mask=mask)
    assert compare(one, two).equal
    result = compare(one, a)
    assert (result.differing, result.mask_differs) == (1, 1)
    nothing = changed(a, mask=np.zeros(a.shape, dtype=bool))
    result = compare(nothing, nothing)
    assert result.equal
    assert result.worst_index is None


def test_components():
    a = make(components=("order1", "order2"))
    b = changed(a)
    b.components["order2"][1, 2, 3, 0] += 1
    result = compare(a, b)
    assert (result.component, result.worst_index) == ("order2", (1, 2, 3, 0))
    assert result.components == {"": 0, "order1": 0, "order2": 1}
    # one table without components is compared by its total
    assert compare(a, changed(b, components={})).equal
    with pytest.raises(ParameterError, match="order2"):
        compare(a, changed(a, components={"order1": a.components["order1"]}))


def test_float32_against_float64():
    a = make()
    b = changed(a, values=a.values.astype(np.float32))
    result = compare(a, b)
    assert result.equal
    assert result.rtol == 1e-5
    assert result.atol == pytest.approx(1e-12 * b.values.max())
    # half a unit in the last place of float32
    assert 0 < result.max_rel < 6e-8
    assert not compare(a, b, rtol=1e-9).equal


def test_what_does_not_match_is_refused():
    a = make()
    for b, match in [
        (make(channels=("X", "Y", "Z")), "channels differ"),
        (make("3x4x6"), "3x4x5 and 3x4x6"),
        (make("3x4x5x5"), "grids differ"),
        (changed(a, grid=Grid.parse("3x4x5", "average")), "cells differ"),
        (changed(a, grid=Grid.from_axes(theta_i="1,2,3", theta_o="1,2,3,4", phi="1,2,3,4,5")), "axis theta_i differs"),
    ]:
        with pytest.raises(GridError, match=match) as caught:
            compare(a, b)
        assert "\n" not in str(caught.value)
    for name, value in (("rtol", -1.0), ("atol", math.nan), ("rtol", math.inf)):
        with pytest.raises(ParameterError, match=name):
            compare(a, a, **{name: value})


# the figure


@pytest.mark.parametrize("case", ["differ", "equal", "nan", "masked", "4-D"])
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_figure(tmp_path, case):
    a = make("2x3x4x5" if case == "4-D" else "3x4x5")
    b = changed(a) if case == "equal" else changed(a, (1, 1, 1), np.nan if case == "nan" else 3.0)
    if case == "masked":
        a, b = (changed(t, mask=np.zeros(t.shape, dtype=bool)) for t in (a, b))
    path = tmp_path / "d.png"
    difference(a, b, compare(a, b), path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert [p.name for p in tmp_path.iterdir()] == ["d.png"]
    with pytest.raises(OutputExistsError, match="--overwrite"):
        difference(a, b, compare(a, b), path)


def test_figure_refusals(tmp_path, monkeypatch):
    a = make()
    with pytest.raises(BrdftabError, match="ending"):
        difference(a, a, compare(a, a), tmp_path / "d.exr")
    with pytest.raises(BrdftabError, match="does not exist"):
        difference(a, a, compare(a, a), tmp_path / "no" / "d.png")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(BrdftabError, match=r"brdftab\[report\]"):
        difference(a, a, compare(a, a), tmp_path / "d.png")
    assert list(tmp_path.iterdir()) == []


# the commands


class _Group(click.Group):
    """Turn an error into a line and status 2, as the tool's own group does."""

    def invoke(self, ctx):
        try:
            return super().invoke(ctx)
        except BrdftabError as error:
            click.echo(f"Error: {error}", err=True)
            ctx.exit(2)


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    group = _Group(commands={"info": files.info, "compare": files.compare, "verify": files.verify})
    return lambda *words: CliRunner().invoke(group, list(words))


def test_info(run):
    mask = np.ones((3, 4, 5, 3), dtype=bool)
    mask[0, 0, 0, 0] = False
    table = make(dtype=np.float32, components=("order1",), mask=mask)
    table.values[1, 1, 1, 1] = -0.25
    table.provenance["note"] = "two\nlines\x1b[31m"
    write(table, "t.exr")
    done = run("info", "t.exr")
    assert done.exit_code == 0
    for words in ("lambert", "3 4 5 3", "float32", "11.25 to 78.75 deg", "order1", "1/sr", "masked 1", "negative 1"):
        assert words in done.output
    assert "\x1b" not in done.output
    facts = json.loads(run("info", "t.exr", "--json").output)
    assert facts["shape"] == [3, 4, 5, 3]
    assert facts["axes"]["theta_i"] == {"count": 3, "first_degrees": 15.0, "last_degrees": 75.0}
    assert facts["values"]["min"] == -0.25
    assert facts["provenance"] == table.provenance
    assert facts["convention"] == table.convention
    done = run("info", "missing.exr")
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1


def test_compare_command(run, tmp_path):
    a = make()
    write(a, "a.npz")
    write(a, "a.exr")
    write(changed(a, (2, 1, 3, 1), 9.0), "b.exr")
    done = run("compare", "a.npz", "a.exr")
    assert done.exit_code == 0
    assert "equal: 0 of 60 cells differ" in done.output
    done = run("compare", "a.npz", "b.exr", "--figure", "d.png")
    assert done.exit_code == 1
    for words in ("1 of 60 cells", "theta_i = 75", "theta_o = 33.75", "phi = 126", "b = 9", "[2, 1, 3] G"):
        assert words in done.output
    assert (tmp_path / "d.png").exists()
    assert run("compare", "a.npz", "b.exr", "--figure", "d.png").exit_code == 2
    assert run("compare", "a.npz", "b.exr", "--figure", "d.png", "--overwrite").exit_code == 1
    assert run("compare", "a.npz", "b.exr", "--rtol", "0.99").exit_code == 0
    assert run("compare", "a.npz", "b.exr", "--rtol", "-1").exit_code == 2
    found = json.loads(run("compare", "a.npz", "b.exr", "--json").output)
    assert (found["equal"], found["differing"], found["worst_index"]) == (False, 1, [2, 1, 3, 1])
    write(make("2x2x2"), "c.npz")
    done = run("compare", "a.npz", "c.npz")
    assert (done.exit_code, done.stdout) == (2, "")


def test_verify_command(run, monkeypatch):
    calls = []

    def retabulate(table, threads=None):
        calls.append(threads)
        if table.provenance["model"] != "lambert":
            raise ParameterError("model = nonesuch is not known")
        return make(dtype=table.dtype)

    module = types.ModuleType("brdftab.validate.reproduce")
    module.retabulate = retabulate
    monkeypatch.setitem(sys.modules, "brdftab.validate.reproduce", module)
    good = make()
    write(good, "good.npz")
    done = run("verify", "good.npz", "--threads", "2")
    assert done.exit_code == 0
    assert done.output == "good.npz: repeats in all 60 cells (max relative difference 0)\n"
    assert calls == [2]
    write(changed(good, (0, 0, 0, 0), 5.0, version="0.0.1"), "bad.exr")
    done = run("verify", "good.npz", "bad.exr")
    assert done.exit_code == 1
    assert len(done.output.splitlines()) == 2
    assert f"made by brdftab 0.0.1, {__version__} is installed" in done.output
    assert "1 of 60 cells differ; worst R at theta_i 15, theta_o 11.25, phi 18 deg: file 5, now" in done.output
    write(changed(good, provenance={"model": "nonesuch"}), "odd.npz")
    done = run("verify", "odd.npz", "missing.npz", "bad.exr", "good.npz")
    assert done.exit_code == 2
    assert len(done.stderr.splitlines()) == 2
    assert len(done.stdout.splitlines()) == 2
    done = run("verify", "odd.npz", "bad.exr", "good.npz", "--json")
    assert [item["status"] for item in json.loads(done.stdout)] == ["error", "differs", "equal"]
    assert read("good.npz").version == __version__


def test_help_has_examples(run):
    for name in ("info", "compare", "verify"):
        assert f"brdftab {name} " in run(name, "--help").output
