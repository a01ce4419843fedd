"""What the API returns behaves as Python's users expect: names, reprs, equality, pickling, and NumPy's protocol."""

import copy
import dataclasses
import importlib.resources
import inspect
import pickle
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import rglfile

import brdftab
from brdftab.errors import ParameterError
from brdftab.golden.check import check_golden
from brdftab.io.merl import directions, write_merl
from brdftab.tables.content import SeveralArrays, same
from brdftab.tables.measurement import Measurement, TableMeasurement

GRID = "6x6x8"
# lines and columns of a small terminal that a repr may take
LINES, COLUMNS = 12, 100


@pytest.fixture(scope="session")
def objects(tmp_path_factory):
    """Return what every public function returns, by the function's name."""
    folder = tmp_path_factory.mktemp("objects")
    table = brdftab.tabulate("lambert", GRID, components=True)
    write_merl(table, folder / "a.binary")
    (folder / "a.bsdf").write_bytes(rglfile.tensor_bytes(rglfile.identity(_flat, [0.2, 0.8])))
    albedo = brdftab.tabulate_albedo("lambert", cosines=4)
    scratch = brdftab.trace_scratch("quartic:1", bins=8, rays=16)
    for name, function, thing in (
        ("a.npz", brdftab.write, table), ("albedo.npz", brdftab.write_albedo, albedo),
        ("s.npz", brdftab.write_scratch, scratch),
    ):  # fmt: skip
        function(thing, folder / name)
    golden = folder / "golden"
    golden.mkdir()
    return {
        "albedo": brdftab.albedo("lambert", 0.3),
        "benchmark": {},
        "check": brdftab.check("lambert", fast=True, only=["positivity"]),
        "compare": brdftab.compare(table, table),
        "evaluate": brdftab.evaluate("lambert", 0.1, 0.2, 0.3),
        "fit_model": brdftab.fit_model(table, "lambert", samples=100),
        "pdf": brdftab.pdf("lambert", 0.1, 0.2, 0.3),
        "record_golden": brdftab.record_golden(golden, only=["lambert*"]),
        "check_golden": check_golden(golden, only=["lambert*"]),
        "read": [brdftab.read(folder / name) for name in ("a.npz", "a.binary", "a.bsdf")] + [TableMeasurement(table)],
        "read_albedo": brdftab.read_albedo(folder / "albedo.npz"),
        "read_scratch": brdftab.read_scratch(folder / "s.npz"),
        "sample": brdftab.sample("lambert", 0.3, 7),
        "tabulate": table,
        "tabulate_albedo": albedo,
        "trace_scratch": scratch,
        "write": None,
        "write_albedo": None,
        "write_scratch": {},
        "list_models": brdftab.list_models(),
        "rank_models": brdftab.rank_models(table, ["lambert"], samples=100),
    }


def _flat(theta_i, theta_o, phi):
    return np.full((np.size(theta_o), 3), 0.2)


def walked(thing, found):
    """Collect what is of this package and can be reached by public attributes, one object a class."""
    if isinstance(thing, dict):
        thing = list(thing.values())
    if isinstance(thing, list | tuple):
        for item in thing:
            walked(item, found)
        return
    if not type(thing).__module__.startswith("brdftab.") or type(thing) in found:
        return
    found[type(thing)] = thing
    for name, value in vars(thing).items():
        if not name.startswith("_"):
            walked(value, found)
    if isinstance(thing, Measurement):
        walked(thing.cells(), found)


@pytest.fixture(scope="session")
def each(objects):
    found = {}
    walked(objects, found)
    return found


def test_every_public_function_is_called_and_every_class_seen(objects, each):
    public = {name: getattr(brdftab, name) for name in brdftab.__all__}
    functions = {name for name, value in public.items() if inspect.isfunction(value)}
    assert functions == set(objects)
    seen = {kind.__name__ for kind in each}
    assert {name for name, value in public.items() if inspect.isclass(value)} <= seen
    returned = " ".join(str(inspect.signature(public[name]).return_annotation) for name in functions)
    # Any is typing's own, Measurement the base of those seen
    assert set(re.findall(r"[A-Z]\w+", returned)) - {"Any", "Measurement", "Array", "None"} <= seen
    for kind in (k for k in Measurement.__subclasses__() if k.__module__.startswith("brdftab.")):
        assert kind.__name__ in seen


def test_reprs_fit_a_screen(each):
    for kind, thing in each.items():
        lines = repr(thing).splitlines()
        assert kind.__name__ in lines[0]
        # declarations stand in one long line, whose words are all worth reading
        room = LINES * COLUMNS if len(lines) == 1 else COLUMNS
        assert len(lines) <= LINES, kind
        assert max(map(len, lines)) <= room, kind
        assert "array(" not in repr(thing), kind


def test_repr_of_many_channels_and_components_is_short():
    grid = brdftab.Grid.parse("2x2x2")
    channels = tuple(f"{n}nm" for n in range(300, 800))
    values = np.zeros((*grid.shape, len(channels)))
    table = brdftab.Table(values, grid, channels, {f"order{n}": values for n in range(1, 40)}, values == 0.0)
    assert "300nm 301nm 302nm 303nm ... 799nm (500)" in repr(table)
    assert len(repr(table)) < 400


def test_equality_never_raises(each):
    for thing in each.values():
        assert (thing == thing) is True  # that it does not raise is what is asked
        assert (thing == 0) is False
        assert (thing != None) is True  # noqa: E711  # as above


def test_copies_and_pickles_are_equal_and_differences_seen(each):
    for thing in each.values():
        for twin in (copy.deepcopy(thing), pickle.loads(pickle.dumps(thing))):
            assert repr(twin) == repr(thing)
            if type(thing).__eq__ is not object.__eq__:
                assert twin == thing
                assert (twin != thing) is False


def test_a_fit_that_was_pickled_predicts_the_same(objects):
    fit = objects["fit_model"]
    assert pickle.loads(pickle.dumps(fit)).predict(GRID) == fit.predict(GRID)


@pytest.mark.parametrize("name", ["tabulate", "tabulate_albedo", "sample", "fit_model"])
def test_one_number_more_is_another_content(objects, name):
    thing = objects[name]
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size:
            twin = copy.deepcopy(thing)
            getattr(twin, field.name).flat[-1] += 1.0
            assert twin != thing, field.name


def test_equality_of_tables_leaves_out_what_made_them(objects):
    table = objects["tabulate"]
    again = brdftab.tabulate("lambert", GRID, components=True)
    assert again.provenance["total_time_s"] != table.provenance["total_time_s"]
    assert again == table
    # as xarray's equals: by value, whatever the type, and NaN like NaN
    double = brdftab.tabulate("lambert", GRID, dtype="float64", components=True)
    assert double != table
    assert (brdftab.tabulate("lambert", "6x6x9") == table) is False
    assert (brdftab.tabulate("lambert", GRID) == table) is False
    one, two = copy.deepcopy(table), copy.deepcopy(table)
    one.values[0, 0, 0, 0] = np.nan
    assert one != table
    two.values[0, 0, 0, 0] = np.nan
    assert one == two


def test_what_can_change_has_no_hash(objects):
    for name in ("tabulate", "tabulate_albedo", "sample", "fit_model"):
        with pytest.raises(TypeError, match="unhashable"):
            hash(objects[name])
    assert hash(objects["tabulate"].grid) == hash(brdftab.Grid.parse(GRID))


def test_same_tells_kinds_of_values_apart():
    assert same({"a": [1, np.nan]}, {"a": (1, float("nan"))})
    assert not same({"a": 1}, {"b": 1})
    assert not same([1], [1, 2])
    assert same(np.array(["R"]), np.array(["R"]))
    assert not same(np.zeros(3), np.zeros((3, 1)))
    assert not same(np.zeros(3), None)


def test_numpy_takes_a_table_as_its_values(objects):
    table = objects["tabulate"]
    assert np.asarray(table) is table.values
    assert np.array(table) is not table.values
    assert np.asarray(table, dtype=np.float64).dtype == np.float64
    assert np.asarray(table).shape == table.shape
    assert np.mean(table) == np.mean(table.values)
    with pytest.raises(ValueError, match="copy"):
        np.array(table, dtype=np.float64, copy=False)


def test_numpy_is_told_of_several_arrays(each):
    several = [thing for thing in each.values() if isinstance(thing, SeveralArrays)]
    assert len(several) >= 9
    for thing in several:
        with pytest.raises(ParameterError, match=f"{type(thing).__name__} holds several arrays; take one of .*"):
            np.asarray(thing)


def test_dir_shows_the_api():
    assert set(brdftab.__all__) <= set(dir(brdftab))


def test_types_are_declared_and_reach_the_wheel():
    assert importlib.resources.files(brdftab).joinpath("py.typed").is_file()
    root = Path(__file__).resolve().parents[1]
    built = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    # hatch takes every file of a package that git does not ignore
    assert built["packages"] == ["brdftab"]
    assert "py.typed" not in (root / ".gitignore").read_text()


# ---------------------------------------------------------------- MERL files of tables


def test_merl_file_of_a_table(tmp_path):
    table = brdftab.tabulate("lambert", "30x30x30")
    write_merl(table, tmp_path / "a.binary")
    found = brdftab.read(tmp_path / "a.binary")
    low, high = table.theta_i[0], table.theta_i[-1]
    ti, to, _ = directions()
    inside = (ti > low) & (ti < high) & (to > low) & (to < high)
    outside = (ti < low) | (ti > high) | (to < low) | (to > high)
    assert found.valid[inside].all()
    assert not found.valid[outside].any()
    # one channel is written into each of R, G, B; float32 keeps 6e-8
    np.testing.assert_allclose(found.values[inside], float(table.values.flat[0]), rtol=1e-7)


def test_merl_file_of_another_measurement(tmp_path):
    (tmp_path / "a.bsdf").write_bytes(rglfile.tensor_bytes(rglfile.identity(_flat, np.linspace(0.1, 1.3, 6), 64)))
    source = brdftab.read(tmp_path / "a.bsdf")
    write_merl(source, tmp_path / "a.binary")
    found = brdftab.read(tmp_path / "a.binary")
    at = (0.5, 0.6, 2.0)
    # both interpolate; half vectors of the export lie 2.8 degrees apart
    np.testing.assert_allclose(found.at(*at)[0], source.at(*at)[0], rtol=0.01)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: brdftab.tabulate("lambert", "2x2x2x2"), "the table has the axes theta_i, phi_i, theta_o, phi_o"),
        (lambda: brdftab.tabulate_albedo("lambert", cosines=2), "AlbedoTable holds several arrays"),
        (
            lambda: brdftab.Table(np.zeros((2, 2, 2, 2)), brdftab.Grid.parse("2x2x2"), ("450nm", "550nm")),
            "channels = 450nm 550nm are not those of a MERL file",
        ),
    ],
)
def test_merl_refuses_what_it_cannot_hold(tmp_path, make, line):
    with pytest.raises(ParameterError, match=line):
        write_merl(make(), tmp_path / "a.binary")
    assert not list(tmp_path.iterdir())


# ---------------------------------------------------------------- models without all parts


@pytest.fixture
def bare(tmp_path, monkeypatch):
    """Register a model that has a kernel and nothing else."""
    folder = tmp_path / "bare"
    folder.mkdir()
    (folder / "__init__.py").write_text(
        "from brdftab.models.declaration import Model\n"
        'SPEC = Model("bare", "Bare", "none", (), (), "none", "none", "none", roughness="")\n'
    )
    (folder / "kernel.py").write_text('"""None."""\n')
    monkeypatch.setattr(brdftab.models, "__path__", [*brdftab.models.__path__, str(tmp_path)])


@pytest.mark.usefixtures("bare")
def test_what_a_model_lacks_is_told():
    for part, called in ((brdftab.models.sampler, "sampler"), (brdftab.models.twin, "twin in JAX")):
        with pytest.raises(ParameterError, match=f"model = bare has no {called}; choose one of .*lambert"):
            part("bare")
    with pytest.raises(ParameterError, match="model = bare has no shader in GLSL; choose one of ilm-approx"):
        brdftab.models.shader("bare")
