"""Tables of albedo: numbers against other roads, files, and the command."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab.cli import main
from brdftab.errors import BrdftabError, FileFormatError, OutputExistsError, ParameterError
from brdftab.models.microfacet.energy import average_albedo, single_albedo


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
