"""Time and error of tables of interfaced Lambertian facets with a single bounce, over masking, roughness, tolerance.

    python benchmarks/ilm_tables.py            # 90x90x180 cell centres, RGB, five repeats
    python benchmarks/ilm_tables.py --json

One fill of the whole table is timed, specular and body, worst cells included; compilation is done before. `median` and
`min` are wall time, which counts on a quiet machine; `cpu` is process time over the number of threads, which other work
on the machine disturbs less. The error is the largest relative difference of any channel from the split rule with 16
nodes a panel, over cells drawn at random, grazing ones, those at azimuths near 180 degrees and those with theta_i near
theta_o.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import statistics
import time
from typing import Any

import numba
import numpy as np

from brdftab.models.ilm.single_bounce import cells, table
from brdftab.models.resolve import Setup, resolve
from brdftab.quadrature import unit_gauss
from brdftab.tables.grid import Grid

# what a table should take at most, seconds
TARGETS = {
    ("smith", 1e-3): 0.5,
    ("smith", 1e-5): 2.0,
    ("torrance-sparrow", 1e-3): 2.0,
    ("torrance-sparrow", 1e-4): 10.0,
}
NDFS = ("beckmann", "ggx")
SIGMAS = (0.05, 0.15, 0.5, 1.5)
KD = (0.9, 0.5, 0.1)
SAMPLES = 1000


def sampled(shape: tuple[int, ...]) -> np.ndarray:
    """Return cells (K, 3) where to look for the error."""
    rng = np.random.default_rng(5)
    rows, columns, steps = shape[:3]
    some = rng.integers(0, (rows, columns, steps), (3 * SAMPLES, 3))
    grazing, near = some[:SAMPLES], some[SAMPLES : 2 * SAMPLES]
    grazing[:, :2] = np.array([rows, columns]) - 1 - rng.integers(0, min(rows, columns, 15), (SAMPLES, 2))
    grazing[::2, 2] = steps - 1 - rng.integers(0, min(steps, 40), grazing[::2].shape[0])
    near[:, 1] = np.clip(near[:, 0] + rng.integers(-2, 3, SAMPLES), 0, columns - 1)
    return some


def worst_error(setup: Setup, prepared: table.BodyEvaluator, grid: Grid, values: np.ndarray) -> float:
    """Return the largest relative error of any channel over `sampled` cells."""
    assert grid.phi is not None
    assert setup.fresnel is not None
    at = sampled(values.shape)
    phi, ndf, sigma = grid.phi, setup.ndf, setup.alpha_x
    masking, n = prepared.masking, float(setup.fresnel.a[0])
    lights, views = (cells.axis(masking, ndf, sigma, theta) for theta in (grid.theta_i, grid.theta_o))
    surface = (masking, ndf, sigma, 1.0, n, np.cos(0.5 * phi), np.sin(phi), prepared.kappa / math.pi, 1e-9)
    bodies = np.empty(len(at))
    cells.exact(at, phi, lights, views, unit_gauss(16), surface, bodies)
    exact = np.zeros(values.shape)
    places = np.arange(grid.theta_i.size), np.arange(grid.theta_o.size)
    cells.rewrite(at, bodies, lights, views, places, surface, np.arange(values.shape[3]), False, exact)
    got, want = (a[tuple(at.T)] for a in (values, exact))
    return float(np.abs(got / want - 1.0).max())


def measure(grid: Grid, masking: str, ndf: str, sigma: float, tolerance: float, repeats: int) -> dict[str, Any]:
    """Fill one table several times."""
    assert grid.phi is not None
    setup = resolve("ilm", ndf=ndf, sigma=sigma, ior=1.5, kd=list(KD), masking=masking)
    prepared = table.prepare(setup, tolerance)
    assert prepared is not None
    values = np.empty((*grid.shape, len(setup.channels)))
    wall, cpu = [], []
    for _ in range(repeats):
        started, used = time.perf_counter(), time.process_time()
        prepared.fill(grid.theta_i, grid.theta_o, grid.phi, grid.square, values[None])
        wall.append(time.perf_counter() - started)
        cpu.append((time.process_time() - used) / numba.get_num_threads())
    return {
        "masking": masking,
        "ndf": ndf,
        "sigma": sigma,
        "tolerance": tolerance,
        "target_s": TARGETS[masking, tolerance],
        "wall_s": {"min": min(wall), "median": statistics.median(wall), "max": max(wall)},
        "cpu_s": {"min": min(cpu), "median": statistics.median(cpu), "max": max(cpu)},
        "mended": prepared.mended,
        "error": worst_error(setup, prepared, grid, values),
    }


def main() -> None:
    """Print one line a setting, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", default="90x90x180")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    grid = Grid.parse(chosen.grid, cell="center")
    measure(Grid.parse("4x4x4", cell="center"), "smith", "ggx", 0.3, 1e-3, 1)
    measure(Grid.parse("4x4x4", cell="center"), "torrance-sparrow", "ggx", 0.3, 1e-3, 1)
    rows = [
        measure(grid, masking, ndf, sigma, tolerance, chosen.repeats)
        for masking, tolerance in TARGETS
        for ndf in NDFS
        for sigma in SIGMAS
    ]
    machine = {
        "cpus": os.cpu_count(), "architecture": platform.machine(), "python": platform.python_version(),
        "numba": numba.__version__, "threads": numba.get_num_threads(), "load": os.getloadavg()[0],
    }  # fmt: skip
    if chosen.json:
        print(json.dumps({"grid": chosen.grid, "machine": machine, "rows": rows}, indent=2))
        return
    print(f"{chosen.grid}, RGB, {machine['threads']} threads, load {machine['load']:.1f}; seconds a table")
    print(f"{'masking':<17}{'ndf':<9}{'sigma':>5} {'asked':>6} {'error':>8} {'mended':>7}", end="")
    print("".join(f"{name:>8}" for name in ("median", "min", "cpu", "target")))
    for row in rows:
        seconds = (row["wall_s"]["median"], row["wall_s"]["min"], row["cpu_s"]["min"], row["target_s"])
        print(
            f"{row['masking']:<17}{row['ndf']:<9}{row['sigma']:>5} {row['tolerance']:>6.0e} {row['error']:>8.1e}"
            f" {row['mended']:>7}" + "".join(f"{s:>8.2f}" for s in seconds)
        )


if __name__ == "__main__":
    main()
