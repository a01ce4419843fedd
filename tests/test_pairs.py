"""Pairs of commands in a row: what one writes, each other that takes a file reads, or says in one line why not."""

import re
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab.cli import main
from brdftab.io.merl import write_merl
from brdftab.io.own import KINDS

GOLDEN = Path(__file__).parent / "golden"
SCENE = """
[scene]
theta_i = [0, 75]
theta_o = [0, 60]
tolerance = 1e-2
grid = "6x6x12"

[[material]]
name = "paper"
model = "oren-nayar"

[[material]]
name = "cloth"
model = "lambert"
quantity = "albedo"
"""
LAYERS = """
[base]
model = "lambert"

[[layer]]
profile = "v:30"
area = 0.05
width = 0.05
length = 0.2
"""
TABLE, NO_TABLE = "table", "no table"

# file: what it is
FILES = {
    "table.npz": TABLE,
    "table.exr": TABLE,
    "planned.exr": TABLE,
    "predicted.npz": TABLE,
    "sum.npz": "sum",
    "blurred.npz": "anisotropic",
    "measured.binary": "measurement",
    "albedo.npz": NO_TABLE,
    "albedo.exr": NO_TABLE,
    "planned-albedo.exr": NO_TABLE,
    "fit.json": NO_TABLE,
    "native.npz": NO_TABLE,
    "native.exr": NO_TABLE,
    "triplet.npz": NO_TABLE,
    "triplet.exr": NO_TABLE,
    "dense.npz": NO_TABLE,
    "dense.exr": NO_TABLE,
    "maps.exr": NO_TABLE,
    "points.npz": NO_TABLE,
    "layers.toml": NO_TABLE,
    "scene.toml": NO_TABLE,
    "cut.npz": NO_TABLE,
    "by-hand.csv": NO_TABLE,
}
READERS = ("info", "compare", "verify", "fit", "plan")
# arguments of these are no files of this tool's making, or have tests of their own
OTHERS = {
    "golden check",
    "golden record",
    "scratch eval",
    "scratch maps",
    "scratch picture",
    "scratch profile",
    "models",
    "cache",
}


def call(*words):
    return CliRunner().invoke(main, [str(w) for w in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    here = tmp_path_factory.mktemp("pairs")

    def made(*words):
        done = call(*words)
        assert done.exit_code == 0, (words, done.stderr)

    for name in ("table.npz", "table.exr"):
        made("tabulate", "--model", "oren-nayar", "--grid", "6x6x12", "--out", here / name)
    (here / "scene.toml").write_text(SCENE)
    (here / "layers.toml").write_text(LAYERS)
    made("tabulate", "--scene", here / "scene.toml", "--out", here / "planned")
    (here / "planned" / "paper.exr").rename(here / "planned.exr")
    (next((here / "planned").glob("cloth.*"))).rename(here / "planned-albedo.exr")
    fit = ("fit", here / "table.npz", "--samples", 300, "--grid", "4x4x8", "--predict")
    made(*fit, here / "predicted.npz", "--model", "lambert", "--out", here / "fit.json")
    made(*fit, here / "sum.npz", "--model", "lambert+oren-nayar")
    made("albedo", "--model", "lambert", "--cosines", 4, "--out", here / "albedo.npz", "--out", here / "albedo.exr")
    for form in ("native", "triplet", "dense"):
        made(
            "tabulate",
            "--model",
            "scratch",
            "--form",
            form,
            "--out",
            here / f"{form}.npz",
            "--out",
            here / f"{form}.exr",
        )
    made("tabulate", "--model", "scratch", "--form", "blurred", "--grid", "3x4x3x4", "--out", here / "blurred.npz")
    made("scratch", "maps", here / "layers.toml", "--size", 32, "--out", here / "maps.exr")
    write_merl(brdftab.tabulate("lambert", "6x6x12", kd=[0.5, 0.4, 0.3]), here / "measured.binary")
    (here / "points.npz").write_bytes((GOLDEN / "lambert.points.npz").read_bytes())
    (here / "cut.npz").write_bytes((here / "table.npz").read_bytes()[:400])
    (here / "by-hand.csv").write_text("theta_i,theta_o,phi,f\n10,20,180,0.3\n")
    return here


def one_line(done, name):
    """Return the one line that a command ends with; it names the file and holds no false advice."""
    assert done.exit_code == 2, done.output
    assert isinstance(done.exception, SystemExit)
    told = done.stderr.strip()
    assert len(told.splitlines()) == 1
    assert name in told
    return told


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("reader", READERS)
def test_every_pair_has_an_answer(folder, reader, name):
    kind, file = FILES[name], folder / name
    words = {"compare": [file, file], "fit": [file, "--model", "lambert", "--samples", 300]}.get(reader, [file])
    done = call(reader, *words)
    if reader == "plan":
        if name == "scene.toml":
            assert done.exit_code == 0, done.stderr
            assert "paper" in done.stdout
            return
        told = one_line(done, name)
        assert "TOML" in told or "is no key" in told or "[scene]" in told or "material" in told, told
        return
    if kind == NO_TABLE:
        # several files may be verified: each has a line of its own
        told = one_line(done, name) if reader != "verify" else (done.stderr + done.stdout).strip()
        assert done.exit_code == 2
        assert "Traceback" not in told
        if name not in ("layers.toml", "scene.toml", "cut.npz", "by-hand.csv"):
            assert "holds no table of values but " in told
            assert "write it again" not in told
        return
    refused = {
        ("verify", "sum"): "sum that a fit predicted",
        ("verify", "measurement"): "holds a measurement",
        ("compare", "measurement"): "holds a measurement",
        ("fit", "anisotropic"): "isotropic tables",
    }.get((reader, kind))
    if refused:
        assert done.exit_code == 2
        told = (done.stderr + done.stdout).strip()
        assert refused in told
        # a fit reads one file alone
        assert name in told or reader == "fit"
        return
    assert done.exit_code == 0, (done.stderr, done.stdout)
    if reader == "compare":
        assert done.stdout.startswith("equal: 0 of ")
    if reader == "fit" and kind == "measurement":
        assert np.allclose(
            [float(x) for x in re.findall(r"[RGB] ([\d.]+)", done.stdout)][:3], [0.5, 0.4, 0.3], rtol=1e-3
        )


def test_every_reader_of_files_is_walked():
    """A command whose arguments are files is one of the readers above, or named beside them."""

    def commands(group, path=()):
        for name in group.list_commands(click.Context(group)):
            command = group.get_command(click.Context(group), name)
            if isinstance(command, click.Group):
                yield from commands(command, (*path, name))
            elif any(isinstance(p, click.Argument) for p in command.params):
                yield " ".join((*path, name))

    assert set(commands(main)) == set(READERS) | OTHERS & set(commands(main))


def test_every_format_of_this_tool_is_known():
    source = "".join(p.read_text() for p in (Path(brdftab.__file__).parent).rglob("*.py"))
    said = set(re.findall(r'"(brdftab-[a-z-]+)"', source)) - {"brdftab-table"}
    assert said <= set(KINDS), said - set(KINDS)
