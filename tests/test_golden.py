"""Golden tables: the folder is complete and says where it is from, and a check finds what does not hold.

Whether the numbers hold is asked once, by ``brdftab golden check tests/golden`` in .ci/run.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab import models
from brdftab.cli import main
from brdftab.errors import BrdftabError, FileFormatError, ParameterError
from brdftab.evaluation.points import is_stochastic
from brdftab.golden.points import SUFFIX, read_points
from brdftab.golden.quantities import QUANTITIES
from brdftab.golden.record import files_of, read_sources
from brdftab.golden.settings import directions, settings
from brdftab.golden.tables import LIST, special_tables
from brdftab.models.resolve import resolve
from brdftab.tables.grid import Grid

HERE = Path(__file__).parent / "golden"
NAMES = models.names()
LIMIT = 5_000_000


def run(*words):
    return CliRunner().invoke(main, ["golden", *map(str, words)])


# ---------------------------------------------------------------- the folder


def test_folder_holds_what_the_registry_and_the_list_ask_for():
    there = {p.name for p in HERE.iterdir() if p.suffix in {".exr", ".npz"}}
    assert there == set(files_of(HERE)) == set(read_sources(HERE))
    for name, entry in read_sources(HERE).items():
        assert {"command", "generator", "tool", "with", "date", "tolerance"} == set(entry), name
        assert name in entry["command"], name
    assert sum(p.stat().st_size for p in HERE.iterdir()) < LIMIT
    # every kind of file, cell and type is in the list
    tables = [brdftab.read(HERE / entry.file) for entry in special_tables(HERE)]
    assert {t.grid.cell for t in tables} == {"center", "average", "point"}
    assert {t.dtype.name for t in tables} == {"float32", "float64"}
    assert {t.grid.isotropic for t in tables} == {True, False}
    assert {Path(entry.file).suffix for entry in special_tables(HERE)} == {".exr", ".npz"}


@pytest.mark.parametrize("entry", special_tables(HERE), ids=lambda entry: entry.file)
def test_tables_are_those_of_the_list(entry):
    made = brdftab.read(HERE / entry.file).provenance
    assert (made["model"], made["tolerance"], made["components"]) == (entry.model, entry.tolerance, entry.components)
    # parameters that the model got since then stand at their defaults
    again = resolve(entry.model, **made["parameters"])
    assert again.parameters == resolve(entry.model, **entry.in_radians()).parameters
    if isinstance(entry.grid, str):
        assert made["grid"] == "x".join(map(str, Grid.parse(entry.grid).shape))


@pytest.mark.parametrize("name", NAMES)
def test_points_cover_the_declaration(name):
    spec = models.spec(name)
    head, held = read_points(HERE / f"{name}{SUFFIX}")
    assert head["model"] == name
    given = [h.parameters for h in held]
    assert {p.get("ndf") for p in given} >= set(spec.ndfs)
    for param in spec.params:
        if param.kind == "choice" and param.choices:
            # a default may stand as what it leads to
            seen = {param.default, *(p.get(param.name) for p in given)}
            assert not {c for c in set(param.choices) - seen if _taken(name, {param.name: c})}, param.name
    if spec.has("material"):
        for ndf in spec.ndfs or (None,):
            kinds = {resolve(name, **p).fresnel.kind for p in given if p.get("ndf") == ndf}
            # F = 1, conductors, dielectrics, Schlick
            assert len(kinds) == 4, (ndf, kinds)
    for h in held:
        setup = resolve(name, **h.parameters)
        assert set(h.quantities) == set(QUANTITIES) - ({"albedo"} if is_stochastic(setup) else set()), h.label
        count, channels = h.directions.shape[1], len(setup.channels)
        assert h.quantities["values"].shape == (count, channels)
        assert h.quantities["components"].shape == (count, len(h.components), channels)
        assert all(np.isfinite(a).all() for a in h.quantities.values()), h.label
        assert (h.quantities["values"] != 0.0).any(axis=1).mean() > 0.5, h.label
        # arccos and arctan2 differ in the last digit from processor to processor: 4.4e-16 seen without AVX-512
        assert np.allclose(h.directions, directions(setup), rtol=0.0, atol=1e-14), h.label


def _taken(name, given):
    try:
        resolve(name, **given)
    except ParameterError:
        return False
    return True


@pytest.mark.parametrize("name", NAMES)
def test_settings_of_the_file_are_those_of_the_registry(name):
    _, held = read_points(HERE / f"{name}{SUFFIX}")
    wanted = {label: resolve(name, **given).parameters for label, given in settings(name).items()}
    assert {h.label: h.parameters for h in held} == wanted


def test_numbers_of_the_paths_agree_where_they_must():
    # of a model without a prepared path the total of tables is the sum of the components
    _, held = read_points(HERE / f"smith{SUFFIX}")
    for h in held:
        assert np.allclose(h.quantities["components"].sum(axis=1), h.quantities["values"], rtol=1e-12), h.label


# ---------------------------------------------------------------- recording and checking


@pytest.fixture
def folder(tmp_path):
    """Return a folder of its own with a list of one special table."""
    (tmp_path / LIST).write_text(
        '[[table]]\nfile = "small.npz"\nmodel = "oren-nayar"\ngrid = "3x3x4"\n'
        'parameters = { sigma = 30.0, kd = 0.4 }\ncomponents = true\ndtype = "float64"\n'
    )
    return tmp_path


CHEAP = ("lambert*", "small*")
ONLY = [word for pattern in CHEAP for word in ("--only", pattern)]


def test_recorded_tables_hold_until_a_number_changes(folder):
    assert brdftab.record_golden(folder, only=CHEAP) == ["lambert.points.npz", "small.npz"]
    table = brdftab.read(folder / "small.npz")
    assert table.provenance["parameters"]["sigma"] == pytest.approx(math.radians(30.0))
    assert set(read_sources(folder)) == {"lambert.points.npz", "small.npz"}
    assert [r.status for r in brdftab.check_golden(folder, only=CHEAP)] == ["equal", "equal"]
    # what exists is kept
    assert brdftab.record_golden(folder, only=CHEAP) == []
    stamp = (folder / "small.npz").stat().st_mtime_ns
    assert run("record", folder, *ONLY, "--overwrite", "--json").exit_code == 0
    assert (folder / "small.npz").stat().st_mtime_ns > stamp
    assert run("check", folder, *ONLY).exit_code == 0
    # two processes share the files and give the same account
    shared = brdftab.check_golden(folder, only=CHEAP, jobs=2)
    assert [(r.file, r.status) for r in shared] == [("lambert.points.npz", "equal"), ("small.npz", "equal")]


def test_a_changed_model_is_found_with_its_worst_cells(folder, monkeypatch):
    brdftab.record_golden(folder, only=CHEAP)
    kernel = models.kernel("lambert")
    plain = kernel.points
    off = lambda *a, **k: plain(*a, **k) * np.where(np.arange(len(a[1])) == 9, 1.0 + 1e-6, 1.0)[:, None, None]  # noqa: E731
    monkeypatch.setattr(kernel, "points", off)
    figures = folder / "figures"
    figures.mkdir()
    done = run("check", folder, *ONLY, "--figure-dir", figures, "--json")
    assert done.exit_code == 1
    points, small = json.loads(done.stdout)
    assert (points["status"], small["status"]) == ("differs", "equal")
    assert 1e-6 * 0.99 < points["largest_relative"] < 1e-6 * 1.01
    _, held = read_points(folder / "lambert.points.npz")
    assert points["worst"][0]["degrees"]["theta_i"] == pytest.approx(math.degrees(held[0].directions[0, 9]))
    assert points["worst"][0]["now"] == pytest.approx(points["worst"][0]["golden"] * (1.0 + 1e-6), rel=1e-9)
    assert (figures / "lambert.points.png").read_bytes().startswith(b"\x89PNG")
    text = run("check", folder, *ONLY, "--stop").stdout
    assert "default: values" in text
    assert "small.npz" not in text
    # a figure is kept unless asked
    again = run("check", folder, *ONLY, "--figure-dir", figures)
    assert again.exit_code == 2
    assert "--overwrite" in again.stderr


def test_a_changed_table_is_found(folder):
    brdftab.record_golden(folder, only=CHEAP)
    table = brdftab.read(folder / "small.npz")
    table.components["direct"][1, 2, 3, 0] *= 1.0 + 1e-8
    brdftab.write(table, folder / "small.npz", overwrite=True)
    (folder / "figures").mkdir()
    done = run("check", folder, "--only", "small*", "--figure-dir", folder / "figures")
    assert done.exit_code == 1
    assert "1 of 108 numbers differ" in done.stdout
    assert "direct.Y at" in done.stdout
    assert (folder / "figures" / "small.png").exists()


def test_missing_and_stale_files_do_not_hold(folder, monkeypatch):
    done = run("check", folder, "--only", "lambert*")
    assert done.exit_code == 1
    assert "golden record" in done.stdout
    brdftab.record_golden(folder, only=["lambert*"])
    from brdftab.golden import check

    grown = {**settings("lambert"), "brighter": {"kd": 0.9}}
    monkeypatch.setattr(check, "settings", lambda name: grown)
    done = run("check", folder, "--only", "lambert*")
    assert done.exit_code == 1
    assert "brighter" in done.stdout
    (folder / "lambert.points.npz").write_bytes(b"PK\x03\x04 nothing")
    done = run("check", folder, "--only", "lambert*")
    assert done.exit_code == 2
    assert done.stderr.count("\n") == 1
    # a special table is no file of points
    (folder / "lambert.points.npz").write_bytes((HERE / "lambert.npz").read_bytes())
    assert run("check", folder, "--only", "lambert*").exit_code == 2


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("[[table", FileFormatError),
        ('[[table]]\nmodel = "lambert"\n', FileFormatError),
        ('[[table]]\nfile = "a.npz"\nmodel = "lambert"\nshape = 3\n', FileFormatError),
        ('[[table]]\nfile = "a.txt"\nmodel = "lambert"\n', FileFormatError),
        ('[[table]]\nfile = "../a.npz"\nmodel = "lambert"\n', FileFormatError),
        ('[[table]]\nfile = "a.npz"\nmodel = "nonsense"\n', ParameterError),
        ('[[table]]\nfile = "a.npz"\nmodel = "lambert"\n' * 2, FileFormatError),
    ],
)
def test_malformed_lists_are_refused_in_one_line(tmp_path, text, error):
    (tmp_path / LIST).write_text(text)
    with pytest.raises(error) as caught:
        brdftab.check_golden(tmp_path)
    assert "\n" not in str(caught.value)
    assert LIST in str(caught.value)
    assert run("check", tmp_path).exit_code == 2


def test_wrong_calls_are_refused(tmp_path):
    with pytest.raises(ParameterError, match="only = nonsense"):
        brdftab.check_golden(tmp_path, only=["nonsense*"])
    with pytest.raises(BrdftabError, match="cannot make the folder"):
        brdftab.record_golden(tmp_path / "none" / "of them")
    with pytest.raises(BrdftabError, match="is no folder"):
        brdftab.check_golden(HERE, only=["lambert*"], figure_dir=tmp_path / "none")
    with pytest.raises(ParameterError, match="jobs = 0"):
        brdftab.check_golden(HERE, only=["lambert*"], jobs=0)
    (tmp_path / "SOURCES.json").write_text("[")
    with pytest.raises(BrdftabError, match="SOURCES"):
        brdftab.record_golden(tmp_path, only=["lambert*"])
