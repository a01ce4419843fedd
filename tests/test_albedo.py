"""Tables of albedo: numbers against other path samplers, files, and the command."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab.cli import main
from brdftab.errors import BrdftabError, FileFormatError, OutputExistsError, ParameterError
from brdftab.models._shared.single_bounce.albedo import average_albedo, single_albedo


def test_a_matte_surface_has_its_albedo_everywhere():
    table = brdftab.tabulate_albedo("lambert", cosines=4, kd=(0.2, 0.5, 0.9))
    np.testing.assert_allclose(table.directional["reflected"][0], np.tile([0.2, 0.5, 0.9], (4, 1)), rtol=1e-6)
    np.testing.assert_allclose(table.average["reflected"], [[0.2, 0.5, 0.9]], rtol=1e-6)
    assert table.provenance["error"]["met"]
    assert table.channels == ("R", "G", "B")


def test_single_bounces_of_smith_multi_against_another_quadrature():
    """The solver's mean over azimuth of one bounce against half vectors by tilt: 1e-6 was asked, 1.1e-11 found."""
    table = brdftab.tabulate_albedo(
        "smith-multi", cosines=6, roughness=(0.1, 0.7), tolerance=1e-6, ndf="ggx", material="mirror", max_bounces=1
    )
    for row, alpha in enumerate((0.1, 0.7)):
        expected = single_albedo(0, 1, alpha, np.arccos(table.cosines))
        np.testing.assert_allclose(table.directional["reflected"][row, :, 0], expected, rtol=0.0, atol=5e-11)
        assert table.average["reflected"][row, 0] == pytest.approx(average_albedo(0, 1, alpha), abs=5e-11)


@pytest.fixture(scope="module")
def table():
    return brdftab.tabulate_albedo("lambert", cosines=3, kd=(0.2, 0.5, 0.9))


def test_npz_keeps_every_bit(table, tmp_path):
    brdftab.write_albedo(table, tmp_path / "a.npz")
    back = brdftab.read_albedo(tmp_path / "a.npz")
    for name in ("cosines", "roughness"):
        np.testing.assert_array_equal(getattr(back, name), getattr(table, name))
    np.testing.assert_array_equal(back.directional["reflected"], table.directional["reflected"])
    np.testing.assert_array_equal(back.average["reflected"], table.average["reflected"])
    assert back.provenance == table.provenance
    assert back.channels == table.channels


def test_exr_has_a_part_of_directions_and_one_of_averages(table, tmp_path):
    import OpenEXR

    brdftab.write_albedo(table, tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        parts = {part.name(): part for part in file.parts}
        np.testing.assert_allclose(parts["albedo"].channels["G"].pixels, np.full((1, 3), 0.5), rtol=1e-6)
        np.testing.assert_allclose(parts["average"].channels["B"].pixels, [[0.9]], rtol=1e-6)
        head = json.loads(parts["albedo"].header["brdftab"])
    assert head["provenance"]["model"] == "lambert"
    assert head["cosines"] == pytest.approx([1 / 6, 0.5, 5 / 6])


def test_existing_files_are_kept(table, tmp_path):
    path = tmp_path / "a.npz"
    brdftab.write_albedo(table, path)
    with pytest.raises(OutputExistsError):
        brdftab.write_albedo(table, path)
    brdftab.write_albedo(table, path, overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_damaged_files_are_refused(table, tmp_path):
    brdftab.write_albedo(table, tmp_path / "a.npz")
    whole = (tmp_path / "a.npz").read_bytes()
    for kept in (0, 1, 100, len(whole) // 2, len(whole) - 1):
        (tmp_path / "cut.npz").write_bytes(whole[:kept])
        with pytest.raises(FileFormatError, match=r"cut\.npz.*damaged"):
            brdftab.read_albedo(tmp_path / "cut.npz")
    middle = whole.index(b"reflected.npy") + 200
    (tmp_path / "cut.npz").write_bytes(whole[:middle] + b"\xff\xff" + whole[middle + 2 :])
    with pytest.raises(FileFormatError, match=r"cut\.npz.*damaged"):
        brdftab.read_albedo(tmp_path / "cut.npz")


def test_other_files_are_refused(tmp_path):
    np.savez(tmp_path / "b.npz", values=np.zeros(3))
    (tmp_path / "c.npz").write_text("no")
    for name in ("b.npz", "c.npz"):
        with pytest.raises(FileFormatError):
            brdftab.read_albedo(tmp_path / name)
    with pytest.raises(BrdftabError):
        brdftab.read_albedo(tmp_path / "missing.npz")


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"model": "lambert", "cosines": 1}, "cosines = 1 is outside"),
        ({"model": "lambert", "roughness": (0.5,)}, "roughness needs a model"),
        ({"model": "smith", "roughness": ()}, "roughness is empty"),
        ({"model": "smith", "roughness": (0.5, 99.0)}, "alpha = 99 is outside"),
        ({"model": "smith", "alpha_x": 0.1, "alpha_y": 0.3}, "isotropic"),
        ({"model": "smith-multi", "estimator": "pt"}, "estimate with noise"),
    ],
)
def test_bad_input_is_one_line(options, match):
    with pytest.raises(ParameterError, match=match) as caught:
        brdftab.tabulate_albedo(**options)
    assert "\n" not in str(caught.value)


def test_command(tmp_path):
    out = tmp_path / "albedo.npz"
    result = CliRunner().invoke(main, ["albedo", "--model", "oren-nayar", "--sigma", "20", "--out", str(out), "--json"])
    assert result.exit_code == 0, result.stderr
    facts = json.loads(result.stdout)
    found = brdftab.read_albedo(out)
    angles = np.arccos(found.cosines[[3, 20]])
    expected = brdftab.albedo("oren-nayar", angles, sigma=math.radians(20.0))
    np.testing.assert_allclose(found.directional["reflected"][0, [3, 20]], expected, rtol=1e-12)
    assert facts["average"]["reflected"][0] == pytest.approx(found.average["reflected"][0].tolist())
    again = CliRunner().invoke(main, ["albedo", "--model", "oren-nayar", "--out", str(out)])
    assert again.exit_code == 2
    assert again.stderr.startswith("Error: ")


@pytest.mark.parametrize("text", ["", "a", "0.1:0.2", "0.1:0.2:1", "0.1,inf"])
def test_malformed_lists_of_roughness(text, tmp_path):
    options = ["albedo", "--model", "smith", "--roughness", text, "--out", str(tmp_path / "a.exr")]
    result = CliRunner().invoke(main, options)
    assert result.exit_code == 2
    assert "roughness" in result.stderr
    assert not list(tmp_path.iterdir())


# ---------------------------------------------------------------- fixed views, and light from below

ANGLES = np.radians([10.0, 50.0, 80.0])


@pytest.mark.parametrize(("ndf", "alpha"), [("ggx", 0.3), ("ggx", 0.8), ("beckmann", 0.8)])
def test_compensation_of_a_fixed_view_returns_all_light(ndf, alpha):
    """The factor 1 + (1 - E)/E belongs to the view: 1 to 2e-7 there, and 0.84 to 1.26 light by light."""
    white = {"ndf": ndf, "alpha": alpha, "material": "mirror"}
    np.testing.assert_allclose(brdftab.albedo("turquin", ANGLES, fixed="view", **white), 1.0, atol=1e-6)
    assert np.abs(brdftab.albedo("turquin", ANGLES, **white) - 1.0).max() > 0.01
    table = brdftab.tabulate_albedo("turquin", cosines=4, fixed="view", **white)
    np.testing.assert_allclose(table.directional["reflected"], 1.0, atol=1e-6)
    np.testing.assert_allclose(table.average["reflected"], 1.0, atol=1e-6)


def test_a_fixed_view_adds_up_what_all_lights_send_there():
    """Against sums of evaluate over a plain product rule of lights; measured 2e-10."""
    x, w = np.polynomial.legendre.leggauss(48)
    light, weight = 0.25 * math.pi * (1.0 + x), 0.25 * math.pi * w
    azimuth = 2.0 * math.pi * np.arange(96) / 96
    values = brdftab.evaluate("turquin", light[:, None], 0.9, azimuth, ndf="ggx", alpha=0.7)
    expected = np.einsum("iac,i->c", values, weight * np.sin(light) * np.cos(light)) * 2.0 * math.pi / 96
    np.testing.assert_allclose(brdftab.albedo("turquin", 0.9, fixed="view", ndf="ggx", alpha=0.7), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("model", "given"),
    [("smith", {"alpha": 0.5}), ("vgroove-sym", {"alpha_x": 0.3, "alpha_y": 0.6}), ("ilm", {"sigma": 0.0})],
)
def test_reciprocal_models_do_not_tell_view_from_light(model, given):
    light, view = (brdftab.albedo(model, 0.7, phi_i=0.4, fixed=fixed, **given) for fixed in ("light", "view"))
    np.testing.assert_allclose(view, light, rtol=1e-12)


def test_dielectrics_keep_the_light_from_either_side():
    """R + T of the solver from above and below, to 1e-3 asked: measured 1.9e-6 at most."""
    angles = np.concatenate([ANGLES, math.pi - ANGLES])
    glass = {"ior": 1.5, "alpha": 0.5, "tolerance": 1e-3}
    total = brdftab.albedo("smith-multi", angles, **glass)
    np.testing.assert_allclose(total, 1.0, atol=1e-5)
    reflected, transmitted = (
        brdftab.albedo("smith-multi", angles, part=part, **glass) for part in ("reflected", "transmitted")
    )
    np.testing.assert_allclose(reflected + transmitted, total, atol=5e-6)
    table = brdftab.tabulate_albedo("smith-multi", cosines=2, **glass)
    below = brdftab.albedo("smith-multi", math.pi - np.arccos(table.cosines), part="reflected", **glass)
    np.testing.assert_allclose(table.directional["reflected_below"][0], below, atol=1e-5)
    # what leaves upwards was refracted away from the normal: total reflection beyond 42 degrees
    assert reflected[4, 0] > 0.6 > reflected[1, 0]


def test_walks_split_as_the_walk_itself_does():
    """Parts against the exits of samples, and smith-multi's own walks against its solver: standard errors of 1e-3."""
    glass = {"ior": 1.5, "alpha": 0.5}
    for theta in (0.9, math.pi - 0.9):
        parts = [brdftab.albedo("smith-walk", theta, part=p, **glass)[0] for p in ("reflected", "transmitted")]
        assert sum(parts) == pytest.approx(1.0, abs=1e-12)
        drawn = brdftab.sample("smith-walk", theta, 40_000, seed=11, **glass)
        same = ((drawn.theta_o < 0.5 * math.pi) == (theta < 0.5 * math.pi)).mean()
        assert parts[0] == pytest.approx(same, abs=4.0 * math.hypot(1e-3, 0.5 / math.sqrt(40_000)))
        drawn_apart, solved = (
            brdftab.albedo("smith-multi", theta, part="reflected", tolerance=1e-3, estimator=e, **glass)[0]
            for e in ("pt", "solver")
        )
        assert drawn_apart == pytest.approx(solved, abs=4e-3)


@pytest.mark.parametrize("theta_o", [0.6, math.pi - 0.4])
def test_what_passes_to_a_fixed_view_carries_the_square_of_the_index(theta_o):
    """The n^2 of a fixed view against sums of evaluate over lights on the other side: measured 2.5e-4."""
    x, w = np.polynomial.legendre.leggauss(24)
    theta, weight = 0.25 * math.pi * (1.0 + x), 0.25 * math.pi * w
    light = math.pi - theta if theta_o < 0.5 * math.pi else theta
    azimuth = 2.0 * math.pi * np.arange(32) / 32
    glass = {"ior": 1.5, "alpha": 0.8, "tolerance": 1e-4}
    values = brdftab.evaluate("smith-multi", light[:, None], theta_o, azimuth, **glass)[..., 0]
    expected = values.sum(axis=1) @ (weight * np.sin(theta) * np.cos(theta)) * 2.0 * math.pi / 32
    found = brdftab.albedo("smith-multi", theta_o, part="transmitted", fixed="view", **glass)[0]
    assert found == pytest.approx(expected, rel=5e-4)
    other = brdftab.albedo("smith-multi", theta_o, part="transmitted", **glass)[0]
    assert found / other == pytest.approx(1.5**-2 if theta_o < 0.5 * math.pi else 1.5**2, rel=1e-12)


@pytest.mark.parametrize(
    ("model", "theta", "given", "match"),
    [
        ("smith", 2.0, {}, r"theta_i = 114.592 degrees is outside \[0, 90\)"),
        ("smith-multi", 0.5 * math.pi, {"ior": 1.5}, r"outside \[0, 180\] degrees without 90"),
        ("smith-multi", 3.2, {"ior": 1.5}, r"outside \[0, 180\]"),
        ("smith-multi", 2.0, {}, r"only surfaces that transmit"),
        ("smith", 0.5, {"fixed": "both"}, "choose one of light, view"),
        ("smith", 0.5, {"part": "half"}, "choose one of total, reflected, transmitted"),
        ("smith", 0.5, {"part": "transmitted"}, "part = transmitted is of surfaces that transmit"),
    ],
)
def test_bad_directions_and_parts_are_one_line(model, theta, given, match):
    with pytest.raises(ParameterError, match=match) as caught:
        brdftab.albedo(model, theta, **given)
    assert "\n" not in str(caught.value)


def test_files_say_whose_cosine_they_hold(tmp_path):
    words = ["albedo", "--model", "turquin", "--alpha", "0.6", "--cosines", "3", "--fixed", "view", "--json"]
    result = CliRunner().invoke(main, [*words, "--out", str(tmp_path / "a.npz")])
    assert result.exit_code == 0, result.stderr
    facts = json.loads(result.stdout)
    assert facts["fixed"] == "view"
    assert "lit by 1 from all sides" in facts["meaning"]
    back = brdftab.read_albedo(tmp_path / "a.npz")
    assert back.fixed == "view"
    assert back.metadata()["fixed"] == "view"
    light = brdftab.tabulate_albedo("turquin", cosines=3, alpha=0.6)
    assert light.fixed == "light"
    assert np.abs(light.directional["reflected"] - back.directional["reflected"]).max() > 0.01


@pytest.mark.parametrize("model", ["cook-torrance", "vgroove-sym", "oren-nayar", "smith"])
def test_stated_errors_are_those_of_the_rule(model):
    """Rules of two tolerances with the same nodes would agree and state nothing: 0 for 6.7e-5, 4e-8 for 4.9e-5."""
    exact = brdftab.tabulate_albedo(model, cosines=8, tolerance=1e-9).directional["reflected"]
    for tolerance in (1e-3, 3e-4, 1e-4):
        table = brdftab.tabulate_albedo(model, cosines=8, tolerance=tolerance)
        true = np.abs(table.directional["reflected"] - exact).max()
        # three of eight cosines are looked at: measured .66 of the largest at least
        assert table.provenance["error"]["estimate"] > 0.6 * true, tolerance
