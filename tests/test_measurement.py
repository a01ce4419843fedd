"""Measured files: MERL and RGL round trips, masks, hostile content, and RGL values against Mitsuba."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import struct
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rglfile import identity, random_fields, tensor_bytes, text

import brdftab
from brdftab.cli import main
from brdftab.errors import BrdftabError, FileFormatError, OutputExistsError, ParameterError
from brdftab.io.merl import MerlMeasurement, directions, write_merl
from brdftab.io.rgl import RglMeasurement
from brdftab.tables.grid import Grid
from brdftab.tables.measurement import TableMeasurement, bracket, interpolate
from brdftab.tables.table import Table

COLOUR = np.array([1.0, 0.5, 0.2])
MEASURED = os.environ.get("BRDFTAB_MEASURED")
REAL = sorted(Path(MEASURED).rglob("*_rgb.bsdf")) if MEASURED else []


def smooth(theta_i, theta_o, phi):
    """Return a reciprocal f, (N, 3): a diffuse part and a lobe about the mirror direction."""
    x = np.sin(theta_i) + np.sin(theta_o) * np.cos(phi)
    slope = (x**2 + (np.sin(theta_o) * np.sin(phi)) ** 2) / (np.cos(theta_i) + np.cos(theta_o)) ** 2
    return (0.1 + 0.4 * np.exp(-slope / 0.1))[:, None] * COLOUR


def draw(count, top=75.0, seed=0):
    rng = np.random.default_rng(seed)
    theta_i, theta_o = np.radians(rng.uniform(0.0, top, (2, count)))
    return theta_i, theta_o, rng.uniform(-np.pi, np.pi, count)


@lru_cache
def spoiled(azimuths=180):
    """Return planes (3, 90, 90, P) of `smooth` with some values missing in single channels, and which."""
    theta_i, theta_o, phi = directions(azimuths)
    up = (theta_i < 0.5 * np.pi) & (theta_o < 0.5 * np.pi)
    planes = np.full((*up.shape, 3), np.nan)
    planes[up] = smooth(theta_i[up], theta_o[up], phi[up])
    missing = np.random.default_rng(1).random(planes.shape) < 0.01
    planes[missing] = np.nan
    return np.moveaxis(planes, -1, 0)


@pytest.fixture(scope="module")
def merl(tmp_path_factory):
    """Return the path of a MERL file with missing values."""
    path = tmp_path_factory.mktemp("merl") / "known.binary"
    write_merl(spoiled(), path)
    return path


@pytest.fixture(scope="module")
def merl_cells(merl):
    """Return the cells of that file."""
    return brdftab.read(merl).cells()


@pytest.fixture(scope="module")
def rgl(tmp_path_factory):
    """Return the path of an RGL export of `smooth`."""
    path = tmp_path_factory.mktemp("rgl") / "known.bsdf"
    path.write_bytes(tensor_bytes(identity(smooth, np.radians(np.linspace(0.0, 88.0, 16)), 32)))
    return path


# ---------------------------------------------------------------- MERL


def test_merl_stores_what_the_format_says(merl):
    raw = merl.read_bytes()
    assert len(raw) == 34_992_012
    assert struct.unpack("<3i", raw[:12]) == (90, 90, 180)
    stored = np.frombuffer(raw, "<f8", offset=12).reshape(3, 90, 90, 180)
    planes = spoiled()
    for c, scale in enumerate((1.0, 1.15, 1.66)):
        known = ~np.isnan(planes[c])
        assert np.allclose(stored[c][known] * scale / 1500.0, planes[c][known], rtol=1e-15)
        assert (stored[c][~known] < 0.0).all()


def test_merl_comes_back_with_its_mask(merl):
    found = brdftab.read(merl)
    assert isinstance(found, MerlMeasurement)
    assert found.channels == ("R", "G", "B")
    assert found.reciprocal
    planes = np.moveaxis(spoiled(), 0, -1)
    assert np.array_equal(found.valid, ~np.isnan(planes))
    # x / s * s rounds twice
    assert np.allclose(found.values[found.valid], planes[found.valid], rtol=5e-16)
    # negative numbers are carried as they are
    assert (found.values[~found.valid] < 0.0).all()


def test_merl_cells_are_centres_above_the_horizon(merl_cells):
    cells = merl_cells
    assert cells.theta_i.size + cells.below_horizon == 90 * 90 * 180
    assert 0.7 < cells.theta_i.size / (90 * 90 * 180) < 0.8
    assert max(cells.theta_i.max(), cells.theta_o.max()) < 0.5 * np.pi
    truth = smooth(cells.theta_i, cells.theta_o, cells.phi)
    assert np.allclose(cells.values[cells.valid], truth[cells.valid], rtol=1e-15)
    assert 0.985 < cells.valid.mean() < 0.995
    # the first cell: theta_h of half a cell, theta_d half a degree
    first = np.degrees([x.reshape(-1)[0] for x in directions()])
    assert np.allclose(first[:2], 0.5, atol=90.0 * (0.5 / 90.0) ** 2)


def test_merl_interpolates(merl):
    found = brdftab.read(merl)
    theta_i, theta_o, phi = draw(4000)
    values, valid = found.at(theta_i, theta_o, phi)
    truth = smooth(theta_i, theta_o, phi)
    # eight neighbours with one value in a hundred missing
    assert np.allclose(valid.mean(), 0.99**8, atol=0.02)
    # measured 1.1e-3: curvature of the lobe within a cell
    assert np.abs(values[valid] / truth[valid] - 1.0).max() < 2e-3
    # both orders of a pair are one cell; phi has a period and a sign of no weight for this f
    assert np.allclose(found.at(theta_o, theta_i, -phi)[0][valid], values[valid], rtol=1e-12)
    assert np.allclose(found.at(theta_i, theta_o, phi + 2.0 * np.pi)[0][valid], values[valid], rtol=1e-9)
    scalar, mask = found.at(0.5, 0.6, 1.0)
    assert scalar.shape == mask.shape == (3,)
    values, valid = found.at([[0.5, np.pi / 2], [1.6, 0.2]], 0.3, 1.0)
    assert values.shape == (2, 2, 3)
    assert not values[0, 1].any()
    assert not valid[0, 1].any()


def test_merl_interpolation_meets_the_cells(merl, merl_cells):
    found, cells = brdftab.read(merl), merl_cells
    pick = np.random.default_rng(2).integers(0, cells.theta_i.size, 5000)
    values, valid = found.at(cells.theta_i[pick], cells.theta_o[pick], cells.phi[pick])
    assert np.array_equal(valid, cells.valid[pick])
    assert np.allclose(values[valid], cells.values[pick][valid], rtol=1e-8)


def test_merl_phi_d_wraps_around(tmp_path):
    planes = np.ones((3, 90, 90, 180))
    planes[..., 0], planes[..., -1] = 3.0, 5.0
    write_merl(planes, tmp_path / "wrap.binary")
    found = brdftab.read(tmp_path / "wrap.binary")
    # phi_d = 0: half way between the last azimuth cell and the first
    values, _ = found.at(0.9, 0.3, 0.0)
    assert np.allclose(values, 4.0, rtol=1e-9)


def test_merl_with_360_azimuths(tmp_path):
    planes = spoiled(360)
    write_merl(planes, tmp_path / "full.binary")
    found = brdftab.read(tmp_path / "full.binary")
    assert not found.reciprocal
    assert np.array_equal(found.valid, ~np.isnan(np.moveaxis(planes, 0, -1)))
    theta_i, theta_o, phi = draw(500)
    values, valid = found.at(theta_i, theta_o, phi)
    assert np.abs(values / smooth(theta_i, theta_o, phi) - 1.0)[valid].max() < 2e-3
    held = found.cells_at(theta_i, theta_o, phi)
    assert np.allclose(held.values[held.valid], smooth(held.theta_i, held.theta_o, held.phi)[held.valid], rtol=1e-12)


def test_merl_cells_at_hold_the_directions(merl, merl_cells):
    found, cells = brdftab.read(merl), merl_cells
    pick = np.unique(np.random.default_rng(3).integers(0, cells.theta_i.size, 2000))
    # the centres themselves, each twice, in another order
    order = np.concatenate([pick[::-1], pick])
    held = found.cells_at(cells.theta_i[order], cells.theta_o[order], cells.phi[order])
    assert np.array_equal(held.theta_i, cells.theta_i[pick])
    assert np.array_equal(held.theta_o, cells.theta_o[pick])
    assert np.array_equal(held.phi, cells.phi[pick])
    assert np.array_equal(held.valid, cells.valid[pick])


@pytest.mark.parametrize(
    ("source", "match"),
    [
        (np.zeros((3, 90, 90, 90)), "needs"),
        (np.zeros((90, 90, 180, 3)), "needs"),
        (lambda a, b, c: np.zeros((a.size, 2)), "must return"),
    ],
)
def test_merl_writer_refuses(tmp_path, source, match):
    with pytest.raises(ParameterError, match=match):
        write_merl(source, tmp_path / "bad.binary")
    assert not list(tmp_path.iterdir())


def test_merl_writer_takes_a_callable_and_keeps_files(tmp_path, merl):
    path = tmp_path / "f.binary"
    write_merl(lambda a, b, c: smooth(a, b, c)[:, :1], path)
    found = brdftab.read(path)
    theta_i, theta_o, phi = draw(3000)
    cells = found.cells_at(theta_i, theta_o, phi)
    assert cells.valid.all()
    assert np.allclose(cells.values, smooth(cells.theta_i, cells.theta_o, cells.phi)[:, :1], rtol=1e-15)
    # what lies below the horizon is stored as not measured
    assert found.valid.any(axis=-1).sum() == 1_096_216
    with pytest.raises(OutputExistsError):
        write_merl(found, path)
    write_merl(brdftab.read(merl), path, overwrite=True)
    assert np.array_equal(brdftab.read(path).valid, brdftab.read(merl).valid)
    with pytest.raises(ParameterError, match="180, 360"):
        directions(90)


@pytest.mark.parametrize("change", [-1, 1, 8, -20_000_000])
def test_merl_of_another_size_is_refused(tmp_path, merl, change):
    raw = merl.read_bytes()
    path = tmp_path / "bad.exr"
    path.write_bytes(raw[:change] if change < 0 else raw + bytes(change))
    with pytest.raises(FileFormatError, match=r"MERL file is (truncated|damaged)") as caught:
        brdftab.read(path)
    assert "\n" not in str(caught.value)


def test_not_finite_numbers_are_masked(tmp_path, merl):
    raw = bytearray(merl.read_bytes())
    raw[12:28] = struct.pack("<2d", np.nan, np.inf)
    path = tmp_path / "nan.binary"
    path.write_bytes(raw)
    found = brdftab.read(path)
    assert not found.valid[0, 0, :2, 0].any()


# ---------------------------------------------------------------- RGL


def test_rgl_export_reads_back(rgl):
    found = brdftab.read(rgl)
    assert isinstance(found, RglMeasurement)
    assert found.provenance["description"] == "a test"
    cells = found.cells()
    assert cells.theta_i.size + cells.below_horizon == 16 * 32 * 32
    truth = smooth(cells.theta_i, cells.theta_o, cells.phi)
    # the file holds float32
    assert np.allclose(cells.values[cells.valid], truth[cells.valid], rtol=3e-7)
    assert cells.valid.mean() > 0.99
    # at theta_i = 0 all azimuths are one direction; the first and last rows of samples meet at phi_m = +-180
    inner = (cells.theta_i > 0.0) & (np.abs(np.sin(cells.phi)) > 1e-6)
    values, valid = found.at(cells.theta_i, cells.theta_o, cells.phi)
    both = valid & cells.valid & inner[:, None]
    assert both.mean() > 0.75
    assert np.allclose(values[both], cells.values[both], rtol=1e-6)
    theta_i, theta_o, phi = draw(2000, 70.0)
    values, valid = found.at(theta_i, theta_o, phi)
    assert valid.mean() > 0.97
    error = np.abs(values / smooth(theta_i, theta_o, phi) - 1.0)[valid]
    # linear between 16 angles and 32 x 32 samples: measured 0.28 % and 1.9 %
    assert np.median(error) < 4e-3
    assert error.max() < 0.03


@pytest.mark.parametrize("jacobian", [0, 1])
def test_rgl_cells_invert_the_warp(tmp_path, jacobian):
    path = tmp_path / "random.bsdf"
    path.write_bytes(tensor_bytes(random_fields(3, jacobian=jacobian)))
    found = brdftab.read(path)
    cells = found.cells()
    inner = (cells.theta_i > 0.0) & (np.abs(np.sin(cells.phi)) > 1e-6)
    values, valid = found.at(cells.theta_i, cells.theta_o, cells.phi)
    assert valid[inner].all()
    assert inner.sum() > 50
    # measured 8e-14: the rows and columns of samples are where `at` finds them
    assert np.abs(values / cells.values - 1.0)[inner].max() < 1e-12


def test_rgl_mask_is_one_a_channel(tmp_path):
    fields = identity(smooth, np.radians([0.0, 30.0, 60.0, 89.0]))
    fields["rgb"][0, 2, 1, 10:14, 3:6] *= -1.0
    path = tmp_path / "masked.bsdf"
    path.write_bytes(tensor_bytes(fields))
    found = brdftab.read(path)
    assert not found.valid[2, 10:14, 3:6, 1].any()
    assert found.valid[2, 10:14, 3:6, 0].all()
    theta_i, theta_o, phi = draw(20000)
    _, valid = found.at(theta_i, theta_o, phi)
    assert valid[:, 0].sum() > valid[:, 1].sum() > 0
    assert np.array_equal(valid[:, 0], valid[:, 2])
    # nothing of slice 60 degrees contributes at or below 30
    low = theta_i <= np.radians(30.0)
    assert np.array_equal(valid[low, 0], valid[low, 1])
    # beyond the last theta_i nothing is measured
    assert not found.at(np.radians(89.5), 0.3, 1.0)[1].any()


def test_rgl_copy_at_grazing_light_is_no_measurement(tmp_path):
    fields = identity(smooth, np.radians([0.0, 30.0, 60.0, 89.0]))
    fields["rgb"][0, 3] = fields["rgb"][0, 2]
    path = tmp_path / "copy.bsdf"
    path.write_bytes(tensor_bytes(fields))
    found = brdftab.read(path)
    assert not found.valid[3].any()
    assert "repeats" in found.provenance["masked"]
    assert found.at(np.radians(60.0), 0.3, 1.0)[1].all()
    assert not found.at(np.radians(61.0), 0.3, 1.0)[1].any()
    # a file without any change along theta_i keeps all of it
    fields["rgb"][:] = 0.1
    path.write_bytes(tensor_bytes(fields))
    assert brdftab.read(path).valid.all()


def without(name):
    return {key: array for key, array in random_fields().items() if key != name}


@pytest.mark.parametrize(
    ("fields", "match"),
    [
        (without("vndf"), "lacks the field vndf"),
        (without("jacobian"), "lacks the field jacobian"),
        (without("rgb") | {"spectra": np.ones((1, 4, 5, 8, 8), np.float32)}, "spectral"),
        (random_fields() | {"phi_i": np.linspace(0, 6, 8, dtype=np.float32)}, "anisotropic"),
        (random_fields() | {"rgb": np.ones((1, 4, 3, 8), np.float32)}, "5 dimensions"),
        (random_fields() | {"rgb": np.ones((1, 3, 3, 8, 8), np.float32)}, "do not fit"),
        (random_fields() | {"rgb": np.ones((1, 4, 3, 1, 8), np.float32)}, "do not fit"),
        (random_fields() | {"rgb": np.ones((1, 4, 3, 8, 8), np.uint8)}, "array of floats"),
        (random_fields() | {"rgb": np.full((1, 4, 3, 8, 8), np.nan, np.float32)}, "rgb holds"),
        (random_fields() | {"theta_i": np.float32([0, 1, 0.5, 1.5])}, "do not increase"),
        (random_fields() | {"theta_i": np.float32([0, 1, np.nan, 1.5])}, "do not increase"),
        (random_fields() | {"theta_i": np.float32([0, 30, 60, 90])}, "do not increase"),
        (random_fields() | {"sigma": np.zeros((2, 2), np.float32)}, "sigma or vndf vanishes"),
        (random_fields() | {"vndf": np.zeros((1, 4, 9, 12), np.float32)}, "sigma or vndf vanishes"),
        (random_fields() | {"vndf": np.full((1, 4, 9, 12), -1, np.float32)}, "vndf holds"),
        (random_fields() | {"ndf": np.full((2, 2), np.inf, np.float32)}, "ndf holds"),
    ],
)
def test_rgl_of_another_kind_is_refused(tmp_path, fields, match):
    path = tmp_path / "bad.bsdf"
    path.write_bytes(tensor_bytes(fields))
    with pytest.raises(FileFormatError, match=match) as caught:
        brdftab.read(path)
    assert "\n" not in str(caught.value)


def test_damaged_rgl_is_refused(tmp_path):
    whole = tensor_bytes(random_fields() | {"description": text("x\ny")})
    path = tmp_path / "bad.bsdf"
    path.write_bytes(whole)
    assert brdftab.read(path).provenance["description"] == "x y"
    for count in {*range(0, 400, 3), *range(400, len(whole), 97), len(whole) - 1}:
        path.write_bytes(whole[:count])
        with pytest.raises(FileFormatError) as caught:
            brdftab.read(path)
        assert "\n" not in str(caught.value)
    rng = np.random.default_rng(0)
    for _ in range(200):
        bad = bytearray(whole)
        for place in rng.integers(12, 420, 3):
            bad[place] = rng.integers(0, 256)
        path.write_bytes(bad)
        # some changes are harmless; none may end in another error
        with contextlib.suppress(FileFormatError):
            assert isinstance(brdftab.read(path), RglMeasurement)


def test_rgl_sizes_are_not_trusted(tmp_path):
    head = b"tensor_file\0" + struct.pack("<BBI", 1, 0, 1) + struct.pack("<H", 3) + b"rgb"
    for dimensions, shape in ((5, (1, 2**20, 3, 2**20, 2**20)), (5, (2**63,) * 5), (65535, (1,))):
        path = tmp_path / "bad.bsdf"
        path.write_bytes(head + struct.pack("<HBQ", dimensions, 10, 64) + struct.pack(f"<{len(shape)}Q", *shape))
        with pytest.raises(FileFormatError, match=r"RGL file is (truncated|damaged)"):
            brdftab.read(path)
    path.write_bytes(tensor_bytes(random_fields(), version=(2, 0)))
    with pytest.raises(FileFormatError, match=r"version 2\.0"):
        brdftab.read(path)


# ---------------------------------------------------------------- RGL against Mitsuba

SCRIPT = """
import json, sys
import numpy as np
import mitsuba as mi
given = json.load(sys.stdin)
mi.set_variant("scalar_rgb")
light, view, found = given["light"], given["view"], []
for file in given["files"]:
    bsdf = mi.load_dict({"type": "measured", "filename": file})
    si, context, values = mi.SurfaceInteraction3f(), mi.BSDFContext(), []
    for i, o in zip(light, view):
        si.wi = mi.Vector3f(*i)
        values.append(list(bsdf.eval(context, si, mi.Vector3f(*o))))
    found.append(values)
json.dump(found, sys.stdout)
"""


def mitsuba(files, light, view):
    """Return Mitsuba's f cos(theta_o), (files, N, 3)."""
    given = {"files": [str(f) for f in files], "light": light.tolist(), "view": view.tolist()}
    run = subprocess.run([sys.executable, "-c", SCRIPT], input=json.dumps(given), capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return np.array(json.loads(run.stdout))


def against_mitsuba(files, count, top=85.0):
    """Return the relative differences (files, N, 3) of positive values, others 0."""
    theta_i, theta_o, phi = draw(count, top, 7)
    turn = draw(count, top, 8)[2]

    def vector(theta, azimuth):
        return np.stack([np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)], 1)

    light, view = vector(theta_i, turn).astype(np.float32), vector(theta_o, turn + phi).astype(np.float32)
    theirs = mitsuba(files, light, view)
    # the very vectors that Mitsuba got
    i, o = light.astype(np.float64), view.astype(np.float64)
    theta_i, theta_o = (np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2]) for v in (i, o))
    phi = np.arctan2(o[:, 1], o[:, 0]) - np.arctan2(i[:, 1], i[:, 0])
    differences = []
    for file, other in zip(files, theirs, strict=True):
        values, _ = brdftab.read(file).at(theta_i, theta_o, phi)
        mine = values * np.cos(theta_o)[:, None]
        differences.append(np.where(mine > 1e-4, np.abs(other - mine) / np.maximum(mine, 1e-4), 0.0))
    return np.array(differences)


needs_mitsuba = pytest.mark.skipif(importlib.util.find_spec("mitsuba") is None, reason="mitsuba is not installed")


@needs_mitsuba
def test_rgl_equals_mitsuba(tmp_path, rgl):
    files = [rgl]
    for jacobian in (0, 1):
        files.append(tmp_path / f"random{jacobian}.bsdf")
        files[-1].write_bytes(tensor_bytes(random_fields(5, 6, (16, 20), 12, jacobian)))
    difference = against_mitsuba(files, 600)
    # Mitsuba computes in float32: measured 4.6e-6 at most, 2e-7 in the median
    assert difference.max() < 1e-5
    assert np.median(difference) < 1e-6


@needs_mitsuba
@pytest.mark.skipif(not REAL, reason="set BRDFTAB_MEASURED to a folder with *_rgb.bsdf files")
def test_real_rgl_files_equal_mitsuba():
    difference = against_mitsuba(REAL, 1500)
    # float32 of the half vector moves the value along steep peaks: measured 2e-5 at the 99th percentile
    assert np.percentile(difference, 99, axis=(1, 2)).max() < 4e-5
    assert np.median(difference, axis=(1, 2)).max() < 3e-6


# ---------------------------------------------------------------- tables as measurements


def test_table_between_its_positions():
    grid = Grid.from_axes(theta_i="0:80:9", theta_o="10:70:4", phi="0:180:7")
    theta_i, theta_o, phi = np.meshgrid(grid.theta_i, grid.theta_o, grid.phi, indexing="ij")
    values = (1.0 + theta_i + 2.0 * theta_o + 3.0 * phi)[..., None] * [1.0, 2.0]
    mask = np.ones(values.shape, dtype=bool)
    mask[3, 2, 4, 1] = False
    found = TableMeasurement(Table(values, grid, ("R", "G"), mask=mask))
    rng = np.random.default_rng(0)
    a, b, c = np.radians(rng.uniform([[0], [10], [0]], [[80], [70], [180]], (3, 500)))
    got, valid = found.at(a, b, c)
    # multilinear data are met exactly
    assert np.allclose(got[:, 0], 1.0 + a + 2.0 * b + 3.0 * c, rtol=1e-12)
    assert valid[:, 0].all()
    near = (np.abs(a - grid.theta_i[3]) < np.radians(10.0)) & (np.abs(b - grid.theta_o[2]) < np.radians(20.0))
    near &= np.abs(c - grid.phi[4]) < np.radians(30.0)
    assert np.array_equal(valid[:, 1], ~near)
    assert np.allclose(found.at(a, b, -c)[0], got)
    # beyond the outer positions
    assert not found.at(0.5, np.radians(5.0), 1.0)[1].any()
    assert not found.at(np.radians(81.0), 0.5, 1.0)[1].any()
    cells = found.cells()
    assert np.array_equal(cells.values.reshape(values.shape), values)
    assert np.array_equal(cells.valid.reshape(mask.shape), mask)
    held = found.cells_at(*np.radians([[0.0, 4.9, 5.1], [10.0, 12.0, 69.0], [1.0, 2.0, 179.0]]))
    assert np.degrees([held.theta_i, held.theta_o, held.phi]).round(6).T.tolist() == [[0, 10, 0], [10, 70, 180]]


def test_nan_of_no_weight_spoils_nothing():
    data = np.array([1.0, np.nan, 3.0])[:, None]
    values, valid = interpolate(data, ~np.isnan(data), [bracket(np.arange(3.0), np.array([0.0, 2.0, 0.5, -1.0]))])
    assert np.array_equal(values[:, 0], [1.0, 3.0, np.nan, 1.0], equal_nan=True)
    assert valid[:, 0].tolist() == [True, True, False, True]


def test_angles_are_checked(rgl):
    found = brdftab.read(rgl)
    for arguments, match in (
        ((np.nan, 0.1, 0.2), "theta_i = nan"),
        ((0.1, 4.0, 0.2), "theta_o"),
        ((0.1, 0.1, np.inf), "phi"),
        (([0.1, 0.2], [0.1, 0.2, 0.3], 0.0), "broadcast"),
    ):
        with pytest.raises(ParameterError, match=match):
            found.at(*arguments)


def test_anisotropic_tables_are_refused():
    table = Table(np.ones((1, 2, 1, 2, 1)), Grid.parse("1x2x1x2"), ("Y",))
    with pytest.raises(ParameterError, match="isotropic"):
        TableMeasurement(table)


# ---------------------------------------------------------------- command line


def told(path, cells, kind):
    """Check what info says in JSON and return it."""
    result = CliRunner().invoke(main, ["info", str(path), "--json"])
    assert result.exit_code == 0, result.stderr
    facts = json.loads(result.stdout)
    assert facts["format"] == kind
    assert facts["cells"] == {"above_horizon": cells.theta_i.size, "below_horizon": cells.below_horizon}
    for c, name in enumerate("RGB"):
        assert facts["channels"][name]["valid_share"] == pytest.approx(cells.valid[:, c].mean())
        assert facts["channels"][name]["max"] == pytest.approx(cells.values[cells.valid[:, c], c].max())
    assert 80.0 < facts["angles"]["theta_o"]["last_degrees"] < 90.0
    return facts


def test_info_tells_a_measurement(merl, merl_cells, rgl):
    assert told(merl, merl_cells, "MERL")["reciprocity"].startswith("built")
    facts = told(rgl, brdftab.read(rgl).cells(), "RGL")
    plain = CliRunner().invoke(main, ["info", str(rgl)])
    assert plain.exit_code == 0
    assert "format      RGL\n" in plain.stdout
    assert f"channel G   {100 * facts['channels']['G']['valid_share']:.2f} % valid" in plain.stdout


def test_commands_on_tables_say_that_it_is_a_measurement(rgl):
    for words in (["compare", str(rgl), str(rgl)], ["verify", str(rgl)]):
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 2
        assert result.stdout == ""
        assert result.stderr.count("\n") == 1
        assert "holds a measurement (RGL), no table" in result.stderr


def test_write_takes_tables_only_and_unknown_files_are_named(tmp_path, rgl):
    with pytest.raises(ParameterError, match="RglMeasurement cannot be written as a table"):
        brdftab.write(brdftab.read(rgl), tmp_path / "x.npz")
    (tmp_path / "x.bsdf").write_bytes(b"Source Measured\nSymmetry PlaneSymmetrical\n")
    with pytest.raises(BrdftabError, match="no MERL or RGL measurement"):
        brdftab.read(tmp_path / "x.bsdf")
