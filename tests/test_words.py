"""Mistyped words get the nearest proposed, and files may have any name."""

import os
import subprocess
import sys

import pytest
from click.testing import CliRunner

from brdftab import tabulate
from brdftab.cli import main
from brdftab.errors import ParameterError

AT = ["--theta-i", "1", "--theta-o", "1", "--phi", "0"]
BRDFTAB = [sys.executable, "-c", "from brdftab.cli import main; main()"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["tabluate"], "Did you mean tabulate?"),
        (["golden", "rekord"], "Did you mean record?"),
        (["eval", "--model", "vgrove-sym", *AT], "did you mean vgroove-sym?"),
        (["eval", "--model", "smith", "--material", "Gold", *AT], "did you mean Au?"),
        (["eval", "--model", "smith", "--ndf", "gxx", *AT], "did you mean ggx?"),
        (["tabulate", "--model", "smith", "--cell", "centre"], "Did you mean center?"),
        (["check", "--model", "smith", "--property", "energie"], "did you mean energy?"),
    ],
)  # fmt: skip
def test_the_nearest_word_is_proposed(words, told):
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 2
    assert told in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_nearest_parameter_is_proposed_in_python():
    with pytest.raises(ParameterError, match=r"alhpa is not a parameter of smith; did you mean alpha\? It takes"):
        tabulate("smith", alhpa=0.3)


@pytest.mark.parametrize("name", ["a ü.exr", "ü.npz", "名.exr"])
def test_names_that_the_locale_lacks(tmp_path, name):
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    path = str(tmp_path / name)
    for words in (["tabulate", "--model", "lambert", "--grid", "2x2x2", "--out", path], ["info", path]):
        done = subprocess.run([*BRDFTAB, *words], capture_output=True, env=environment)
        assert done.returncode == 0, done.stderr
    assert os.listdir(tmp_path) == [name]


def test_every_reader_takes_names_that_the_locale_lacks(tmp_path):
    """What reads a table, a folder of golden files or a list of materials opens it, and says its name."""
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    table, folder, scene = (str(tmp_path / name) for name in ("é ü.npz", "golden ü", "scène.toml"))
    os.mkdir(folder)
    with open(scene, "w", encoding="utf-8") as file:
        file.write('[[material]]\nname = "u"\nmodel = "lambert"\ngrid = "2x2x2"\n')
    runs = [
        ["tabulate", "--model", "lambert", "--grid", "6x6x8", "--out", table],
        ["tabulate", "--model", "lambert", "--grid", "2x2x2", "--out", os.path.join(folder, "lambert.npz")],
        ["compare", table, table],
        ["verify", table],
        ["fit", table, "--model", "lambert", "--out", str(tmp_path / "ü.json")],
        ["golden", "check", folder],
        ["plan", scene],
    ]
    for words in runs:
        done = subprocess.run([*BRDFTAB, *words], capture_output=True, env=environment)
        told = (done.stdout + done.stderr).decode("utf-8", "replace")
        assert "Traceback" not in told, words
        assert "damaged" not in told, words
        assert done.returncode == 0 or words[0] == "golden", told


@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes")
def test_names_that_are_no_text(tmp_path):
    path = os.fsencode(tmp_path) + b"/\xfc.npz"
    for words in ([b"tabulate", b"--model", b"lambert", b"--grid", b"2x2x2", b"--out", path], [b"info", path]):
        done = subprocess.run([*BRDFTAB, *words], capture_output=True)
        assert done.returncode == 0, done.stderr
    # the library that reads EXR takes UTF-8 alone
    path = path[:-3] + b"exr"
    subprocess.run([*BRDFTAB, b"tabulate", b"--model", b"lambert", b"--grid", b"2x2x2", b"--out", path], check=True)
    done = subprocess.run([*BRDFTAB, b"info", path], capture_output=True)
    assert done.returncode == 2
    assert b"UTF-8" in done.stderr
    assert b"damaged" not in done.stderr
    assert b"Traceback" not in done.stderr
