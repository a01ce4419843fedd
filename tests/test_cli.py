"""The command line as a user meets it: outputs, refusals, interruption, what a second run finds."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import numpy as np
import OpenEXR
import pytest
from click.testing import CliRunner
from grids import grid_of

import brdftab
from brdftab import models
from brdftab.cli import main

SMALL = ("--grid", "3x3x4")
FACTS = [
    "model", "parameters", "shape", "axes", "cell", "dtype", "channels", "components", "albedo", "error",
    "delta", "energy", "energy_left_out", "kernel_time_s", "compile_time_s", "total_time_s", "wall_time_s",
    "cells_per_s", "files",
]  # fmt: skip


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run the command line in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        return CliRunner().invoke(main, [str(word) for word in words])

    return call


def shell(*words, cwd, **more):
    """Run the command line as its own process."""
    command = [sys.executable, "-c", "from brdftab.cli import main; main()", *map(str, words)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, **more)


# ---------------------------------------------------------------- tabulate


def test_both_formats_in_one_call(run, tmp_path):
    result = run("tabulate", "--model", "vgroove-sym", *SMALL, "--out", "a.exr", "--out", "b.npz", "--json")
    assert result.exit_code == 0, result.stderr
    facts = json.loads(result.stdout)
    assert list(facts) == FACTS
    assert facts["files"] == ["a.exr", "b.npz"]
    assert facts["wall_time_s"] >= facts["total_time_s"] >= facts["kernel_time_s"] > 0.0
    assert facts["shape"] == [3, 3, 4, 3]
    assert facts["parameters"] == {"ndf": "beckmann", "alpha": 0.5, "material": "Au"}
    assert facts["albedo"]["theta_i_degrees"] == [0.0, 30.0, 60.0, 80.0]
    assert facts["error"].keys() >= {"estimate", "tolerance", "met", "reason", "definition"}
    one, two = brdftab.read("a.exr"), brdftab.read("b.npz")
    assert one.values.tobytes() == two.values.tobytes()
    assert one.provenance == two.provenance
    assert one.provenance["error"] == facts["error"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.exr", "b.npz"]


def test_text_says_what_was_made(run):
    result = run("tabulate", "--model", "vgroove-sym", *SMALL, "--max-bounces", 2)
    assert result.exit_code == 0, result.stderr
    assert "3 theta_i x 3 theta_o x 4 phi" in result.stdout
    for word in ("model", "parameters", "table", "albedo", "left out", "error", "run time", "cells/s", "wrote"):
        assert word in result.stdout
    kernels, everything = re.search(r"([\d.]+) s in kernels, (-?[\d.]+) s in all", result.stdout).groups()
    # rounded to milliseconds and to hundredths
    assert float(everything) >= float(kernels) - 0.006
    assert len(re.findall(r"^albedo +(0|30|60|80) ", result.stdout, re.M)) == 4
    assert os.path.exists("vgroove-sym.exr")


@pytest.mark.parametrize("name", models.names())
def test_model_alone_is_enough(run, name):
    # the default grid takes long for some; everything else is the documented default
    result = run("tabulate", "--model", name, "--grid", grid_of(name, "3x3x4", "2x4x2x4"))
    assert result.exit_code == 0, result.stderr
    table = brdftab.read(f"{name}.exr")
    assert table.dtype == np.float32
    assert table.grid.cell == "center"
    assert set(table.provenance["parameters"]) <= {p.name for p in models.spec(name).params}


def test_existing_output_is_kept(run):
    assert run("tabulate", "--model", "lambert", *SMALL).exit_code == 0
    before = Path("lambert.exr").read_bytes()
    refused = run("tabulate", "--model", "lambert", "--kd", 0.1, *SMALL)
    assert refused.exit_code == 2
    assert "lambert.exr" in refused.stderr
    assert "--overwrite" in refused.stderr
    assert Path("lambert.exr").read_bytes() == before
    assert run("tabulate", "--model", "lambert", "--kd", 0.1, *SMALL, "--overwrite").exit_code == 0
    assert np.allclose(brdftab.read("lambert.exr").values, 0.1 / np.pi)


def test_no_output_is_written_where_one_is_refused(run, tmp_path):
    (tmp_path / "b.npz").write_bytes(b"mine")
    assert run("tabulate", "--model", "lambert", *SMALL, "--out", "a.exr", "--out", "b.npz").exit_code == 2
    assert [p.name for p in tmp_path.iterdir()] == ["b.npz"]


def test_components_are_layers(run):
    result = run("tabulate", "--model", "vgroove-sym", *SMALL, "--components", "--max-bounces", 3, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["components"] == ["order1", "order2", "order3"]
    with OpenEXR.File("vgroove-sym.exr", separate_channels=True) as file:
        names = set(file.channels())
    layers = [f"{layer}.{channel}" for layer in ("order1", "order2", "order3") for channel in "RGB"]
    assert names == {"R", "G", "B", *layers}
    table = brdftab.read("vgroove-sym.exr")
    assert np.allclose(sum(table.components.values()), table.values, rtol=1e-6, atol=1e-9)


def test_wavelengths_are_channels(run):
    result = run("tabulate", "--model", "smith", *SMALL, "--wavelengths", "450,550.5", "--dtype", "float64")
    assert result.exit_code == 0, result.stderr
    table = brdftab.read("smith.exr")
    assert table.channels == ("450nm", "550.5nm")
    assert table.dtype == np.float64
    value = brdftab.evaluate("smith", table.theta_i[0], table.theta_o[1], table.phi[2], wavelengths=[450.0, 550.5])
    assert np.allclose(table.values[0, 1, 2], value, rtol=1e-3)


def test_own_index_is_one_channel(run):
    assert run("tabulate", "--model", "cook-torrance", *SMALL, "--eta", 0.2, "--k", 3.0).exit_code == 0
    assert brdftab.read("cook-torrance.exr").channels == ("Y",)


def test_angles_are_degrees(run):
    words = ("--theta-i", "10,30,60", "--theta-o", "0:80:5", "--phi", "0:180:3", "--cell", "point")
    result = run("tabulate", "--model", "oren-nayar", "--sigma", 30, *words)
    assert result.exit_code == 0, result.stderr
    table = brdftab.read("oren-nayar.exr")
    assert np.allclose(np.degrees(table.theta_i), [10, 30, 60])
    assert np.allclose(np.degrees(table.theta_o), [0, 20, 40, 60, 80])
    value = brdftab.evaluate("oren-nayar", np.radians(30), np.radians(20), np.radians(90), sigma=np.radians(30))
    assert np.allclose(table.values[1, 1, 1], value, rtol=1e-6)


def test_axes_left_out_have_the_documented_default(run):
    assert run("tabulate", "--model", "lambert", "--theta-i", "0:80:5").exit_code == 0
    table = brdftab.read("lambert.exr")
    assert table.grid.shape == (5, 5, 180)
    assert np.allclose(np.degrees(table.phi[[0, -1]]), [0.5, 179.5])


def test_anisotropic_table_has_four_axes(run):
    words = ("--alpha-x", 0.3, "--alpha-y", 0.6, "--grid", "2x3x2x3")
    result = run("tabulate", "--model", "smith", *words, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["axes"] == ["theta_i", "phi_i", "theta_o", "phi_o"]
    values = brdftab.read("smith.exr").values
    assert np.array_equal(values, values.transpose(2, 3, 0, 1, 4))


def test_unmet_tolerance_is_told(run):
    result = run("tabulate", "--model", "smith", *SMALL, "--tolerance", 1e-9)
    assert result.exit_code == 0
    assert "exceeds tolerance 1e-09" in result.stderr
    assert "float64" in result.stderr
    assert (
        run("tabulate", "--model", "smith", *SMALL, "--tolerance", 1e-9, "--dtype", "float64", "--overwrite").stderr
        == ""
    )


def test_threads_change_nothing(run):
    for threads in (1, 2):
        if threads <= (os.cpu_count() or 1):
            words = ("--threads", threads, "--out", f"{threads}.npz", "--dtype", "float64")
            assert run("tabulate", "--model", "vgroove-sym", *SMALL, *words).exit_code == 0
    if os.path.exists("2.npz"):
        assert brdftab.read("1.npz").values.tobytes() == brdftab.read("2.npz").values.tobytes()


# ---------------------------------------------------------------- eval, models


def test_eval_text(run):
    result = run("eval", "--model", "vgroove-sym", "--theta-i", 30, "--theta-o", 40, "--phi", 170, "--components")
    assert result.exit_code == 0
    assert re.search(r"^order2 +\S+ +\S+ +\S+$", result.stdout, re.M)
    assert "estimated relative error" in result.stdout


def test_eval_of_spectral_channels(run):
    result = run(
        "eval", "--model", "smith", "--wavelengths", "450,650", "--theta-i", 30, "--theta-o", 40, "--phi", 170, "--json"
    )
    found = json.loads(result.stdout)
    assert found["channels"] == ["450nm", "650nm"]
    assert found["components"] is None
    assert found["parameters"]["wavelengths"] == [450.0, 650.0]
    # gold is red
    assert found["value"][1] > 2.0 * found["value"][0] > 0.0


def test_models_lists_and_describes(run):
    listed = run("models")
    assert [line.split()[0] for line in listed.stdout.splitlines()] == models.names()
    found = json.loads(run("models", "--json").stdout)
    assert [model["name"] for model in found] == models.names()
    one = json.loads(run("models", "oren-nayar", "--json").stdout)
    sigma = next(p for p in one["params"] if p["name"] == "sigma")
    assert (sigma["unit"], sigma["bounds"]) == ("degrees", [0.0, 90.0])
    text = run("models", "vgroove-nonsym").stdout
    for word in ("errata", "doi", "10.1145/3272127.3275016", "--alpha", "Cu2O", "default 0.5"):
        assert word in text


# ---------------------------------------------------------------- refusals


def table_of(model, *words):
    return ("tabulate", "--model", model, *SMALL, *words)


def point_of(model, *words):
    return ("eval", "--model", model, "--theta-i", "30", "--theta-o", "40", "--phi", "120", *words)


# what is wrong -> the command and the words that its one line must hold
REFUSED = {
    "unknown model": (table_of("nope"), ("model = nope", "vgroove-sym")),
    "foreign parameter": (table_of("lambert", "--alpha", "0.5"), ("alpha", "kd")),
    "alpha 0": (table_of("smith", "--alpha", "0"), ("alpha = 0", "[0.0001, 10]")),
    "alpha nan": (table_of("smith", "--alpha", "nan"), ("alpha = nan", "[0.0001, 10]")),
    "alpha infinite": (table_of("smith", "--alpha", "inf"), ("alpha = inf",)),
    "anisotropic Phong": (
        table_of("smith", "--ndf", "phong", "--alpha-x", ".3", "--alpha-y", ".5"),
        ("isotropic", "alpha"),
    ),
    "Phong too rough": (table_of("vgroove-nonsym", "--ndf", "phong", "--alpha", "1.5"), ("alpha = 1.5", "sqrt 2")),
    "point at the mirror": (
        ("tabulate", "--model", "vgroove-sym", "--theta-i", "10,30", "--phi", "0,180", "--cell", "point"),
        ("cell = point", "mirror", "average"),
    ),
    "value at the mirror": (point_of("vgroove-sym", "--theta-o", "30", "--phi", "180"), ("mirror", "max_bounces")),
    "grid of two axes": (table_of("lambert", "--grid", "3x3"), ("grid = '3x3'", "90x90x180")),
    "grid of letters": (table_of("lambert", "--grid", "axbxc"), ("grid = 'axbxc'",)),
    "grid of nothing": (table_of("lambert", "--grid", "0x3x3"), ("at least 1",)),
    "huge grid": (table_of("lambert", "--grid", "100000x100000x100000"), ("2**31",)),
    "grid without a grain": (table_of("ashikhmin-shirley"), ("direction of its own", "four axes", "15x24x15x24")),
    "isotropic grid": (table_of("smith", "--alpha-x", ".3", "--alpha-y", ".5"), ("four axes", "15x24x15x24")),
    "missing folder": (table_of("lambert", "--out", "nodir/x.exr"), ("nodir", "does not exist")),
    "unknown ending": (table_of("lambert", "--out", "x.png"), ("x.png", ".exr or .npz")),
    "output twice": (table_of("lambert", "--out", "x.exr", "--out", "x.exr"), ("x.exr", "twice")),
    "unknown metal": (table_of("smith", "--material", "Mithril"), ("material = Mithril", "Cu2O")),
    "eta alone": (table_of("smith", "--eta", "1.5"), ("eta", "k")),
    "k alone": (table_of("smith", "--k", "1.5"), ("k", "eta")),
    "two reflectances": (table_of("smith", "--material", "Au", "--ior", "1.5"), ("material", "ior")),
    "f0 above 1": (table_of("smith", "--f0", "1.5"), ("f0 = 1.5", "[0, 1]")),
    "two channels": (table_of("smith", "--f0", "0.1,0.2"), ("f0", "2 values")),
    "two roughnesses": (table_of("smith", "--alpha", ".3", "--alpha-x", ".3", "--alpha-y", ".3"), ("alpha", "exclude")),
    "half a roughness": (table_of("smith", "--alpha-x", ".3"), ("alpha_x", "alpha_y")),
    "exponent without Phong": (table_of("smith", "--exponent", "5"), ("exponent = 5", "phong")),
    "no threads": (table_of("lambert", "--threads", "0"), ("threads = 0",)),
    "too many threads": (table_of("lambert", "--threads", "100000"), ("threads = 100000",)),
    "tolerance 2": (table_of("lambert", "--tolerance", "2"), ("tolerance = 2", "0.5")),
    "tolerance nan": (table_of("lambert", "--tolerance", "nan"), ("tolerance = nan",)),
    "albedo above 1": (table_of("lambert", "--kd", "1.5"), ("kd = 1.5", "[0, 1]")),
    "tilt above 90": (table_of("oren-nayar", "--sigma", "100"), ("sigma = 100 degrees", "[0, 90] degrees")),
    "unknown variant": (table_of("oren-nayar", "--variant", "x"), ("variant = x", "qualitative")),
    "unknown masking": (table_of("smith", "--masking", "none"), ("masking = none", "separable")),
    "no bounces": (table_of("vgroove-sym", "--max-bounces", "0"), ("max_bounces = 0",)),
    "bounces of one": (table_of("smith", "--max-bounces", "3"), ("max_bounces",)),
    "wavelength unknown": (
        table_of("smith", "--material", "Cu2O", "--wavelengths", "1500"),
        ("1500", "Cu2O", "899.71"),
    ),
    "wavelengths unsorted": (table_of("smith", "--wavelengths", "550,450"), ("wavelengths = 550,450", "increasing")),
    "too few wavelengths": (table_of("smith", "--spectral-samples", "2"), ("samples = 2",)),
    "wavelengths of glass": (table_of("smith", "--ior", "1.5", "--wavelengths", "500"), ("wavelengths",)),
    "axes without theta_i": (("tabulate", "--model", "lambert", "--theta-o", "0:80:9"), ("theta_o", "theta_i")),
    "axis out of range": (("tabulate", "--model", "lambert", "--theta-i", "0:195:9"), ("theta_i = 195", "[0, 180]")),
    "axis unsorted": (("tabulate", "--model", "lambert", "--theta-i", "5,4"), ("theta_i",)),
    "axis of letters": (("tabulate", "--model", "lambert", "--theta-i", "x"), ("theta_i = 'x'", "start:stop:count")),
    "axes and grid": (table_of("lambert", "--theta-i", "10"), ("grid", "theta_i", "exclude")),
    "one azimuth of two": (("tabulate", "--model", "lambert", "--theta-i", "10", "--phi-i", "0"), ("phi_i", "phi_o")),
    "theta_i below 0": (point_of("lambert", "--theta-i", "-5"), ("theta_i = -5 degrees",)),
    "phi nan": (point_of("lambert", "--phi", "nan"), ("phi = nan",)),
    "unknown model named": (("models", "nope"), ("model = nope",)),
    "no such file": (("info", "nofile.exr"), ("nofile.exr", "check the path")),
    "nothing to compare": (("compare", "a.exr", "b.exr"), ("a.exr",)),
    "nothing to verify": (("verify", "nofile.npz"), ("nofile.npz",)),
}


@pytest.mark.parametrize("why", REFUSED)
def test_refusal_is_one_line(run, tmp_path, why):
    command, words = REFUSED[why]
    result = run(*command)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = [x for x in result.stderr.splitlines() if not x.startswith("brdftab: compiling")]
    assert len(lines) == 1
    assert len(lines[0]) < 250
    for word in words:
        assert word in lines[0]
    assert isinstance(result.exception, SystemExit)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "word"),
    [
        (("nope",), "nope"), (("tabulate",), "--model"), (table_of("smith", "--alpha", "abc"), "abc"),
        (table_of("smith", "--eta", "1,x"), "1,x"), (table_of("smith", "--cell", "x"), "center"),
        (table_of("smith", "--dtype", "float16"), "float64"), (table_of("smith", "--nonsense"), "--nonsense"),
        (("eval", "--model", "lambert"), "--theta-i"), (("verify",), "FILE"), (("compare", "a.exr"), "B"),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, tuple) else x,
)  # fmt: skip
def test_usage_errors_end_in_one_line(run, command, word):
    result = run(*command)
    assert result.exit_code == 2
    assert result.stdout == ""
    *usage, last = result.stderr.strip().splitlines()
    assert last.startswith("Error: ")
    assert word in last
    assert len(usage) <= 3


# ---------------------------------------------------------------- files: info, compare, verify


@pytest.mark.parametrize("ending", ["exr", "npz"])
def test_table_tells_compares_and_repeats(run, ending):
    name = f"t.{ending}"
    assert run("tabulate", "--model", "vgroove-sym", *SMALL, "--out", name).exit_code == 0
    facts = json.loads(run("info", name, "--json").stdout)
    assert facts["model"] == "vgroove-sym"
    assert facts["provenance"]["citation"].startswith("Lee")
    assert facts["values"]["negative"] == 0
    assert run("compare", name, name).exit_code == 0
    result = run("verify", name)
    assert result.exit_code == 0, result.output
    assert "repeats in all 108 cells" in result.stdout or "repeats in all 36 cells" in result.stdout
    assert run("tabulate", "--model", "vgroove-sym", *SMALL, "--alpha", 0.51, "--out", "other.npz").exit_code == 0
    differs = run("compare", name, "other.npz")
    assert differs.exit_code == 1
    assert "worst cell" in differs.stdout


def test_tampered_table_does_not_verify(run):
    assert run("tabulate", "--model", "lambert", *SMALL, "--out", "t.npz").exit_code == 0
    with np.load("t.npz") as archive:
        parts = dict(archive)
    parts["values"] = parts["values"].copy()
    parts["values"][1, 2, 3] *= 1.001
    np.savez("t.npz", **parts)
    result = run("verify", "t.npz")
    assert result.exit_code == 1, result.output
    assert "differ" in result.stdout
    assert "theta_i 45" in result.stdout


def test_parameters_in_a_file_are_checked(run):
    assert run("tabulate", "--model", "lambert", *SMALL, "--out", "t.npz").exit_code == 0
    with np.load("t.npz") as archive:
        parts = dict(archive)
    text = str(parts["metadata"])
    for old, new, word in (('"kd":', '"kb":', "kb"), ('"lambert"', '"nothing"', "nothing")):
        assert old in text.replace('": ', '":')
        spoilt = text.replace(old, new).replace(old.replace(":", ": "), new.replace(":", ": "))
        np.savez("spoilt.npz", **{**parts, "metadata": np.array(spoilt)})
        result = run("verify", "spoilt.npz")
        assert result.exit_code == 2, result.output
        assert word in result.stderr
        assert len(result.stderr.splitlines()) == 1


# ---------------------------------------------------------------- as a process


def test_streams_of_a_process(tmp_path):
    done = shell("tabulate", "--model", "vgroove-sym", *SMALL, "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert json.loads(done.stdout)["model"] == "vgroove-sym"
    assert [x for x in done.stderr.splitlines() if not x.startswith("brdftab: compil")] == []


def test_first_run_says_that_it_compiles(tmp_path):
    fresh = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    words = ("eval", "--model", "oren-nayar", "--theta-i", 10, "--theta-o", 20, "--phi", 30)
    first, second = (shell(*words, cwd=tmp_path, env=fresh) for _ in range(2))
    assert first.returncode == second.returncode == 0, first.stderr
    assert first.stderr.startswith("brdftab: compiling kernels for oren-nayar")
    assert second.stderr == ""


def test_reader_that_goes_away(tmp_path):
    command = [sys.executable, "-c", "from brdftab.cli import main; main()", "models", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as process:
        process.stdout.close()
        stderr = process.stderr.read().decode()
    assert "Traceback" not in stderr


def test_interruption_leaves_no_file_and_no_traceback(tmp_path):
    words = ["tabulate", "--model", "vgroove-nonsym", "--grid", "200x200x400", "--tolerance", "1e-9", "--json"]
    command = [sys.executable, "-c", "from brdftab.cli import main; main()", *words]
    # a parent may have set SIGINT to be ignored, as shells do for background jobs
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:  # fmt: skip
        time.sleep(6.0)
        assert process.poll() is None, "the table was done before it could be interrupted"
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=120)
    assert process.returncode != 0
    assert stdout == ""
    assert "Traceback" not in stderr
    assert len([x for x in stderr.strip().splitlines() if not x.startswith("brdftab: ")]) <= 1
    assert not list(tmp_path.iterdir())


# ---------------------------------------------------------------- help


def commands(group=main, words=()):
    """Return every command with the words that name it; groups stand beside their own commands."""
    context = click.Context(group)
    found = {}
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        found[(*words, name)] = command
        if isinstance(command, click.Group):
            found |= commands(command, (*words, name))
    return found


def test_every_command_has_help_with_an_example(run):
    found = commands()
    assert {("tabulate",), ("eval",), ("models",), ("info",), ("compare",), ("verify",), ("scratch", "maps")} <= set(
        found
    )
    for words, command in found.items():
        text = run(*words, "--help").stdout
        assert re.search(r"Examples?:\n +brdftab " + " ".join(words), text), words
        assert command.help
        for param in command.params:
            if isinstance(param, click.Option):
                assert param.help, f"{words} {param.name}"
        assert isinstance(command, click.Group) or any(param.name == "as_json" for param in command.params), words


def test_examples_of_the_help_parse(run):
    for words, command in commands().items():
        examples = [x.strip() for x in command.epilog.splitlines() if x.strip().startswith("brdftab ")]
        assert examples
        for example in examples:
            given = example.split()[1 + len(words) :]
            if not isinstance(command, click.Group):
                command.make_context(words[-1], given)
