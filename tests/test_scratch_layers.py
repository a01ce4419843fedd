"""Files of scratch layers, covered areas, Eq. 4 and the BRDF of a footprint."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial import cKDTree

import brdftab
from brdftab.cli import main
from brdftab.errors import BrdftabError, ParameterError
from brdftab.scratch_layers import areas, combine, layers, shading

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "scratched"
GOOD = """
seed = 5
[base]
model = "smith"
alpha = 0.2
material = "Fe"
[[layer]]
profile = "quartic:0.5"
material = "Au"
area = 0.2
width = 0.01
length = 0.2
orientation = 30
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "l.toml").write_text(GOOD)
    return tmp_path / "l.toml"


def run(*words):
    return CliRunner().invoke(main, [str(w) for w in words])


# ---------------------------------------------------------------- areas


@pytest.mark.parametrize(
    ("density", "area"), [(0.05, 0.0078), (0.1, 0.031), (0.2, 0.124), (0.3, 0.270), (0.5, 0.642), (0.6, 0.804)]
)
def test_density_is_no_share_of_area(density, area):
    assert areas.covered(density) == pytest.approx(area, abs=6e-4)


def test_area_of_noise_against_nearest_neighbours():
    rng = np.random.default_rng(1)
    n = 400
    points = (np.stack(np.meshgrid(np.arange(n), np.arange(n)), -1) + rng.random((n, n, 2))).reshape(-1, 2)
    places = rng.uniform(2.0, n - 2.0, (400_000, 2))
    near = cKDTree(points).query(places)[0]
    for d in (0.1, 0.3, 0.6, 0.9):
        share = (near <= d).mean()
        # four standard errors of the points
        assert areas.covered(d) == pytest.approx(share, abs=4.0 * math.sqrt(share * (1.0 - share) / 4e5) + 1e-5)


def test_table_inverts_the_area():
    for d in (0.003, 0.05, 0.17, 0.3, 0.55, 0.8, 1.0):
        # measured 3e-4 at .8; maps trim it on their tile anyway
        assert areas.density_of(areas.covered(d)) == pytest.approx(d, rel=5e-4)
    assert areas.covered(0.0) == areas.density_of(0.0) == 0.0
    assert areas.covered(1.5) == 1.0
    small = 1e-4
    assert areas.covered(small) == pytest.approx(math.pi * small**2, rel=1e-6)


# ---------------------------------------------------------------- files


def test_examples_are_read():
    for path in sorted(EXAMPLES.glob("*.toml")):
        found = layers.read(path)
        assert found.channels == ("R", "G", "B")
        assert found.layers


def test_group_draws_angles_in_its_spread():
    found = layers.read(EXAMPLES / "scratched.toml").layers
    degrees = np.degrees([layer.angle for layer in found])
    assert len(found) == 16
    assert [layer.name for layer in found[:2]] == ["1.01", "1.02"]
    # one in each sixteenth of the circle
    assert np.array_equal(np.floor((degrees + 180.0) / 22.5), np.arange(16))
    assert len({layer.seed for layer in found}) == 16
    assert layers.read(EXAMPLES / "scratched.toml").layers == found
    brushed = layers.read(EXAMPLES / "brushed.toml").layers
    assert np.abs(np.degrees([layer.angle for layer in brushed])).max() <= 3.5


def test_density_and_area_go_together(file):
    one = layers.read(file).layers[0]
    assert one.area == 0.2
    file.write_text(GOOD.replace("area = 0.2", f"density = {one.density}"))
    assert layers.read(file).layers[0].area == pytest.approx(0.2, rel=5e-4)


def test_profile_files_count_from_the_layers(file):
    x = np.linspace(-1.0, 1.0, 64)
    np.savetxt(file.parent / "groove.csv", -((1.0 - x * x) ** 2))
    file.write_text(GOOD.replace("quartic:0.5", "file:groove.csv"))
    assert layers.read(file).layers[0].profile == f"file:{file.parent / 'groove.csv'}"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("width = 0.01", "width = 0", ("layer 1: width = 0", "(0, 1]")),
        ("length = 0.2", "length = 0.0", ("layer 1: length = 0", "(0, 1]")),
        ("length = 0.2", "length = -1", ("layer 1: length = -1", "(0, 1]")),
        ("width = 0.01", "width = 'a'", ("layer 1: width = 'a' is not a number",)),
        ("width = 0.01", "", ("layer 1: width is missing",)),
        ("width = 0.01", "width = nan", ("layer 1: width = nan",)),
        ("area = 0.2", "area = 1.2", ("layer 1: area = 1.2", "[0, 1]")),
        ("area = 0.2", "density = -0.1", ("layer 1: density = -0.1", "[0, 2]")),
        ("area = 0.2", "", ("density is missing", "area")),
        ("area = 0.2", "area = 0.2\ndensity = 0.1", ("exclude each other",)),
        ("area = 0.2", "area = 0.2\ncount = 0", ("count = 0", "[1, 256]")),
        ("area = 0.2", "area = 0.2\ncount = 2.5", ("count = 2.5", "whole numbers")),
        ("area = 0.2", "area = 0.2\nspread = 400", ("spread = 400", "[0, 360]")),
        ("area = 0.2", "area = 0.2\ncolour = 1", ("layer 1: colour = 1", "known are")),
        ('profile = "quartic:0.5"', "", ("layer 1: profile is missing",)),
        ('profile = "quartic:0.5"', "profile = 3", ("layer 1: profile = 3",)),
        ("quartic:0.5", "quartic:-1", ("layer 1: profile", "half widths")),
        ("quartic:0.5", "groove", ("layer 1: profile = groove is not known",)),
        ('material = "Au"', 'material = "Xx"', ("layer 1: material = Xx", "Au")),
        ('material = "Au"', 'material = "Au"\nior = 1.5', ("layer 1", "exclude each other")),
        ("alpha = 0.2", "alpha = 99", ("base: alpha = 99", "outside")),
        ("alpha = 0.2", "alhpa = 0.2", ("base", "alhpa")),
        ('model = "smith"', 'model = "smiht"', ("base: model = 'smiht' is not known",)),
        ('model = "smith"', "", ("base: model is missing",)),
        ("seed = 5", "seed = -5", ("seed = -5",)),
        ("seed = 5", "psi = 0", ("psi = 0", "[0.01, 20]")),
        ("seed = 5", "combination = 'sum'", ("combination = 'sum'", "union")),
        ("seed = 5", "sede = 5", ("sede = 5", "seed")),
        ("seed = 5", "seed = = 5", ("not valid TOML",)),
        ("[[layer]]", "[layer]", ("layer is missing",)),
    ],
)
def test_what_is_wrong_is_told_in_one_line(file, old, new, words):
    assert old in GOOD
    file.write_text(GOOD.replace(old, new))
    with pytest.raises(BrdftabError) as caught:
        layers.read(file)
    text = str(caught.value)
    assert text.startswith(str(file))
    assert "\n" not in text
    for word in words:
        assert word in text
    done = run("scratch", "maps", file, "--size", 16)
    assert done.exit_code == 2
    assert len(done.stderr.splitlines()) == 1
    assert not (file.parent / "maps.exr").exists()


def test_missing_base_and_layers(file):
    file.write_text(GOOD[: GOOD.index("[[layer]]")])
    with pytest.raises(ParameterError, match="layer is missing"):
        layers.read(file)
    file.write_text(GOOD[GOOD.index("[[layer]]") :])
    with pytest.raises(ParameterError, match="base is missing"):
        layers.read(file)
    with pytest.raises(ParameterError, match="cannot be opened"):
        layers.read(file.parent / "no.toml")
    # channels of both must go together
    file.write_text(
        GOOD.replace('material = "Au"', 'material = "Au"\n').replace('"Fe"', '"Fe"\nwavelengths = [500, 600]')
    )
    with pytest.raises(ParameterError, match="channels"):
        layers.read(file)


# ---------------------------------------------------------------- combination


def test_weights_follow_equation_4():
    each, rest = combine.weights([[0.2, 0.3], [0.8, 0.4], [0.0, 0.0], [1.0, 0.0]])
    assert np.allclose(each, [[0.2, 0.3], [2.0 / 3.0, 1.0 / 3.0], [0.0, 0.0], [1.0, 0.0]])
    assert np.allclose(rest, [0.5, 0.0, 1.0, 0.0])


def test_union_covers_what_independent_layers_do():
    rng = np.random.default_rng(2)
    alpha = np.array([0.3, 0.5, 0.1])
    hit = rng.random((200_000, 3)) < alpha
    each, rest = combine.weights(alpha, "union")
    assert rest == pytest.approx((~hit.any(axis=1)).mean(), abs=0.005)
    assert each.sum() + rest == pytest.approx(1.0, abs=1e-15)
    assert np.allclose(each / each.sum(), alpha / alpha.sum())
    # shares far below the rounding of 1 are kept
    tiny, _ = combine.weights([1e-20, 3e-20], "union")
    assert np.allclose(tiny, [1e-20, 3e-20], rtol=1e-12, atol=0.0)
    full, none = combine.weights([1.0, 0.5], "union")
    assert none == 0.0
    assert full.sum() == pytest.approx(1.0)


def test_wrong_shares_are_refused():
    for bad in (-0.1, 1.1, math.nan):
        with pytest.raises(ParameterError, match="alpha"):
            combine.weights([0.1, bad])
    with pytest.raises(ParameterError, match="combination = sum"):
        combine.weights([0.1], "sum")


# ---------------------------------------------------------------- values

ANGLES = np.radians([20.0, 45.0, 70.0]), np.radians([25.0, 45.0, 60.0]), np.radians([170.0, 180.0, 200.0])


def test_bare_footprint_is_the_base(file):
    found = shading.evaluate(layers.read(file), [0.0], *ANGLES, phi_i=0.3)
    base = brdftab.evaluate("smith", *ANGLES, phi_i=0.3, alpha=0.2, material="Fe")
    assert np.allclose(found, base, rtol=1e-5)


def test_covered_footprint_is_a_turned_scratch(file):
    # azimuths across the scratches, so that the cone is met
    theta = np.radians([20.0, 45.0, 60.0])
    across = math.radians(30.0 + 90.0)
    found = shading.evaluate(layers.read(file), [1.0], theta, theta[::-1], math.pi, phi_i=across)
    alone = brdftab.trace_scratch("quartic:0.5").evaluate(
        theta, theta[::-1], math.pi, phi_i=0.5 * math.pi, material="Au"
    )
    assert (alone > 0.01).all()
    assert np.allclose(found, alone, rtol=1e-12)
    # off the cone by more than psi nothing is left
    assert (shading.evaluate(layers.read(file), [1.0], theta, theta, 2.0, phi_i=across) == 0.0).all()


def test_footprint_is_a_weighted_sum_and_reciprocal(file):
    file.write_text(GOOD + GOOD[GOOD.index("[[layer]]") :].replace("orientation = 30", "orientation = 120"))
    layered = layers.read(file)
    # both layers' cones hold the mirror direction
    alpha = [0.3, 0.4]
    whole = shading.evaluate(layered, alpha, *ANGLES, phi_i=0.2)
    parts = [shading.evaluate(layered, one, *ANGLES, phi_i=0.2) for one in ([1.0, 0.0], [0.0, 1.0], [0.0, 0.0])]
    assert np.allclose(whole, 0.3 * parts[0] + 0.4 * parts[1] + 0.3 * parts[2], rtol=1e-12)
    ti, to, phi = ANGLES
    swapped = shading.evaluate(layered, alpha, to, ti, -phi, phi_i=0.2 + phi)
    assert np.allclose(whole, swapped, rtol=1e-6)
    # a share a point
    many = shading.evaluate(layered, [[0.3, 0.4], [0.0, 0.0], [1.0, 1.0]], *ANGLES, phi_i=0.2)
    assert np.allclose(many[0], whole[0])
    assert np.allclose(many[2], 0.5 * (parts[0] + parts[1])[2])
    with pytest.raises(ParameterError, match="number of layers, 2"):
        shading.evaluate(layered, [0.1], *ANGLES)


def test_culling_costs_at_most_its_bound(file):
    rng = np.random.default_rng(4)
    text = GOOD[GOOD.index("[[layer]]") :]
    file.write_text(GOOD.replace("orientation = 30", "spread = 180\ncount = 6") + text)
    layered = layers.read(file)
    alpha = (10.0 ** rng.uniform(-5.0, -1.0, (7, 40))).astype(np.float32)
    kept, facts = combine.culled(alpha, 1e-3)
    assert facts["bound"] == pytest.approx(np.where(alpha < 1e-3, alpha, 0.0).sum(axis=0).max())
    angles = 0.5, 0.5, math.pi
    difference = np.abs(shading.evaluate(layered, alpha.T, *angles) - shading.evaluate(layered, kept.T, *angles))
    base = shading.evaluate(layered, np.zeros(7), *angles)
    most = max(np.abs(shading.evaluate(layered, one, *angles) - base).max() for one in np.eye(7))
    assert 0.0 < difference.max() <= facts["bound"] * most
    assert combine.culled(alpha, 0.0)[1] == {"alive": 7.0, "bound": 0.0, "area": 0.0}


# ---------------------------------------------------------------- the command line


def test_eval_of_a_file(file):
    words = ("scratch", "eval", file, "--theta-i", 30, "--theta-o", 30, "--phi", 180, "--size", 64)
    done = run(*words, "--level", 9, "--json")
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    # beyond the last level stands the mean
    assert found["alpha"][0] == pytest.approx(0.2, rel=5e-3)
    assert found["base"] + sum(found["weights"]) == pytest.approx(1.0)
    value = shading.evaluate(layers.read(file), found["alpha"], math.pi / 6, math.pi / 6, math.pi)
    assert np.allclose(found["value"], value)
    assert "base covers" in run(*words, "--u", 0.3).stdout
    assert run("scratch", "maps", file, "--size", 64).exit_code == 0
    assert json.loads(run(*words, "--maps", "maps.exr", "--level", 9, "--json").stdout) == found
    file.write_text(GOOD.replace("width = 0.01", "width = 0.02"))
    done = run(*words, "--maps", "maps.exr")
    assert done.exit_code == 2
    assert "other layers" in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("--level", -1),
        ("--u", "nan"),
        ("--size", 100),
        ("--combination", "sum"),
        ("--theta-i", "nan"),
        ("--maps", "x.exr"),
    ],
)
def test_wrong_options_of_eval(file, words):
    given = ("scratch", "eval", file, "--theta-i", 30, "--theta-o", 30, "--phi", 180, "--size", 16)
    done = run(*given, *words)
    assert done.exit_code == 2, done.output
    assert len(done.stderr.splitlines()) == 1


def test_profile_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = json.loads(run("scratch", "profile", "quartic:1", "--json").stdout)
    assert found["depth"] == pytest.approx(1.0, abs=1e-12)
    # 4 x (1 - x^2) is steepest at 1/sqrt(3)
    assert found["steepest_slope"] == pytest.approx(8.0 / (3.0 * math.sqrt(3.0)), rel=1e-4)
    assert json.loads(run("scratch", "profile", "v:30", "--json").stdout)["steepest_degrees"] == pytest.approx(60.0)
    assert json.loads(run("scratch", "profile", "flat", "--json").stdout)["depth"] == 0.0
    assert run("scratch", "profile", "ellipse:1", "--out", "p.png").exit_code == 0
    assert (tmp_path / "p.png").stat().st_size > 5000
    for words in (("v:95",), ("quartic:1", "--out", "p.png"), ("quartic:1", "--out", "p.txt"), ("file:no.csv",)):
        done = run("scratch", "profile", *words)
        assert done.exit_code == 2
        assert len(done.stderr.splitlines()) == 1
