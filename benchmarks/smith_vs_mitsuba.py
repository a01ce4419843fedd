"""`smith` tables against Mitsuba 3 and against writing the same memory, side by side in one process.

Per repeat, in turn: our kernel fills a 90x90x180 gold RGB table (GGX, separable Smith masking, cell centres), Mitsuba's
llvm_ad_rgb `roughconductor` evaluates the same 1,458,000 pairs (directions made beforehand, result awaited), and numpy
fills an array of the table's shape. Wanted: at least 2.5 times Mitsuba's speed, at most twice the time of the fill.

    python benchmarks/smith_vs_mitsuba.py [--json] [--repeats 200] [--threads 2] [--check]

Needs mitsuba and libLLVM 19 (Debian: libllvm19; DRJIT_LIBLLVM_PATH if it is not in the usual place); says so and stops
where they are missing. On a busy machine read `cpu_min_ms` (processor time of all threads) rather than wall time.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from brdftab.bench.peers import find_llvm

# gold at 630, 532 and 465 nm: one index a channel, as roughconductor takes it
ETA, K, ALPHA = (0.143, 0.375, 1.442), (3.983, 2.386, 1.603), 0.3
SHAPE = (90, 90, 180)
TOLERANCE = 1e-3
NAMES = ("brdftab", "mitsuba", "fill")


def axes() -> tuple[np.ndarray, np.ndarray]:
    theta = (np.arange(SHAPE[0]) + 0.5) * (0.5 * np.pi / SHAPE[0])
    return theta, (np.arange(SHAPE[2]) + 0.5) * (np.pi / SHAPE[2])


def our_kernel() -> tuple[Callable[[], None], np.ndarray]:
    """Return a call that fills our table, and the table."""
    from brdftab import models
    from brdftab.models.resolve import resolve

    setup = resolve("smith", ndf="ggx", alpha=ALPHA, masking="separable", eta=ETA, k=K)
    prepared = models.kernel("smith").prepare(setup, TOLERANCE)
    theta, phi = axes()
    out = np.empty((*SHAPE, 3), np.float32)
    return lambda: prepared.fill(theta, theta, phi, True, out[None]), out


def mitsuba_kernel(threads: int) -> tuple[Callable[[], Any], np.ndarray]:
    """Return a call that evaluates all pairs in Mitsuba's LLVM variant, and its values as our table holds them."""
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(threads)
    rgb = {name: {"type": "rgb", "value": list(value)} for name, value in (("eta", ETA), ("k", K))}
    bsdf = mi.load_dict({"type": "roughconductor", "distribution": "ggx", "alpha": ALPHA, **rgb})
    theta, phi = axes()
    i, o, p = (x.ravel() for x in np.meshgrid(theta, theta, phi, indexing="ij"))
    light = mi.Vector3f(np.sin(i), np.zeros_like(i), np.cos(i))
    view = mi.Vector3f(np.sin(o) * np.cos(p), np.sin(o) * np.sin(p), np.cos(o))
    si = dr.zeros(mi.SurfaceInteraction3f, i.size)
    si.wi = light
    dr.eval(si, view)
    dr.sync_thread()
    context = mi.BSDFContext()

    def run() -> Any:
        value = bsdf.eval(context, si, view)
        dr.eval(value)
        dr.sync_thread()
        return value

    values = np.array(run()).T.reshape(*SHAPE, 3) / np.cos(theta)[None, :, None, None]
    return run, values


def measure(repeats: int, threads: int) -> dict[str, Any]:
    """Time both in turn, and a plain filling of the same memory; return times and the largest difference."""
    import mitsuba as mi
    import numba

    numba.set_num_threads(threads)
    ours, table = our_kernel()
    theirs, values = mitsuba_kernel(threads)
    memory = np.empty_like(table)
    runs = (ours, theirs, lambda: memory.fill(1.0))
    for run in runs:
        run()
    difference = float((np.abs(values - table) / table).max())
    wall, cpu = np.empty((repeats, 3)), np.empty((repeats, 3))
    for n in range(repeats):
        for j, run in enumerate(runs):
            before, spent = time.perf_counter(), time.process_time()
            run()
            wall[n, j], cpu[n, j] = time.perf_counter() - before, time.process_time() - spent
    found: dict[str, Any] = {
        "pairs": int(np.prod(SHAPE)),
        "threads": threads,
        "repeats": repeats,
        "mitsuba_version": mi.__version__,
        "tolerance": TOLERANCE,
        "max_relative_difference": difference,
        "load_average": os.getloadavg()[0],
    }
    for j, name in enumerate(NAMES):
        low, median, high = np.quantile(wall[:, j], [0.1, 0.5, 0.9]) * 1e3
        found[name] = {
            "min_ms": float(wall[:, j].min() * 1e3),
            "median_ms": float(median),
            "p10_ms": float(low),
            "p90_ms": float(high),
            "cpu_min_ms": float(cpu[:, j].min() * 1e3),
            "cpu_median_ms": float(np.median(cpu[:, j]) * 1e3),
        }
    found["ratios"] = {
        "mitsuba/brdftab": {key: found["mitsuba"][key] / found["brdftab"][key] for key in found["fill"]},
        "brdftab/fill": {key: found["brdftab"][key] / found["fill"][key] for key in found["fill"]},
    }
    return found


def show(found: dict[str, Any]) -> None:
    print("{pairs} pairs, {threads} threads, {repeats} repeats, load average {load_average:.1f}".format(**found))
    for name in NAMES:
        print(f"{name:8s}", "  ".join(f"{key[:-3]} {value:6.2f} ms" for key, value in found[name].items()))
    for name, ratios in found["ratios"].items():
        print(f"{name:15s}", "  ".join(f"{key[:-3]} {value:5.2f}" for key, value in ratios.items()))
    print(f"largest relative difference of both tables: {found['max_relative_difference']:.2e}")


def main() -> int:
    """Measure and print; with --check the exit status tells whether both goals are met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--check", action="store_true", help="exit 1 unless the minimum times meet both goals")
    given = parser.parse_args()
    reason = None
    library = find_llvm()
    if importlib.util.find_spec("mitsuba") is None:
        reason = "mitsuba is not installed (pip install mitsuba)"
    elif library is None:
        reason = "libLLVM 19 was not found (Debian: libllvm19); set DRJIT_LIBLLVM_PATH to it"
    if reason is not None:
        print(json.dumps({"skipped": reason}) if given.json else f"skipped: {reason}")
        return 0
    os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    # threads that wait without spinning leave the cores to whoever is measured next
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    found = measure(given.repeats, given.threads)
    if given.json:
        print(json.dumps(found, indent=1))
    else:
        show(found)
    ratios = found["ratios"]
    met = ratios["mitsuba/brdftab"]["min_ms"] >= 2.5 and ratios["brdftab/fill"]["min_ms"] <= 2.0
    return 1 if given.check and not met else 0


if __name__ == "__main__":
    sys.exit(main())
