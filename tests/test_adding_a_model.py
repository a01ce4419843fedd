"""docs/adding-a-model.md, step by step: the page's package works beside the models of brdftab."""

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import brdftab
from brdftab.errors import ParameterError

PAGE = Path(__file__).resolve().parents[1] / "docs" / "adding-a-model.md"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder in which the page's package is installed."""
    place = tmp_path_factory.mktemp("site")
    text = PAGE.read_text()
    files = re.findall(r"^```(?:python|toml)\n# (\S+)\n(.*?)^```", text, re.S | re.M)
    assert len(files) == 6
    for name, body in files:
        path = place / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(body)
    # what pip makes of pyproject.toml, without a network
    declared = tomllib.loads((place / "pyproject.toml").read_text())["project"]
    info = place / f"{declared['name'].replace('-', '_')}-{declared['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {declared['name']}\nVersion: {declared['version']}\n")
    points = "".join(
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in found.items())
        for group, found in declared["entry-points"].items()
    )
    (info / "entry_points.txt").write_text(points)
    return place


def run(place, *words, status=0):
    # an edit within a second and of the same size leaves stale byte code
    environment = {**os.environ, "PYTHONPATH": str(place), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "brdftab", *words], cwd=place, env=environment, capture_output=True, text=True
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done


def python(place, code):
    environment = {**os.environ, "PYTHONPATH": str(place)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=place, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout


def test_the_pages_commands_run(site):
    commands = re.search(r"^```bash\n(.*?)^```", PAGE.read_text(), re.S | re.M).group(1).splitlines()
    assert len(commands) == 6
    for line in commands:
        run(site, *shlex.split(line)[1:])
    assert "minnaert" in run(site, "models").stdout
    value = json.loads(
        run(
            site,
            *[
                "eval",
                "--model",
                "minnaert",
                "--kd",
                "0.4",
                "--k",
                "2",
                "--theta-i",
                "30",
                "--theta-o",
                "60",
                "--phi",
                "0",
                "--json",
            ],
        ).stdout
    )
    # kd/pi (sqrt(3)/2 / 2)^1
    assert value["value"][0] == pytest.approx(0.4 / 3.141592653589793 * 3**0.5 / 4.0, rel=1e-12)


def test_a_fit_recovers_a_parameter_called_k(site):
    run(
        site,
        *[
            "tabulate",
            "--model",
            "minnaert",
            "--kd",
            "0.4",
            "--k",
            "2",
            "--grid",
            "16x16x8",
            "--dtype",
            "float64",
            "--out",
            "m.npz",
            "--overwrite",
        ],
    )
    found = json.loads(run(site, *["fit", "m.npz", "--model", "minnaert", "--json"]).stdout)
    assert found["values"]["k"] == pytest.approx(2.0, rel=1e-6)
    assert found["values"]["kd"][0] == pytest.approx(0.4, rel=1e-6)
    assert found["warnings"] == []


def test_the_check_fails_when_a_bound_returns_too_much(site):
    spec = site / "brdftab_minnaert" / "__init__.py"
    text = spec.read_text()
    spec.write_text(text.replace("(1.0, 10.0)", "(0.5, 10.0)"))
    try:
        assert "energy" in run(site, *["check", "--model", "minnaert", "--fast"], status=1).stdout
    finally:
        spec.write_text(text)


def test_python_sees_it_and_samples_it(site):
    code = """
import numpy as np, brdftab
assert "minnaert" in [m.name for m in brdftab.list_models()]
draws = brdftab.sample("minnaert", 0.3, 20000, kd=0.4, k=2.0)
albedo = brdftab.albedo("minnaert", 0.3, kd=0.4, k=2.0)
# 2 kd/(k + 1) cos^(k - 1)
assert abs(albedo[0] - 0.8 / 3.0 * np.cos(0.3)) < 1e-10
assert abs(draws.weight.mean() - albedo[0]) < 0.01 * albedo[0]
"""
    python(site, code)


def test_what_cannot_be_imported_is_told_in_one_line(site, tmp_path):
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[brdftab.models]\nbroken = brdftab_broken\nlambert = brdftab_other\n")
    at = ["--theta-i", "0", "--theta-o", "0", "--phi", "0"]
    done = run(tmp_path, "eval", "--model", "broken", *at, status=2)
    assert "Warning: brdftab_broken, the package of model broken, is not there; left out" in done.stderr
    assert "model = broken is not known" in done.stderr
    assert "Traceback" not in done.stderr
    # a name of brdftab's own stays brdftab's
    done = run(tmp_path, "eval", "--model", "lambert", *at)
    assert "0.159" in done.stdout
    assert "Warning: brdftab_other names a model lambert, which brdftab has itself; left out" in done.stderr
    (tmp_path / "brdftab_broken").mkdir()
    (tmp_path / "brdftab_broken" / "__init__.py").write_text("import nothing_of_this_name")
    done = run(tmp_path, "eval", "--model", "lambert", *at, status=2)
    assert "model = broken: its package brdftab_broken cannot be imported" in done.stderr


def test_a_package_without_a_declaration_is_told_in_one_line(tmp_path):
    info, package = tmp_path / "empty-1.0.dist-info", tmp_path / "brdftab_empty"
    info.mkdir()
    package.mkdir()
    (package / "__init__.py").write_text("")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: empty\nVersion: 1.0\n")
    # who writes an object behind a colon, as for scripts, means the package
    (info / "entry_points.txt").write_text("[brdftab.models]\nempty = brdftab_empty:SPEC\n")
    done = run(tmp_path, "models", status=2)
    assert done.stderr == "Error: model = empty: its package brdftab_empty has no SPEC, a Model; declare one there\n"
    (package / "__init__.py").write_text("from brdftab.models.lambert import SPEC")
    done = run(tmp_path, "models", status=2)
    assert "its package brdftab_empty declares lambert; give both one name" in done.stderr


@pytest.mark.parametrize("name", [3, None, ["smith"]])
def test_what_is_no_name_is_not_known(name):
    with pytest.raises(ParameterError, match="is not known"):
        brdftab.sample(name, 0.1, 3)
