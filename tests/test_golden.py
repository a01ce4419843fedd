"""The golden tables repeat from their own provenance, and each says where it is from."""

import json
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

import brdftab
from brdftab import models
from brdftab.cli import main

HERE = Path(__file__).parent / "golden"
SOURCES = json.loads((HERE / "SOURCES.json").read_text())
TABLES = sorted(p for p in HERE.iterdir() if p.suffix in {".exr", ".npz"})


def test_every_table_has_its_source():
    assert [p.name for p in TABLES] == sorted(SOURCES)
    for name, entry in SOURCES.items():
        assert entry.keys() == {"command", "generator", "tool", "with", "date"}, name
        words = shlex.split(entry["command"])
        assert words[:2] == ["brdftab", "tabulate"]
        assert words[-1] == name


def test_tables_are_small_and_cover_the_registry():
    assert all(p.stat().st_size < 60_000 for p in TABLES), [(p.name, p.stat().st_size) for p in TABLES]
    tables = [brdftab.read(p) for p in TABLES]
    assert {t.provenance["model"] for t in tables} == set(models.names())
    assert {t.grid.cell for t in tables} == {"center", "average", "point"}
    assert {t.dtype.name for t in tables} == {"float32", "float64"}
    assert {t.grid.isotropic for t in tables} == {True, False}
    for spec in brdftab.models():
        mine = [(p, t) for p, t in zip(TABLES, tables, strict=True) if t.provenance["model"] == spec.name]
        assert {p.suffix for p, _ in mine} == {".exr", ".npz"}, spec.name
        if spec.ndfs:
            assert len({t.provenance["parameters"]["ndf"] for _, t in mine}) >= min(2, len(spec.ndfs)), spec.name


@pytest.mark.parametrize("path", TABLES, ids=lambda p: p.name)
def test_table_repeats(path):
    result = CliRunner().invoke(main, ["verify", str(path)])
    assert result.exit_code == 0, result.output
    assert "repeats" in result.stdout
