"""Interreflections of interfaced Lambertian facets: error and time of the radiosity, and analog paths in the same time.

    python benchmarks/ilm_interreflection.py
    python benchmarks/ilm_interreflection.py --ndf ggx --sigma 0.5 --repeats 5

First table: the interreflections (bounces = inf) of a 90x90x180 RGB table to 89.5 degrees, at the resolution of each
tolerance; errors against a finer rule at some cells, as shares of the whole BRDF; seconds are minima after
compilation, cpu counts all threads. Second: analog Monte Carlo paths (tests/cavity_paths.py) of one incident direction
for as long as the table at 1e-3 took, against the same 36 bins from the radiosity. With --parts: what the number of
Legendre functions, rings and azimuths contributes.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from brdftab.models import kernel
from brdftab.models.ilm.interreflection.isotropic import Modes, synthesis
from brdftab.models.ilm.interreflection.points import points_body
from brdftab.models.ilm.interreflection.rule import Rule, rule
from brdftab.models.resolve import Setup, resolve

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from cavity_paths import bin_nodes, trace  # the path above has to be known first

REFERENCE = Rule(rings=144, azimuths=144, functions=24, modes=288, knots=48)
THETA = np.radians(np.linspace(0.25, 89.5, 90))
PHI = math.pi * (np.arange(180) + 0.5) / 180.0


def at(setup: Setup, resolution: Rule, cells: np.ndarray) -> np.ndarray:
    """Return the interreflections (K, C) at some cells (K, 3) of the table."""
    modes = Modes(setup, resolution).table(THETA[cells[:, 0]], THETA[cells[:, 1]], paired=True)
    return np.einsum("mkc,mk->kc", modes, synthesis(PHI[cells[:, 2]], resolution.modes))


def table(setup: Setup, resolution: Rule) -> np.ndarray:
    """Return the interreflections (90, 90, 180, C) as the fast tables make them."""
    modes = Modes(setup, resolution).table(THETA, THETA)
    return np.tensordot(modes, synthesis(PHI, resolution.modes), (0, 0)).swapaxes(2, 3)


def seconds(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Return the least wall and process time of some calls."""
    best = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        best.append((time.perf_counter() - wall, time.process_time() - cpu))
    return min(w for w, _ in best), min(c for _, c in best)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ndf", default="beckmann", choices=("beckmann", "ggx"))
    parser.add_argument("--sigma", type=float, default=1.0)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--parts", action="store_true", help="vary functions, rings and azimuths one by one, too")
    given = parser.parse_args()
    setup = resolve("ilm", ndf=given.ndf, sigma=given.sigma, kd=[1.0, 0.5, 0.2], bounces="inf")
    rng, k = np.random.default_rng(1), given.cells
    cells = np.stack([rng.integers(0, 90, k), rng.integers(0, 90, k), rng.integers(0, 180, k)], axis=1)
    exact = at(setup, REFERENCE, cells)
    single = resolve("ilm", ndf=given.ndf, sigma=given.sigma, kd=[1.0, 0.5, 0.2])
    angles = THETA[cells[:, 0]], THETA[cells[:, 1]], PHI[cells[:, 2]], np.zeros(len(cells))
    whole = exact + kernel("ilm").points(single, *angles, orders=0, tolerance=1e-4)[:, 0]

    def report(name: str, resolution: Rule, timed: bool) -> float:
        error = (np.abs(at(setup, resolution, cells) - exact) / whole).max(axis=1)
        wall, cpu = seconds(lambda: table(setup, resolution), given.repeats) if timed else (0.0, 0.0)
        took = f" {wall:6.2f} s wall {cpu:6.2f} s cpu" if timed else ""
        print(f"{name:32s} p50 {np.median(error):.0e} p95 {np.quantile(error, 0.95):.0e} max {error.max():.0e}{took}")
        return wall

    print(f"{given.ndf}, sigma {given.sigma:g}, n_i 1.5, kd 1/.5/.2, bounces inf")
    budget = 1.0
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-5):
        r = rule(tolerance)
        wall = report(f"{tolerance:.0e}: {r.rings} rings {r.azimuths} az. {r.functions} fn.", r, True)
        if tolerance == 1e-3:
            budget = wall
    compare(given.ndf, given.sigma, budget)
    for size in (4, 8, 12, 16, 20) if given.parts else ():
        report(f"{size} functions", Rule(144, 144, size, 288, 48), False)
    for rings in (12, 24, 48, 96) if given.parts else ():
        report(f"{rings} rings", Rule(rings, 144, 24, 288, 48), False)
    for steps in (14, 28, 56, 112) if given.parts else ():
        report(f"{steps} azimuths a quarter", Rule(144, steps, 24, 2 * steps, 48), False)


def compare(ndf: str, sigma: float, budget: float) -> None:
    """Print the errors of analog paths that take as long as a whole table."""
    theta, counts = math.radians(60.0), np.zeros((3, 2, 6, 6))
    trace(ndf == "ggx", sigma, sigma, 1.5, 1.0, theta, 0.0, 1000, 1, counts)
    paths, started = 0, time.perf_counter()
    counts[:] = 0.0
    while time.perf_counter() - started < budget or not paths:
        trace(ndf == "ggx", sigma, sigma, 1.5, 1.0, theta, 0.0, 50_000, paths, counts)
        paths += 50_000
    rate = paths / (time.perf_counter() - started)
    seen = counts[1:, 1].sum(axis=0) / paths
    view, phi, integrate = bin_nodes(6, 6, 6)
    one = resolve("ilm", ndf=ndf, sigma=sigma, kd=1.0, bounces="inf")
    f = points_body(one, np.full_like(view, theta), view, phi, np.zeros_like(view), 1e-4)[:, 0]
    bins = integrate(f)
    share = float(bins.sum())
    print(
        f"analog paths, 60 degrees, {budget:.2f} s: {paths} at {rate:.2g}/s on one thread, interreflected {share:.4f}"
    )
    print(
        f"36 bins: RMS difference {np.sqrt(np.mean((seen / bins - 1.0) ** 2)):.1e} of their value, of which noise "
        f"{np.sqrt(np.mean(1.0 / (bins * paths))):.1e}"
    )
    need = 90.0 * 90.0 * 180.0 / share / 1e-6
    print(
        f"to reach 1e-3 in every cell of 90x90x180: some {need:.0e} paths a channel, {need / rate / 3600.0:.0f} hours"
    )


if __name__ == "__main__":
    main()
