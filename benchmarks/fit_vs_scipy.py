"""The fitting engine against scipy.optimize.least_squares, side by side in one run.

    python -m benchmarks.fit_vs_scipy                       # 2 k, 20 k and 910 k points; minutes
    python -m benchmarks.fit_vs_scipy --points 2000,20000 --repeats 7 --json

Data: cells of a MERL file below 80 degrees, RGB, interfaced Lambertian microfacets (Beckmann, kd .38/.34/.22, n_i 1.12,
sigma .065) with 1 % of noise. Both fit the same five parameters with the same log residual, from the same twin by the
same quadrature rule. The engine runs as `brdftab.fit_model` does after reading: eight starts on a subset, all points,
metrics and standard errors. SciPy (trf, the box as bounds) gets one start, the engine's first, and the twin's forward
Jacobian from compiled chunks. The two alternate; compilation is done before and timed apart in fresh processes, without
and with what the engine keeps on disk beside the Numba kernels. Peak memory is that of a fresh process each, imports
and data included. `cpu` is process time, which counts all threads.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import jax
import numpy as np
import scipy

from benchmarks.scipy_fits import compare, make, ours, packed, theirs, timed
from brdftab.fit.data import Dataset


def peak_gb() -> float:
    """Return the most memory that this process has held, in GB."""
    status = Path("/proc/self/status")
    if status.exists():
        # getrusage of a child begins at what its parent held
        lines = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
        return int(lines["VmHWM"].split()[0]) * 1024 / 1e9
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0) / 1e9


def child(which: str, file: Path, rule: float) -> dict[str, Any]:
    """Fit once in this fresh process."""
    with np.load(file) as kept:
        data = packed(*(kept[n] for n in ("theta_i", "theta_o", "phi", "values")))
    before = peak_gb()
    seconds, cpu, _ = timed((lambda: ours(data)) if which == "ours" else theirs(data, rule))
    return {"first_s": seconds, "first_cpu_s": cpu, "peak_gb": peak_gb(), "before_gb": before}


def fresh(which: str, data: Dataset, rule: float, folder: Path, cache: Path) -> dict[str, Any]:
    """Run `child` in a process of its own."""
    file = folder / f"{data.theta_i.size}.npz"
    if not file.exists():
        np.savez(file, theta_i=data.theta_i, theta_o=data.theta_o, phi=data.phi, values=data.values)
    command = [
        sys.executable,
        "-m",
        "benchmarks.fit_vs_scipy",
        "--child",
        which,
        "--file",
        str(file),
        "--rule",
        str(rule),
    ]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Print the comparison, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", default="2000,20000,910000")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--child", choices=("ours", "scipy"), help=argparse.SUPPRESS)
    parser.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--rule", type=float, default=1e-3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.child:
        print(json.dumps(child(chosen.child, chosen.file, chosen.rule)))
        return
    rows, starts = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for count in (int(c) for c in chosen.points.split(",")):
            data = make(count)
            row = compare(data, chosen.repeats)
            rule = row["ours"]["rule"]
            cache = folder / f"cache-{count}"
            cold, warm = (fresh("ours", data, rule, folder, cache) for _ in range(2))
            other = fresh("scipy", data, rule, folder, cache)
            row["peak_gb"] = {"ours": warm["peak_gb"], "scipy": other["peak_gb"], "before": warm["before_gb"]}
            starts.append({"points": row["points"], "cold": cold, "warm": warm})
            rows.append(row)
    machine = {"cpus": os.cpu_count(), "architecture": platform.machine(), "python": platform.python_version(),
               "jax": jax.__version__, "scipy": scipy.__version__}  # fmt: skip
    if chosen.json:
        print(json.dumps({"machine": machine, "rows": rows, "first": starts}, indent=2))
        return
    show(machine, rows, starts, chosen.repeats)


def show(machine: dict[str, Any], rows: list[dict[str, Any]], starts: list[dict[str, Any]], repeats: int) -> None:
    """Print two tables."""
    print(f"{machine['cpus']} CPUs, {repeats} repeats in turn; seconds, and GB at most")
    names = ("ours min", "median", "cpu", "scipy min", "median", "cpu", "ratio", "apart", "ours GB", "scipy GB")
    print(f"{'points':>8}" + "".join(f"{n:>10}" for n in names))
    for row in rows:
        numbers = []
        for name in ("ours", "scipy"):
            wall = row["wall_s"][name]
            numbers += [f"{wall['min']:.3f}", f"{wall['median']:.3f}", f"{row['cpu_s'][name]:.3f}"]
        numbers += [f"{row['ratio']:.1f}", f"{row['apart_in_standard_errors']:.4f}"]
        numbers += [f"{row['peak_gb'][name]:.2f}" for name in ("ours", "scipy")]
        print(f"{row['points']:>8}" + "".join(f"{n:>10}" for n in numbers))
    print("ratio: of the minima; apart: largest difference of a parameter, in standard errors")
    for first in starts:
        times = [f"{first[kind]['first_s']:.2f} s ({first[kind]['first_cpu_s']:.2f} cpu)" for kind in ("cold", "warm")]
        print(f"{first['points']:>8} points in a fresh process: first fit {times[0]}, with kept programs {times[1]}")


if __name__ == "__main__":
    main()
