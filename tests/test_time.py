"""Run times are those of the work: compilation apart, blocks short, interruptions answered, words mended."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from click.testing import CliRunner

from brdftab import models, tabulate
from brdftab.cli import main
from brdftab.engine import Engine
from brdftab.errors import ParameterError
from brdftab.evaluation import is_stochastic
from brdftab.models.setup import resolve
from brdftab.pace import FIRST, LIMIT, MOST, Pace
from brdftab.timing import Clock

AT = ["--theta-i", "1", "--theta-o", "1", "--phi", "0"]
BRDFTAB = [sys.executable, "-c", "from brdftab.cli import main; main()"]


def test_the_clock_stands_still_while_numba_compiles():
    import numba

    clock = Clock()
    slow = numba.njit(lambda x: np.sort(x).sum())
    slow(np.ones(3))
    assert clock.compiling > 0.5 * clock.wall > 0.0
    assert clock.seconds + clock.compiling == pytest.approx(clock.wall, abs=1e-3)
    before = clock.compiling
    slow(np.ones(3))
    assert clock.compiling == before


def test_kernel_time_is_without_compilation(tmp_path):
    """A process that compiles everything states the times of one that finds all compiled."""
    code = (
        "import json; from brdftab import tabulate\n"
        "made = [tabulate('smith', '16x16x32', alpha_x=0.2, alpha_y=0.2).provenance for _ in range(2)]\n"
        "print(json.dumps([[m['kernel_time_s'], m['compile_time_s'], m['total_time_s']] for m in made]))"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    (kernel, compiled, total), (again, rest, _) = json.loads(done.stdout)
    # seconds of compilation against milliseconds of work: were a tenth of them counted, this would fail
    assert compiled > 20.0 * kernel
    assert compiled > total
    assert rest < 0.05 * compiled
    assert kernel < again + 0.1 * compiled


def direct_settings():
    for name in models.names():
        variants = [{}]
        spec = models.spec(name)
        if spec.ndfs and spec.has(f"{spec.roughness}_x"):
            variants.append({f"{spec.roughness}_x": 0.2, f"{spec.roughness}_y": 0.5})
        for given in variants:
            if not is_stochastic(resolve(name, **given)):
                yield pytest.param(name, given, id=f"{name}{'-4d' if given else ''}")


@pytest.mark.parametrize(("name", "given"), list(direct_settings()))
def test_blocks_of_any_size_give_the_same_bits(name, given):
    rng = np.random.default_rng(5)
    angles = [rng.uniform(0.0, high, 300) for high in (1.5, 1.5, 2.0 * np.pi, 1.0)]
    found = []
    for size in (7, 300):
        engine = Engine(resolve(name, **given), 1e-3)
        engine._pace.size = engine._pace.size if engine._pace.steady else size
        engine._pace.measure = lambda *_: None
        found.append(engine.points(*angles))
        assert engine.evaluated == 300
    assert np.array_equal(*found)


@pytest.mark.parametrize(("fixed", "rate"), [(0.0, 1e-7), (1e-4, 1e-5), (1e-3, 1e-2), (0.2, 3e-5), (0.0, 1.0)])
def test_blocks_grow_to_the_time_that_they_may_take(fixed, rate):
    pace = Pace()
    seen = []
    for _ in range(40):
        seen.append(fixed + rate * pace.size)
        pace.measure(pace.size, seen[-1])
    allowed = max(LIMIT, 4.0 * fixed) + rate
    assert seen[-1] <= 1.01 * allowed
    assert pace.size == MOST or seen[-1] > 0.5 * allowed
    # no block on the way took much longer than it may, but the first, which nothing is known about
    assert max(seen[1:]) <= max(2.0 * allowed, seen[0])
    assert seen[0] == fixed + rate * FIRST


def test_blocks_cover_all():
    pace = Pace()
    covered = np.concatenate([np.arange(5000)[block] for block in pace.blocks(5000)])
    assert np.array_equal(covered, np.arange(5000))


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("given", [["--alpha-x", ".2", "--alpha-y", ".5"], ["--cell", "average"]])
def test_ctrl_c_is_answered_at_once(tmp_path, given):
    tabulate("vgroove-sym", "4x4x8", alpha_x=0.2, alpha_y=0.2)
    words = ["tabulate", "--model", "vgroove-nonsym", *given, "--tolerance", "1e-6", "--out", str(tmp_path / "a.exr")]
    run = subprocess.Popen([*BRDFTAB, *words], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    # past the imports, in the middle of compiling or evaluating
    time.sleep(8.0)
    assert run.poll() is None
    run.send_signal(signal.SIGINT)
    # a second is the aim; machines under load take longer
    _, told = run.communicate(timeout=20.0)
    assert run.returncode == 130
    assert told.strip().endswith("Aborted")
    assert "Traceback" not in told
    assert os.listdir(tmp_path) == []


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
