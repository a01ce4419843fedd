"""Kernels get blocks of less than half a second, whose sizes change no number, and Ctrl-C is answered meanwhile."""

import ctypes
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from brdftab import models, tabulate
from brdftab.commands.interrupt import answered
from brdftab.commands.progress import progress_bar
from brdftab.evaluation.engine import Engine
from brdftab.evaluation.pace import FIRST, LIMIT, MOST, Pace
from brdftab.evaluation.points import is_stochastic
from brdftab.models.resolve import resolve

BRDFTAB = [sys.executable, "-c", "from brdftab.cli import main; main()"]


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


@pytest.mark.parametrize(("name", "axes"), [("lambert", 3), ("oren-nayar", 3), ("ashikhmin-shirley", 4)])
def test_tables_of_cheap_models_come_to_long_blocks(name, axes):
    """Rows of 180 azimuths, and of the 96 views that the first lights of half a square lack, count as blocks."""
    engine = Engine(resolve(name), 1e-3)
    engine._pace.measure = lambda pairs, _: setattr(engine._pace, "size", min(4 * pairs, MOST))
    if axes == 3:
        theta = np.linspace(0.01, 1.5, 60)
        engine.fill(theta, theta, np.linspace(0.0, np.pi, 180), np.empty((1, 60, 60, 180, len(engine.setup.channels))))
    else:
        both = np.stack(np.meshgrid(np.linspace(0.01, 1.5, 16), np.linspace(0.0, 6.0, 12), indexing="ij"), -1)
        both = both.reshape(-1, 2)
        engine.fill_azimuths(both, both, np.empty((1, 192, 192, len(engine.setup.channels))))
    assert engine._pace.size > 16 * FIRST
    assert engine.evaluated >= 18000


def test_blocks_cover_all():
    pace = Pace()
    covered = np.concatenate([np.arange(5000)[block] for block in pace.blocks(5000)])
    assert np.array_equal(covered, np.arange(5000))


def test_the_time_that_is_left_is_that_of_this_attempt(monkeypatch, capsys):
    """A share that falls is a finer rule's, which starts anew: what earlier rules took says nothing of its pace."""

    class Stepped:
        now = 0.0

        def __init__(self):
            self.start = self.now

        @property
        def seconds(self):
            return Stepped.now - self.start

    monkeypatch.setattr("brdftab.timing.Clock", Stepped)
    with progress_bar("tabulating") as report:
        for Stepped.now, share in ((20.0, 0.5), (35.0, 0.99), (35.1, 0.01), (36.6, 0.02)):
            report(share)
    told = capsys.readouterr().err
    # 1.5 s for 2 %, at the first share of the new attempt's own clock
    assert told.startswith("brdftab: tabulating takes about 74 s more;")
    assert len(told.splitlines()) == 1


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("given", [["--alpha-x", ".2", "--alpha-y", ".5"], ["--cell", "average"]])
def test_ctrl_c_is_answered_at_once(tmp_path, given):
    tabulate("vgroove-sym", "4x4x8", alpha_x=0.2, alpha_y=0.2)
    words = ["tabulate", "--model", "vgroove-nonsym", *given, "--tolerance", "1e-6", "--out", str(tmp_path / "a.exr")]
    # what starts in the background of a shell inherits that it ignores interruptions
    heed = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    start = [BRDFTAB[0], BRDFTAB[1], heed + BRDFTAB[2], *words]
    run = subprocess.Popen(start, text=True, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        # past the imports, in the middle of compiling or evaluating
        time.sleep(8.0)
        assert run.poll() is None
        run.send_signal(signal.SIGINT)
        # a second is the aim; one function that is being compiled under load takes longer
        _, told = run.communicate(timeout=120.0)
    finally:
        run.kill()
    assert run.returncode == 130
    assert told.strip().endswith("Aborted")
    assert "Traceback" not in told
    assert os.listdir(tmp_path) == []


def test_interruptions_that_a_callback_swallows_are_not_printed(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda what: told.append(what.exc_type))

    def raising(error):
        def callback():
            raise error

        ctypes.CFUNCTYPE(None)(callback)()

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with answered():
            raising(KeyboardInterrupt)
            raising(ValueError("else"))
    finally:
        signal.signal(signal.SIGINT, before)
    raising(KeyboardInterrupt)
    assert told == [ValueError, KeyboardInterrupt]
