"""Stated run times of a first run, which compiles its kernels, and of a second one, which finds them on disk.

    python benchmarks/first_run.py              # every model; some ten minutes on two cores
    python benchmarks/first_run.py smith ilm

Each run is a process of its own; those of a model share one new folder of kernels. Tables have so many cells that
kernels take tenths of a second, below which a processor's own clock decides. Of three second runs the median counts.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile

from brdftab import models
from brdftab.models.resolve import resolve

# cells that take tenths of a second; the default is for models in closed form
GRIDS = {"ilm": "32x32x64", "vgroove-nonsym": "90x90x180", "smith-multi": "32x32x64", "smith-walk": "2x2x4"}
CLOSED, FOUR_AXES = "90x90x180", "8x12x8x12"
STOCHASTIC = 3e-2
REPEATS = 3

CODE = """
import json, sys
from brdftab import tabulate
name, grid, tolerance = sys.argv[1:]
# virtual machines look for pages of memory at their first touch: let them before
memory = bytearray(b"1") * (1 << 30)
del memory
made = tabulate(name, grid, tolerance=float(tolerance)).provenance
print(json.dumps([made[k] for k in ("kernel_time_s", "total_time_s", "compile_time_s")]))
"""


def run(name: str, folder: str) -> list[float]:
    """Return kernel, total and compile seconds of one process."""
    setup = resolve(name)
    grid = GRIDS.get(name, CLOSED) if setup.isotropic else FOUR_AXES
    tolerance = STOCHASTIC if name == "smith-walk" else 1e-3
    environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
    words = [sys.executable, "-c", CODE, name, grid, str(tolerance)]
    return json.loads(subprocess.run(words, env=environment, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Print a row a model."""
    print(
        "| model | compile s | kernel s, first | second | ratio | total s, first | second | ratio |\n|" + 8 * " --- |"
    )
    for name in sys.argv[1:] or models.names():
        with tempfile.TemporaryDirectory() as folder:
            first = run(name, folder)
            again = [run(name, folder) for _ in range(REPEATS)]
        second = [statistics.median(column) for column in zip(*again, strict=True)]
        kernel, total = (f"{first[n]:.3f} | {second[n]:.3f} | {first[n] / second[n]:.2f}" for n in (0, 1))
        print(f"| {name} | {first[2]:.1f} | {kernel} | {total} |", flush=True)


if __name__ == "__main__":
    main()
