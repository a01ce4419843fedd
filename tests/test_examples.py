"""The examples run and reach what their READMEs state."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
MERL_LIKE = EXAMPLES / "merl_like" / "make_and_fit.py"


def run(*options):
    return subprocess.run([sys.executable, MERL_LIKE, *options], capture_output=True, text=True, env=os.environ)


def test_merl_like_files_are_recovered():
    done = run("--directions", "4000")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "4 of 4 files recovered" in done.stdout
    assert "FAR" not in done.stdout
    # each fit prints five parameters with their errors
    assert len(re.findall(r"^  (?:kd|ior|sigma) .*\+- ", done.stdout, re.M)) == 20
    # the option is obeyed, and cells are lost
    counts = [int(n.replace(",", "")) for n in re.findall(r"binary: ([\d,]+) directions", done.stdout)]
    assert len(counts) == 4
    assert all(3800 < n < 4000 for n in counts)
    shares = [float(s) for s in re.findall(r"([\d.]+) % clipped", done.stdout)]
    assert shares[:2] == [0.0, 0.0]
    assert all(s > 10.0 for s in shares[2:])


@pytest.mark.parametrize("count", ["0", "999"])
def test_merl_like_refuses_too_few_directions(count):
    done = run("--directions", count)
    assert done.returncode == 2
    assert "at least 1000" in done.stderr


def test_every_example_has_a_readme_that_states_its_numbers():
    folders = [p for p in EXAMPLES.iterdir() if p.is_dir() and list(p.glob("*.py"))]
    assert folders
    for folder in folders:
        text = (folder / "README.md").read_text()
        for script in folder.glob("*.py"):
            assert script.name in text, folder
        assert "4 of 4 files recovered" in text
