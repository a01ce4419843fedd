"""Files without what is equal: one half of a reciprocal table, channels. The same bits come back, of fewer bytes."""

import json
import re

import numpy as np
import OpenEXR
import pytest

import brdftab
from brdftab.errors import FileFormatError
from brdftab.scene import carry_out, parse, plan_material
from brdftab.tables.storage import HALF, SAME, STORED, Layout, equal_channels
from brdftab.tables.table import Table

KEYS = {"model": "smith", "grid": "16x16x40", "parameters": {"alpha": 0.4, "material": "Cu"}}


@pytest.fixture(scope="module")
def table():
    return carry_out(plan_material(parse({"material": [KEYS]}).materials[0]))


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("ending", ["exr", "npz"])
def test_half_the_bytes_give_the_same_bits(table, tmp_path, ending, dtype):
    # with components and a mask, which planned tables do not have, as any writer might
    values = table.values.astype(dtype)
    given = Table(
        values,
        table.grid,
        table.channels,
        {"order1": 0.5 * values},
        values > 0.01,
        dict(table.provenance),
        table.version,
    )
    path = tmp_path / f"half.{ending}"
    brdftab.write(given, path)
    back = brdftab.read(path)
    assert back.values.tobytes() == given.values.tobytes()
    assert back.components["order1"].tobytes() == given.components["order1"].tobytes()
    assert np.array_equal(back.mask, given.mask)
    assert back.metadata() == given.metadata()
    whole = dict(given.provenance)
    del whole["plan"]
    full = tmp_path / f"whole.{ending}"
    brdftab.write(Table(values, table.grid, table.channels, given.components, given.mask, whole), full)
    kept = table.grid.theta_i.size
    arrays = full.stat().st_size - len(json.dumps(whole))
    stored = path.stat().st_size - len(json.dumps(given.provenance))
    assert stored / arrays == pytest.approx(0.5 * (1.0 + 1.0 / kept), abs=0.06)


def test_the_plan_says_so_and_predicts_the_bytes(table, tmp_path):
    plan = table.provenance["plan"]
    (item,) = [i for i in plan["items"] if i["name"] == "reciprocity"]
    assert item["kind"] == "exact"
    assert item["bytes_saved"] == pytest.approx(0.5 * (1.0 - 1.0 / 16))
    brdftab.write(table, tmp_path / "t.npz")
    with np.load(tmp_path / "t.npz", allow_pickle=False) as archive:
        count = table.grid.theta_i.size
        assert archive["values"].shape == (count * (count + 1) // 2, *table.shape[2:])
        assert archive["values"].nbytes == pytest.approx(plan["predicted"]["bytes"])
        assert json.loads(str(archive["metadata"]))[STORED] == HALF


@pytest.mark.parametrize(
    "more",
    [{"theta_i": [0, 60]}, {"model": "turquin"}, {"model": "smith-walk", "grid": "4x4x8"}],
    ids=["ranges", "not reciprocal", "noise"],
)
def test_other_tables_are_stored_whole(more, tmp_path):
    parameters = {"alpha": 0.4, "material": "mirror"} | ({"samples": 64} if more.get("model") == "smith-walk" else {})
    made = carry_out(plan_material(parse({"material": [KEYS | {"parameters": parameters} | more]}).materials[0]))
    assert "reciprocity" not in {i["name"] for i in made.provenance["plan"]["items"]}
    brdftab.write(made, tmp_path / "t.npz")
    with np.load(tmp_path / "t.npz", allow_pickle=False) as archive:
        assert archive["values"].shape == made.shape


def test_equal_channels_are_stored_once(tmp_path):
    keys = {"model": "oren-nayar", "grid": "12x12x20", "theta_i": [0, 60], "parameters": {"kd": [0.8, 0.3, 0.8]}}
    planned = plan_material(parse({"material": [keys]}).materials[0])
    (item,) = [i for i in planned.plan.items if i.name == "channels"]
    assert (item.kind, item.told) == ("exact", "B is equal to R: stored once")
    assert item.size == pytest.approx(1.0 / 3.0)
    made = carry_out(planned)
    assert made.channels == ("R", "G", "B")
    brdftab.write(made, tmp_path / "t.npz")
    with np.load(tmp_path / "t.npz", allow_pickle=False) as archive:
        assert archive["values"].shape == (*made.shape[:-1], 2)
        assert archive["values"].nbytes == pytest.approx(planned.plan.predicted["bytes"])
        told = json.loads(str(archive["metadata"]))
        arrays = dict(archive)
    assert told[SAME] == {"B": "R"}
    brdftab.write(made, tmp_path / "t.exr")
    with OpenEXR.File(str(tmp_path / "t.exr"), separate_channels=True) as file:
        assert sorted(file.channels()) == ["G", "R"]
    for name in ("t.npz", "t.exr"):
        assert brdftab.read(tmp_path / name).values.tobytes() == made.values.tobytes()
    for damage in ({"B": "X"}, {"R": "B"}, {"G": "R", "B": "G"}, ["B"]):
        np.savez(
            tmp_path / "bad.npz",
            allow_pickle=False,
            **(arrays | {"metadata": np.array(json.dumps(told | {SAME: damage}))}),
        )
        with pytest.raises(FileFormatError, match="the metadata's same_channels does not name stored channels"):
            brdftab.read(tmp_path / "bad.npz")


def test_layouts_pack_both_at_once():
    rng = np.random.default_rng(0)
    array = rng.random((4, 4, 3, 3))
    array += array.swapaxes(0, 1)
    array[..., 2] = array[..., 0]
    names = ("R", "G", "B")
    layout = Layout(True, equal_channels([array], names))
    packed = layout.packed(array, names)
    assert packed.shape == layout.shape(array.shape, names) == (10, 3, 2)
    assert np.array_equal(layout.unpacked(packed, array.shape, names), array)
    assert equal_channels([array, rng.random(array.shape)], names) == {}


def test_halves_that_differ_are_both_stored(table, tmp_path):
    values = table.values.copy()
    values[3, 1, 2] = np.nextafter(values[3, 1, 2], 1.0)
    changed = Table(values, table.grid, table.channels, {}, None, dict(table.provenance))
    for name in ("t.npz", "t.exr"):
        brdftab.write(changed, tmp_path / name)
        assert brdftab.read(tmp_path / name).values.tobytes() == values.tobytes()


def test_damaged_halves_are_refused(table, tmp_path):
    path = tmp_path / "t.npz"
    brdftab.write(table, path)
    with np.load(path, allow_pickle=False) as archive:
        arrays = dict(archive)
    told = json.loads(str(arrays["metadata"]))
    without = {k: v for k, v in told.items() if k != STORED}
    for metadata, words in (
        (told | {STORED: "some"}, f"the metadata's stored is not {HALF!r} of a grid with equal polar angles"),
        (without, "the NPZ's array values has the shape"),
    ):
        np.savez(path, allow_pickle=False, **(arrays | {"metadata": np.array(json.dumps(metadata))}))
        with pytest.raises(FileFormatError, match=re.escape(words)):
            brdftab.read(path)
    brdftab.write(table, tmp_path / "t.exr")
    with OpenEXR.File(str(tmp_path / "t.exr"), separate_channels=True) as file:
        header, channels = file.header(), file.channels()
        pixels = {name: OpenEXR.Channel(name, np.array(c.pixels)) for name, c in channels.items()}
    header["brdftab"] = json.dumps(without)
    OpenEXR.File([OpenEXR.Part(header, pixels, "brdf")]).write(str(tmp_path / "t.exr"))
    with pytest.raises(FileFormatError, match="its axes need"):
        brdftab.read(tmp_path / "t.exr")
