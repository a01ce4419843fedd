"""Table speed of the symmetric groove: entries a second and the error, over roughness and reflectance.

    python benchmarks/vgroove_sym_tables.py            # 90x90x180 cell centres, tolerance 1e-4, nine repeats
    python benchmarks/vgroove_sym_tables.py --json

An entry is one cell with all its channels; reciprocity is used, so that half of the cells are computed. Compilation is
done before. `wall` is what counts on a quiet machine; `cpu` is process time over the number of threads, which other
work on the machine disturbs less. Neither contains the preparation, which is stated apart, nor the averages of the
mirror cells. The error is against direct evaluation at tolerance 1e-9: the largest difference of a channel against the
largest channel of the cell, over cells drawn at random and over all cells at phi = 179.5 degrees next to the mirror
direction.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from typing import Any

import numba
import numpy as np

from brdftab.models.resolve import Setup, resolve
from brdftab.models.vgroove_sym import kernel
from brdftab.tables.grid import Grid

NDFS = ("beckmann", "ggx")
ALPHAS = (0.1, 0.3, 1.0)
MATERIALS = ("mirror", "Au")
SAMPLES = 4000


def worst_error(setup: Setup, grid: Grid, values: np.ndarray) -> float:
    """Return the largest error of a sample of cells; mirror cells, which a table averages, are left out."""
    rng = np.random.default_rng(11)
    i, o, p = (rng.integers(0, n, SAMPLES) for n in values.shape[:3])
    near = np.arange(values.shape[0] - 1)
    last = np.full(near.size, values.shape[2] - 1)
    i, o, p = np.concatenate([i, near + 1]), np.concatenate([o, near]), np.concatenate([p, last])
    assert grid.phi is not None
    theta_i, theta_o, phi = grid.theta_i[i], grid.theta_o[o], grid.phi[p]
    exact = kernel.points(setup, theta_i, theta_o, phi, np.zeros(i.size), orders=0, tolerance=1e-9)[:, 0]
    largest = exact.max(axis=1)
    seen = largest > 1e-290
    return float((np.abs(values[i, o, p] - exact).max(axis=1)[seen] / largest[seen]).max())


def measure(grid: Grid, ndf: str, alpha: float, material: str, tolerance: float, repeats: int) -> dict[str, Any]:
    """Fill one table several times."""
    assert grid.phi is not None
    setup = resolve("vgroove-sym", ndf=ndf, alpha=alpha, material=material)
    values = np.empty((*grid.shape, len(setup.channels)))
    started = time.perf_counter()
    prepared = kernel.prepare(setup, tolerance)
    build = time.perf_counter() - started
    assert prepared is not None
    prepared.fill(grid.theta_i, grid.theta_o, grid.phi, grid.square, values[None])
    error = worst_error(setup, grid, values)
    single = np.empty(values.shape, np.float32)
    wall, cpu = [], []
    for repeat in range(repeats + 1):
        started, used = time.perf_counter(), time.process_time()
        prepared.fill(grid.theta_i, grid.theta_o, grid.phi, grid.square, single[None])
        if repeat > 0:
            wall.append(time.perf_counter() - started)
            cpu.append((time.process_time() - used) / numba.get_num_threads())
    return {
        "ndf": ndf,
        "alpha": alpha,
        "material": material,
        "prepare_s": build,
        "wall_s": {"min": min(wall), "median": statistics.median(wall), "max": max(wall)},
        "cpu_s": {"min": min(cpu), "median": statistics.median(cpu), "max": max(cpu)},
        "entries_per_s": {
            "wall_best": grid.size / min(wall),
            "wall_median": grid.size / statistics.median(wall),
            "cpu_best": grid.size / min(cpu),
        },
        "error": error,
    }


def main() -> None:
    """Print one line a setting, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", default="90x90x180")
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    grid = Grid.parse(chosen.grid, cell="center")
    measure(Grid.parse("4x4x4", cell="center"), "ggx", 0.3, "Au", chosen.tolerance, 1)
    rows = [
        measure(grid, ndf, alpha, material, chosen.tolerance, chosen.repeats)
        for ndf in NDFS
        for alpha in ALPHAS
        for material in MATERIALS
    ]
    machine = {
        "cpus": os.cpu_count(), "architecture": platform.machine(), "python": platform.python_version(),
        "numba": numba.__version__, "threads": numba.get_num_threads(),
    }  # fmt: skip
    if chosen.json:
        print(
            json.dumps({"grid": chosen.grid, "tolerance": chosen.tolerance, "machine": machine, "rows": rows}, indent=2)
        )
        return
    print(f"{chosen.grid}, tolerance {chosen.tolerance:g}, {machine['threads']} threads; million entries/s")
    speeds = "".join(f"{name:>8}" for name in ("median", "min", "max", "cpu"))
    print(f"{'ndf':<10}{'alpha':>5} {'material':<9}{speeds}  {'prepare':>9}  {'error':>8}")
    for row in rows:
        wall, cpu = row["wall_s"], row["cpu_s"]
        seconds = (wall["median"], wall["max"], wall["min"], cpu["min"])
        print(
            f"{row['ndf']:<10}{row['alpha']:>5} {row['material']:<9}"
            + "".join(f"{grid.size / s / 1e6:>8.1f}" for s in seconds)
            + f"  {row['prepare_s']:>7.3f} s  {row['error']:>8.1e}"
        )


if __name__ == "__main__":
    main()
