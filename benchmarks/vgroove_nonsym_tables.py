"""Table times of the nonsymmetric groove: in-plane part, filling, and the error, over roughness and reflectance.

    python benchmarks/vgroove_nonsym_tables.py            # 90x90x180, tolerance 1e-3, five repeats
    python benchmarks/vgroove_nonsym_tables.py --json

Kernels are compiled before. `kernel` is the kernel_time_s that a table states: interpolated part, table, mirror cells.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time

import numba

import brdftab
from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import resolve

NDFS = ("beckmann", "ggx")
ALPHAS = (0.1, 0.3, 0.6, 1.0)
MATERIALS = ("mirror", "Au")


def measure(ndf: str, alpha: float, material: str, grid: str, tolerance: float, repeats: int) -> dict[str, object]:
    """Tabulate one setting several times."""
    given = {"ndf": ndf, "alpha": alpha, "material": material}
    kernels, builds = [], []
    for _ in range(repeats):
        started = time.perf_counter()
        engine = Engine(resolve("vgroove-nonsym", **given), tolerance)
        builds.append(time.perf_counter() - started)
        table = brdftab.tabulate("vgroove-nonsym", grid, tolerance=tolerance, **given)
        kernels.append(table.provenance["kernel_time_s"])
    error = table.provenance["error"]
    return {
        **given,
        "prepared": engine.is_fast and table.provenance["method"] == "prepared",
        "build_s": [min(builds), statistics.median(builds), max(builds)],
        "kernel_s": [min(kernels), statistics.median(kernels), max(kernels)],
        "error": error["estimate"],
        "p95": error["p95"],
        "met": error["met"],
    }


def main() -> None:
    """Print one line a setting, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", default="90x90x180")
    parser.add_argument("--tolerance", type=float, default=1e-3)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    brdftab.tabulate("vgroove-nonsym", "4x4x4", tolerance=chosen.tolerance)
    rows = [
        measure(ndf, alpha, material, chosen.grid, chosen.tolerance, chosen.repeats)
        for material in MATERIALS
        for ndf in NDFS
        for alpha in ALPHAS
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
    print(f"{chosen.grid}, tolerance {chosen.tolerance:g}, {machine['threads']} threads; seconds: min / median / max")
    print(f"{'material':<9}{'ndf':<10}{'alpha':>6}  {'build':>22}  {'kernel':>22}  {'error':>8} {'p95':>8}")
    for row in rows:
        build, kernel = (" / ".join(f"{x:.3f}" for x in row[key]) for key in ("build_s", "kernel_s"))  # type: ignore[attr-defined]
        note = "" if row["met"] else "  NOT MET"
        print(
            f"{row['material']:<9}{row['ndf']:<10}{row['alpha']:>6}  {build:>22}  {kernel:>22}  "
            f"{row['error']:>8.1e} {row['p95']:>8.1e}{note}"
        )


if __name__ == "__main__":
    main()
