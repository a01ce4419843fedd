"""Run times are those of the work alone: compilation stands apart."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from brdftab.timing import Clock


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


def test_the_clock_stands_still_while_jax_compiles():
    import jax

    @jax.jit
    def inner(x):
        return jax.numpy.sort(x).sum()

    clock = Clock()
    slow = jax.jit(lambda x: inner(x) + inner(2.0 * x))
    slow(np.ones(3)).block_until_ready()
    # what is traced inside another function counts once
    assert 0.5 * clock.wall < clock.compiling < clock.wall
    before = clock.compiling
    slow(np.ones(3)).block_until_ready()
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
