"""Traced scratches as files and on the command line."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab.cli import main
from brdftab.errors import BrdftabError, FileFormatError, OutputExistsError, ParameterError

IRON = {"eta": 2.91, "k": 3.09}


@pytest.fixture(scope="module")
def scratch():
    return brdftab.trace_scratch("quartic:1", bins=64)


@pytest.mark.parametrize(("ending", "close"), [("npz", 0.0), ("exr", 5e-9)])
def test_native_files_serve_any_material(scratch, tmp_path, ending, close):
    path = tmp_path / f"s.{ending}"
    head = brdftab.write_scratch(scratch, path)
    back = brdftab.read_scratch(path)
    # float32 has 6e-8; scaled anew, energy is kept all the same
    np.testing.assert_allclose(back.flux, scratch.flux, atol=close)
    for material in ({"material": "mirror"}, {"material": "Cu"}, IRON, {"ior": 1.5}):
        t = np.radians([0.0, 50.0, -80.0])
        np.testing.assert_allclose(back.albedo(t, **material), scratch.albedo(t, **material), atol=close)
    assert back.profile.text == "quartic:1"
    x = np.linspace(-1.0, 1.0, 50)
    np.testing.assert_array_equal(back.profile.at(x)[0], scratch.profile.at(x)[0])
    assert head["error"]["l1"] == pytest.approx(scratch.error)
    assert head["error"]["column_sum_deviation"] < 1e-8


def test_exr_shows_bounce_orders(scratch, tmp_path):
    import OpenEXR

    brdftab.write_scratch(scratch, tmp_path / "s.exr")
    with OpenEXR.File(str(tmp_path / "s.exr"), separate_channels=True) as file:
        channels = file.parts[0].channels
        np.testing.assert_allclose(channels["R"].pixels, scratch.rho(1), rtol=1e-6)
        np.testing.assert_allclose(channels["G"].pixels, scratch.rho(2), rtol=1e-6)
        assert "radians" in json.loads(file.parts[0].header["brdftab"])["angles"]


@pytest.mark.parametrize("material", [{"f0": 0.56}, IRON, {"material": "Au"}])
def test_triplets_are_the_papers_blend(scratch, tmp_path, material):
    """The blend has the slices at 0 and 60 degrees exactly where gamma is defined, and mirrors at 90."""
    path = tmp_path / "t.npz"
    head = brdftab.write_scratch(scratch, path, form="triplet", **material)
    fresnel = brdftab.scratch_layers.scratch.material_of(material)
    with np.load(path) as file:
        for c, channel in enumerate(head["channels"]):
            low, mirror, gamma = file[f"rho_0.{channel}"], file["rho_m"], file[f"gamma.{channel}"]
            np.testing.assert_allclose(low, scratch.shaded(0.0, fresnel)[..., c], rtol=1e-12, atol=1e-12)
            at = scratch.shaded(math.pi / 3.0, fresnel)[..., c]
            share = (2.0 / 3.0) ** gamma
            defined = (mirror > 0.0) & (gamma < 64.0) & (gamma > 0.0)
            blend = share * mirror + (1.0 - share) * low
            np.testing.assert_allclose(blend[defined], at[defined], rtol=1e-6)
            undefined = ((mirror > 0.0) & (gamma >= 64.0)).sum() / (mirror > 0.0).sum()
            assert head["gamma_undefined"][channel] == pytest.approx(undefined, abs=1e-9)
    if "eta" in material:
        # exact reflectance of iron dips below normal incidence
        assert head["gamma_undefined"]["Y"] > 0.7
    if "f0" in material:
        assert head["gamma_undefined"]["Y"] == 0.0


def test_dense_tables_keep_energy_and_are_reciprocal(scratch, tmp_path):
    path = tmp_path / "d.npz"
    head = brdftab.write_scratch(scratch, path, form="dense", sizes=(8, 16), material="mirror")
    assert (head["t_bins"], head["p_bins"]) == (8, 16)
    with np.load(path) as file:
        f = file["Y"].reshape(8, 16, 8, 16)
    t, p = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 9), np.linspace(-0.5 * math.pi, 0.5 * math.pi, 17)
    # int cos^2 t dt and int cos p dp over the bins
    along, across = 0.5 * np.diff(t) + 0.25 * np.diff(np.sin(2.0 * t)), np.diff(np.sin(p))
    lost = scratch.lost @ scratch.traced.aperture / 2.0
    np.testing.assert_allclose(np.einsum("apbq,b,q->ap", f, along, across), 1.0, atol=1e-6 + 40.0 * lost)
    np.testing.assert_allclose(f, f.transpose(2, 3, 0, 1), rtol=1e-12, atol=1e-12)
    for a in range(8):
        assert f[a, :, np.arange(8) != 7 - a].max() == 0.0


def test_damaged_and_other_files_are_refused(scratch, tmp_path):
    for ending in ("npz", "exr"):
        brdftab.write_scratch(scratch, tmp_path / f"s.{ending}")
        whole = (tmp_path / f"s.{ending}").read_bytes()
        for kept in (0, 3, 200, len(whole) // 2):
            cut = tmp_path / f"cut.{ending}"
            cut.write_bytes(whole[:kept])
            with pytest.raises(FileFormatError) as caught:
                brdftab.read_scratch(cut)
            assert "\n" not in str(caught.value)
    brdftab.write_scratch(scratch, tmp_path / "t.npz", form="triplet")
    with pytest.raises(FileFormatError, match="another kind"):
        brdftab.read_scratch(tmp_path / "t.npz")
    with pytest.raises(BrdftabError, match="cannot be opened"):
        brdftab.read_scratch(tmp_path / "none.npz")
    with pytest.raises(OutputExistsError):
        brdftab.write_scratch(scratch, tmp_path / "t.npz")


def test_wrong_requests_are_one_line(scratch, tmp_path):
    for given, match in (
        ({"form": "paper"}, "form = paper is not known"),
        ({"form": "native", "material": "Au"}, "material has no place"),
        ({"form": "dense", "sizes": (8, 15)}, "multiples of 15"),
        ({"form": "triplet", "material": "wood"}, "material = wood"),
    ):
        with pytest.raises(ParameterError, match=match):
            brdftab.write_scratch(scratch, tmp_path / "x.npz", **given)
    assert not list(tmp_path.iterdir())


def run(*words):
    return CliRunner().invoke(main, ["tabulate", "--model", "scratch", "--bins", "32", *words])


def test_command_writes_every_form(tmp_path):
    for form, more in (("native", []), ("triplet", ["--material", "Cu"]), ("dense", ["--grid", "8x16"])):
        out = tmp_path / f"{form}.exr"
        result = run("--profile", "v:30", "--form", form, *more, "--out", str(out), "--json")
        assert result.exit_code == 0, result.stderr
        facts = json.loads(result.stdout)
        assert facts["form"] == form
        assert facts["profile"] == "v:30"
        np.testing.assert_allclose(facts["flux_by_order"][:3], [0.267949, 0.464102, 0.267949], atol=1e-3)
        assert out.exists()
    text = run("--profile", "v:30", "--out", str(tmp_path / "n.npz"), *("--eta", "2.91", "--k", "3.09"))
    assert "albedo   60  0.298" in text.stdout
    assert brdftab.read_scratch(tmp_path / "n.npz").bins == 32


def test_command_warns_of_light_that_the_cap_cuts_off(tmp_path):
    deep = run("--profile", "v:10", "--max-bounces", "3", "--out", str(tmp_path / "d.npz"))
    assert deep.exit_code == 0
    assert "Warning: max_bounces = 3 cuts off 0." in deep.stderr
    assert "--max-bounces" in deep.stderr
    assert "Warning" not in run("--profile", "v:45", "--out", str(tmp_path / "s.npz")).stderr


def test_command_writes_tables_as_of_other_models(tmp_path):
    out = tmp_path / "b.npz"
    result = run("--form", "blurred", "--psi", "10", "--grid", "4x6x4x6", "--material", "mirror", "--out", str(out))
    assert result.exit_code == 0, result.stderr
    table = brdftab.read(out)
    assert table.grid.shape == (4, 6, 4, 6)
    assert np.array_equal(table.values, table.values.transpose(2, 3, 0, 1, 4))
    assert table.values.max() > 0.0


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (["--form", "dense", "--grid", "8x8x8"], "grid = 8x8x8 is not TxP"),
        (["--form", "native", "--grid", "8x8"], "grid = 8x8 has no meaning for form = native"),
        (["--psi", "2"], "psi has no meaning for form = native"),
        (["--cell", "average"], "cell has no meaning"),
        (["--profile", "w:1"], "profile = w:1 is not known"),
        (["--form", "blurred", "--grid", "9x9x9"], "grid of four axes"),
    ],
)
def test_command_refuses_in_one_line(words, match, tmp_path):
    result = run(*words, "--out", str(tmp_path / "x.npz"))
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert match in result.stderr
    assert not list(tmp_path.iterdir())


def test_other_models_have_no_forms(tmp_path):
    words = ["tabulate", "--model", "lambert", "--form", "native", "--out", str(tmp_path / "x.npz")]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 2
    assert "form = native" in result.stderr
