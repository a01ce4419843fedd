"""What a fit sees of tables and measurements: points, masks, reciprocity, units; and the error metrics."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from rglfile import identity, tensor_bytes

import brdftab
from brdftab import directions
from brdftab.errors import BrdftabError, FileFormatError, ParameterError
from brdftab.fit.data import REASONS, dataset, load
from brdftab.fit.metrics import error_by_theta, metrics
from brdftab.fit.reciprocity import reciprocity_floor, suspicions
from brdftab.fit.resolution import narrowest, slopes
from brdftab.fit.source import near_mirror, stratified
from brdftab.io.merl import write_merl
from brdftab.tables.grid import Grid
from brdftab.tables.measurement import Measurement
from brdftab.tables.table import Table

COLOUR = np.array([0.8, 0.3, 0.05])
TOP = math.radians(75.0)
MEASURED = os.environ.get("BRDFTAB_MEASURED")
# half the RMS of ln f(i, o)/f(o, i) up to 75 degrees, found by an independent program on two of the real files
FLOORS = {"aurora_white_rgb": 0.043, "vch_golden_yellow_rgb": 0.130}


def smooth(theta_i, theta_o, phi):
    """Return a reciprocal f with an albedo near `COLOUR`, (N, 3)."""
    x = np.sin(theta_i) + np.sin(theta_o) * np.cos(phi)
    slope = (x**2 + (np.sin(theta_o) * np.sin(phi)) ** 2) / (np.cos(theta_i) + np.cos(theta_o)) ** 2
    return ((0.7 + 0.6 * np.exp(-slope / 0.3)) / np.pi)[..., None] * COLOUR


def table(f=smooth, size="45x45x36", mask=None, channels=("R", "G", "B")):
    """Tabulate a function at the centres of a regular grid."""
    grid = Grid.parse(size)
    values = f(*np.meshgrid(grid.theta_i, grid.theta_o, grid.phi, indexing="ij"))
    return Table(values, grid, channels, mask=mask)


class Sparse(Measurement):
    """A measurement that can only be interpolated."""

    channels = ("R", "G", "B")

    def __init__(self, f):
        self.f, self.provenance = f, {"format": "function"}

    def cells(self):
        raise AssertionError("not asked for")

    def at(self, theta_i, theta_o, phi):
        values = self.f(theta_i, theta_o, phi)
        return values, np.ones(values.shape, dtype=bool)


# ---------------------------------------------------------------- directions


def test_draws_are_stratified_and_seeded():
    theta_i, theta_o, phi = stratified(TOP, 20000, 3)
    assert theta_i.size == 27**3
    for angle, top in ((theta_i, TOP), (theta_o, TOP), (phi, math.pi)):
        assert 0.0 <= angle.min() < angle.max() <= top
        # each of 27 strata gets its share exactly
        assert (np.histogram(angle, 27, (0.0, top))[0] == 27**2).all()
    # and each box of all three exactly one
    boxes = [np.floor(27 * a / top).astype(int) for a, top in ((theta_i, TOP), (theta_o, TOP), (phi, math.pi))]
    assert np.unique(np.ravel_multi_index(boxes, (27, 27, 27))).size == 27**3
    assert all(np.array_equal(a, b) for a, b in zip(stratified(TOP, 20000, 3), (theta_i, theta_o, phi), strict=True))
    assert not np.array_equal(stratified(TOP, 20000, 4)[0], theta_i)
    assert [stratified(TOP, n, 0)[0].size for n in (1, 2, 10, 1000)] == [1, 2, 8, 1000]


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"samples": 0}, "samples = 0"),
        ({"samples": 2.5}, "samples"),
        ({"samples": 10**9}, "samples"),
        ({"seed": -1}, "seed = -1"),
        ({"theta_max": 0.0}, "theta_max = 0 degrees"),
        ({"theta_max": 75.0}, "theta_max = 4297.18 degrees"),
        ({"theta_max": math.nan}, "theta_max"),
        ({"theta_max": "75"}, "theta_max"),
        ({"sampling": "random"}, "uniform, mirror, solid-angle, grid"),
        ({"saturation": 0.0}, "saturation"),
    ],
)
def test_arguments_are_checked(arguments, match):
    with pytest.raises(ParameterError, match=match) as caught:
        dataset(table(size="3x3x3"), **arguments)
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------- datasets


def test_uniform_points_of_a_table_are_its_own_cells():
    source = table()
    found = dataset(source, theta_max=TOP)
    assert found.sampling == "uniform"
    assert found.channels == ("R", "G", "B")
    assert found.theta_i.size > 17000
    assert max(found.theta_i.max(), found.theta_o.max()) <= TOP
    assert np.isin(found.theta_i, source.theta_i).all()
    assert np.isin(found.phi, source.phi).all()
    # no cell twice, nothing interpolated
    assert np.unique(np.stack([found.theta_i, found.theta_o, found.phi]), axis=1).shape[1] == found.theta_i.size
    assert np.array_equal(found.values, smooth(found.theta_i, found.theta_o, found.phi))
    assert found.valid.all()
    assert not found.saturated.any()
    # draws below 74.5 degrees in the cells from 74 to 76 hold a centre beyond
    assert dataset(source, theta_max=math.radians(74.5)).left_out["beyond theta_max"][0] > 0
    share = np.histogram(found.theta_i, 5, (0.0, TOP))[0] / found.theta_i.size
    assert np.allclose(share, 0.2, atol=0.02)
    again, other = dataset(source, theta_max=TOP), dataset(source, theta_max=TOP, seed=1)
    assert np.array_equal(again.values, found.values)
    assert not np.array_equal(other.values.shape, found.values.shape) or not np.array_equal(other.values, found.values)
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.source = "x"


def test_grid_takes_every_cell():
    source = table()
    found = dataset(source, sampling="grid", theta_max=TOP)
    inside = source.theta_i <= TOP
    assert found.theta_i.size == inside.sum() ** 2 * 36
    assert found.left_out["beyond theta_max"] == [source.grid.size - found.theta_i.size] * 3
    whole = dataset(source, sampling="grid")
    assert whole.theta_i.size == source.grid.size
    assert list(whole.left_out) == list(REASONS)
    assert not any(map(any, whole.left_out.values()))


def test_each_value_is_judged_by_itself():
    values = table(size="6x6x6").values.copy()
    mask = np.ones(values.shape, dtype=bool)
    mask[0, 0, :, 0] = False
    values[1, 1, :2, 1] = [0.0, -1.0]
    values[1, 1, 2, 2] = np.nan
    values[2, 2, 0, :] = np.inf
    source = Table(values, Grid.parse("6x6x6"), ("R", "G", "B"), mask=mask)
    found = dataset(source, sampling="grid")
    assert found.left_out["not valid"] == [6, 0, 0]
    assert found.left_out["negative or zero"] == [0, 2, 0]
    assert found.left_out["not finite"] == [1, 1, 2]
    # only the cell with nothing left is gone
    assert found.theta_i.size == 6**3 - 1
    total = found.valid.sum(axis=0) + np.sum(list(found.left_out.values()), axis=0)
    assert total.tolist() == [6**3] * 3
    assert (found.values[found.valid] > 0.0).all()
    signed = dataset(source, sampling="grid", positive=False)
    assert signed.left_out["negative or zero"] == [0, 0, 0]
    assert signed.valid[:, 1].sum() == found.valid[:, 1].sum() + 2
    assert json.dumps(found.left_out)


def test_saturated_values_are_kept_and_flagged():
    source = table()
    clip = 0.25
    clipped = Table(np.minimum(source.values, clip), source.grid, source.channels)
    found = dataset(clipped, saturation=clip, theta_max=TOP)
    truth = smooth(found.theta_i, found.theta_o, found.phi)
    assert np.array_equal(found.saturated, truth >= clip)
    assert 0 < found.saturated[:, 0].sum() < found.theta_i.size
    assert not found.saturated[:, 2].any()
    assert found.valid[found.saturated].all()


def test_nothing_to_fit_is_one_clear_line(tmp_path):
    mask = np.ones((45, 45, 36, 3), dtype=bool)
    mask[..., 1] = False
    with pytest.raises(BrdftabError, match=r"no valid value in channel G .* not valid"):
        dataset(table(mask=mask))
    with pytest.raises(BrdftabError, match=r"table of brdftab|brdftab table: no valid value up to theta_max = 90"):
        dataset(table(mask=np.zeros_like(mask)))
    with pytest.raises(BrdftabError, match=r"theta_max = 0\.5 degrees .* beyond theta_max"):
        dataset(table(), sampling="grid", theta_max=math.radians(0.5))
    with pytest.raises(ParameterError, match="isotropic"):
        dataset(Table(np.ones((1, 2, 1, 2, 1)), Grid.parse("1x2x1x2"), ("Y",)))
    with pytest.raises(ParameterError, match="neither a table"):
        load([1, 2])
    (tmp_path / "x.npz").write_bytes(b"nothing")
    with pytest.raises(FileFormatError):
        dataset(tmp_path / "x.npz")


def test_all_kinds_of_sources(tmp_path):
    brdftab.write(table(size="20x20x20"), tmp_path / "t.npz")
    theta_i = np.radians(np.linspace(0.0, 88.0, 16))
    (tmp_path / "r.bsdf").write_bytes(tensor_bytes(identity(smooth, theta_i, 32)))
    write_merl(smooth, tmp_path / "m.binary")
    for name, count, accuracy in (("t.npz", 5000, 1e-15), ("r.bsdf", 19000, 0.03), ("m.binary", 18500, 1e-14)):
        found = dataset(str(tmp_path / name), theta_max=TOP)
        assert found.source == str(tmp_path / name)
        assert found.theta_i.size > count
        assert found.phi.min() >= 0.0
        assert found.phi.max() <= math.pi
        truth = smooth(found.theta_i, found.theta_o, found.phi)
        assert np.abs(found.values[found.valid] / truth[found.valid] - 1.0).max() < accuracy
        assert suspicions(tmp_path / name) == []
        # MERL cannot tell; the others err by interpolation: measured 1e-16 (square table) and 1.4e-3
        floor = found.reciprocity_floor
        assert floor is None if name == "m.binary" else floor < 2e-3
    found = brdftab.read(tmp_path / "m.binary")
    assert isinstance(found, Measurement)
    assert load(found) is found


# ---------------------------------------------------------------- reciprocity and units


@pytest.mark.parametrize("strength", [0.0, 0.1, 0.5])
def test_floor_of_a_table_that_is_not_reciprocal(strength):
    # f(i, o)/f(o, i) = exp(2 strength (theta_i - theta_o)): half the RMS of the logarithm is known
    def f(theta_i, theta_o, phi):
        return smooth(theta_i, theta_o, phi) * np.exp(strength * (theta_i - theta_o))[..., None]

    floor = reciprocity_floor(table(f), TOP)
    # (theta_i - theta_o) of two uniform angles has the variance TOP^2/6; interpolation: measured 1.3 %
    assert floor == pytest.approx(strength * TOP / math.sqrt(6.0), rel=0.02, abs=1e-12)
    assert dataset(table(f), theta_max=TOP).reciprocity_floor == pytest.approx(floor, rel=1e-12)


def test_floor_needs_valid_pairs():
    mask = np.zeros((45, 45, 36, 3), dtype=bool)
    mask[:10, 20:] = True
    assert reciprocity_floor(table(mask=mask), TOP) is None
    assert suspicions(table(mask=mask)) == []


@pytest.mark.parametrize("name", ["theta_i", "theta_o"])
@pytest.mark.parametrize("make", [table, Sparse])
def test_cosine_is_suspected(name, make):
    rng = np.random.default_rng(0)

    def f(theta_i, theta_o, phi):
        values = smooth(theta_i, theta_o, phi) * np.cos({"theta_i": theta_i, "theta_o": theta_o}[name])[..., None]
        return values * np.exp(rng.normal(0.0, 0.1, values.shape))

    (line,) = suspicions(make(f))
    assert f"f cos({name}) rather than f" in line
    assert "\n" not in line


@pytest.mark.parametrize(("factor", "suspected"), [(1.0, False), (np.pi, True), (100.0, True), (0.01, False)])
def test_other_units_are_suspected(factor, suspected):
    lines = suspicions(table(lambda *angles: factor * smooth(*angles)))
    assert len(lines) == suspected
    assert not suspected or "channel R" in lines[0]


def test_lights_that_were_not_measured_say_nothing_of_the_unit():
    theta_i = np.radians([10.0, 20.0, 30.0, 40.0])
    theta_o, phi = np.radians(np.arange(2.5, 90.0, 5.0)), np.radians(np.arange(5.0, 180.0, 10.0))
    grid = Grid.from_axes(theta_i=theta_i, theta_o=theta_o, phi=phi)

    def told(value, mask=None):
        return suspicions(Table(np.full((*grid.shape, 1), value), grid, ("Y",), mask=mask))

    (line,) = told(80.0)
    assert "another unit" in line
    assert told(0.3) == []
    # half of the views unmeasured: what is left is a lower bound that is still too bright
    mask = np.ones((*grid.shape, 1), bool)
    mask[:, 9:] = False
    mask[1] = False
    assert len(told(80.0, mask)) == 1
    assert told(80.0, np.zeros_like(mask)) == []


def test_cosine_and_percent_are_both_told():
    lines = suspicions(table(lambda a, b, c: 100.0 * smooth(a, b, c) * np.cos(a)[..., None]))
    assert len(lines) == 2


def test_a_mirror_peak_is_no_wrong_unit():
    # nearly all of a unit albedo within a degree of the mirror direction: few draws hit it, and hard
    alpha = 0.01

    def f(theta_i, theta_o, phi):
        x = np.sin(theta_i) + np.sin(theta_o) * np.cos(phi)
        t = (x**2 + (np.sin(theta_o) * np.sin(phi)) ** 2) / (np.cos(theta_i) + np.cos(theta_o)) ** 2
        d = 1.0 / (np.pi * alpha**2 * (1.0 + t / alpha**2) ** 2)
        return (d / (4.0 * np.cos(theta_i) * np.cos(theta_o)))[..., None] * np.ones(3)

    for seed in range(5):
        assert suspicions(Sparse(f), seed=seed) == []


@pytest.mark.skipif(not MEASURED, reason="set BRDFTAB_MEASURED to a folder with *_rgb.bsdf files")
def test_real_files():
    files = sorted(Path(MEASURED or "").rglob("*_rgb.bsdf"))
    assert files
    for file in files:
        found = dataset(file, theta_max=TOP)
        assert suspicions(file) == []
        assert found.valid.any(axis=0).all()
        if file.stem in FLOORS:
            assert found.reciprocity_floor == pytest.approx(FLOORS[file.stem], rel=0.04)
        measured = brdftab.read(file)
        for cosine in (0, 1):

            def f(theta_i, theta_o, phi, measured=measured, cosine=cosine):
                return measured.at(theta_i, theta_o, phi)[0] * np.cos((theta_i, theta_o)[cosine])[:, None]

            if file.stem in FLOORS:
                assert any("rather than f" in line for line in suspicions(Sparse(f)))


# ---------------------------------------------------------------- metrics


def test_metrics_by_hand():
    fit = np.array([[0.2, 1.0], [0.1, 9.0]])
    data = np.array([[0.1, 1.0], [0.4, np.nan]])
    valid = np.array([[True, True], [True, False]])
    theta_i, theta_o = np.array([0.0, math.pi / 3.0]), np.array([0.3, 0.4])
    found = metrics(fit, data, valid, theta_i, theta_o)
    ln, cbrt = math.log, lambda x: x ** (1.0 / 3.0)
    assert list(found) == ["logeps", "log_rms", "cube_root_rms", "cosine_rms", "l1p"]
    assert found["logeps"] == pytest.approx(math.sqrt((ln(0.201 / 0.101) ** 2 + ln(0.101 / 0.401) ** 2) / 3.0))
    assert found["log_rms"] == pytest.approx(math.sqrt((ln(2.0) ** 2 + ln(4.0) ** 2) / 3.0))
    above = (cbrt(0.2) - cbrt(0.1)) ** 2 + (cbrt(0.05) - cbrt(0.2)) ** 2
    assert found["cube_root_rms"] == pytest.approx(math.sqrt(above / (cbrt(0.1) ** 2 + 1.0 + cbrt(0.2) ** 2)))
    assert found["cosine_rms"] == pytest.approx(math.sqrt((0.1**2 + 0.15**2) / (0.1**2 + 1.0 + 0.2**2)))
    ten = (math.log10(1.2 / 1.1) ** 2 + math.log10(1.1 / 1.4) ** 2) / 3.0
    assert found["l1p"] == pytest.approx(math.sqrt(ten))
    assert all(value == 0.0 for value in metrics(data, data, valid, theta_i, theta_o).values())
    # scale: ln 1.1 everywhere
    big = 1.0 + np.arange(6.0).reshape(3, 2)
    whole = metrics(1.1 * big, big, np.ones((3, 2), bool), np.zeros(3), np.zeros(3))
    assert whole["log_rms"] == pytest.approx(math.log(1.1))
    assert whole["cosine_rms"] == pytest.approx(0.1)
    assert whole["cube_root_rms"] == pytest.approx(1.1 ** (1.0 / 3.0) - 1.0)


def test_metrics_stay_finite_at_zero():
    zero, one = np.zeros((2, 1)), np.ones((2, 1), bool)
    found = metrics(zero, [[1.0], [0.0]], one, [0.1, 0.2], [0.1, 0.2])
    assert all(map(math.isfinite, found.values()))
    assert found["log_rms"] == pytest.approx(math.log(1e9))
    assert metrics(zero, zero, one, [0.1, 0.2], [0.1, 0.2])["cosine_rms"] == 0.0


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"valid": np.zeros((2, 1), bool)}, "no value is valid"),
        ({"fit": np.ones((2, 2))}, r"\(N, C\)"),
        ({"theta_i": np.zeros(3)}, r"\(N, C\)"),
        ({"fit": np.array([[np.nan], [1.0]])}, "not finite"),
    ],
)
def test_metrics_refuse(change, match):
    given = {"fit": np.ones((2, 1)), "data": np.ones((2, 1)), "valid": np.ones((2, 1), bool)}
    given |= {"theta_i": np.zeros(2), "theta_o": np.zeros(2)}
    with pytest.raises(ParameterError, match=match):
        metrics(**(given | change))


def test_error_by_theta_shows_structure():
    theta = np.array([0.0, 0.1, 0.5, 1.0, 1.2])
    data = np.full((5, 2), 1.0)
    fit = data * np.exp([[0.1], [-0.1], [0.2], [0.3], [9.0]])
    valid = np.ones((5, 2), bool)
    valid[0, 1] = valid[1, 1] = False
    found = error_by_theta(fit, data, valid, theta, [0.0, 0.2, 0.4, 0.5, 1.0])
    assert [part["count"] for part in found] == [2, 0, 0, 4]
    # 0.001 on both sides takes about a thousandth off
    assert found[0]["mean"] == pytest.approx(0.0, abs=1e-4)
    assert found[0]["rms"] == pytest.approx(0.1, rel=2e-3)
    assert found[1]["mean"] is None
    assert found[3]["mean"] == pytest.approx(0.25, rel=2e-3)
    assert found[3]["high"] == 1.0
    with pytest.raises(ParameterError, match="increasing"):
        error_by_theta(fit, data, valid, theta, [0.0, 0.0])


def test_views_over_the_solid_angle_have_uniform_cosines():
    theta_i, theta_o, phi = stratified(math.radians(75.0), 8000, 1, solid_angle=True)
    even = stratified(math.radians(75.0), 8000, 1)
    assert np.array_equal(theta_i, even[0])
    assert np.array_equal(phi, even[2])
    low = math.cos(math.radians(75.0))
    share, _ = np.histogram(np.cos(theta_o), bins=10, range=(low, 1.0))
    # 20 strata of theta_o put exactly two into each bin
    assert np.all(share == 800)


@pytest.mark.parametrize(
    ("loss", "offset"), [("log", 1e-9), ("logeps", 1e-3), ("l1p", 1.0), ("cosine", 0.0), ("cbrt", 0.0)]
)
def test_weights_fall_below_the_noise_floor(loss, offset):
    """The weight is the noise far above the floor over that at a value whose noise is hypot(value, floor)."""
    from brdftab.fit.losses import noise_weight

    values = np.array([[0.0], [0.003], [0.03], [4.0], [-1.0]])
    expected = [(max(v, 0.0) + offset) / np.sqrt((max(v, 0.0) + offset) ** 2 + 0.03**2) for v in values[:, 0]]
    np.testing.assert_allclose(noise_weight(loss, values, 0.03)[:, 0], expected, rtol=1e-14)
    assert (noise_weight(loss, values, 0.0) == 1.0).all()


# ---------------------------------------------------------------- around the mirror direction


def test_mirror_sampling_draws_half_of_all_there():
    theta_i, theta_o, phi = near_mirror(TOP, 4000, 3)
    assert theta_i.min() >= 0.0
    assert theta_o.min() >= 0.0
    assert max(theta_i.max(), theta_o.max()) <= TOP
    # uniform over the projected solid angle: the mean of sin^2 is half of the largest
    assert np.mean(np.sin(theta_i) ** 2) == pytest.approx(0.5 * math.sin(TOP) ** 2, rel=0.03)
    inner = (theta_i > 0.4) & (theta_i < TOP - 0.4)
    assert np.std((theta_o - theta_i)[inner]) == pytest.approx(0.12, rel=0.05)
    assert math.sqrt(np.mean((math.pi - phi) ** 2)) == pytest.approx(0.15, rel=0.05)
    fine = brdftab.tabulate("lambert", "45x45x90")
    near, plain = (dataset(fine, theta_max=TOP, sampling=s, samples=2000) for s in ("mirror", "uniform"))
    assert near.sampling == "mirror"
    assert [np.mean(slopes(p) < 0.1) > 0.3 for p in (near, plain)] == [True, False]


def test_the_narrowest_lobe_is_one_that_directions_see():
    slope = np.concatenate([np.full(7, 0.01), np.linspace(0.05, 1.0, 100)])
    assert narrowest(slope, 1e-4, 10.0) == pytest.approx(0.059, rel=0.05)
    assert narrowest(np.append(slope, 0.01), 1e-4, 10.0) == pytest.approx(0.005, rel=0.03)
    assert narrowest(np.zeros(20), 1e-4, 10.0) == 1e-4
    theta = np.array([0.3, 1.2]), np.array([0.5, 1.1]), np.array([3.0, 0.2])
    theta_h = directions.half_difference(theta[0], 0.0 * theta[2], theta[1], theta[2])[0]
    points = dataset(brdftab.tabulate("lambert", "8x8x8"))
    np.testing.assert_allclose(
        slopes(dataclasses.replace(points, theta_i=theta[0], theta_o=theta[1], phi=theta[2])), np.tan(theta_h)
    )


def test_a_spike_between_the_directions_is_told_and_bounded():
    table = brdftab.tabulate("smith", "90x90x180", ndf="ggx", alpha=0.5, f0=0.04)
    table.values[:] += brdftab.tabulate("lambert", "90x90x180", kd=0.2).values
    plain = brdftab.Table(table.values, table.grid, table.channels)
    free = brdftab.fit_model(plain, "smith+lambert", ndf="ggx", samples=2000)
    assert not any(line.startswith(("spike", "poor")) for line in free.warnings)
    least = free.points["least_roughness"]["alpha"]
    assert 1e-3 < least < 0.05
    # a lobe that no direction sees, of any height
    spike = brdftab.fit_model(plain, "smith+lambert", ndf="ggx", alpha=5e-3, samples=2000)
    assert any(line.startswith("spike: ") for line in spike.warnings)
    # a mirror seen through few directions: the bound stands where they end
    mirror = brdftab.tabulate("smith", "90x90x180", ndf="beckmann", alpha=2e-3, f0=0.9)
    mirror.values[:] += 0.01
    sharp = brdftab.fit_model(brdftab.Table(mirror.values, mirror.grid, mirror.channels), "smith+lambert", samples=500)
    assert sharp.values["alpha"] >= sharp.points["least_roughness"]["alpha"]
