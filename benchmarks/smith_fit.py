"""Fits of all-bounce Smith facets: what they recover, how long they take, and how far off single bounces are.

    python benchmarks/smith_fit.py              # about a minute
    python benchmarks/smith_fit.py --seeds 20

Data: `smith-multi`, GGX, alpha .6, f0 = 1, .77, .34 from the compiled solver at 18 x 18 x 19 directions (2.5 to 87.5
degrees), 2 % of noise. Each seed is fitted by `smith-multi`, by `smith` with the same masking, and by that with a
Lambertian body: eight starts, metrics and standard errors included. Prints JSON; seconds are wall time, `cpu` process
time of all threads, `first` the first fit in a fresh process without kept programs, compilation included.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

import brdftab
from brdftab.fit.data import Dataset
from brdftab.fit.parameters import parse
from brdftab.fit.stages import Options
from brdftab.fit.verdict import fit_points

ALPHA, F0 = 0.6, (1.0, 0.77, 0.34)
NOISE = 0.02
MODELS = {
    "smith-multi": {},
    "smith": {"smith.ndf": "ggx", "smith.masking": "separable"},
    "smith+lambert": {"smith.ndf": "ggx", "smith.masking": "separable"},
}


def truth() -> tuple[list[np.ndarray], np.ndarray]:
    """Return theta_i, theta_o, phi (N,) and the exact values (N, 3)."""
    theta, phi = np.radians(np.linspace(2.5, 87.5, 18)), np.linspace(0.0, math.pi, 19)
    angles = [v.ravel() for v in np.meshgrid(theta, theta, phi, indexing="ij")]
    return angles, brdftab.evaluate("smith-multi", *angles, ndf="ggx", alpha=ALPHA, f0=list(F0), tolerance=1e-7)


def noisy(angles: list[np.ndarray], values: np.ndarray, seed: int) -> Dataset:
    """Return the data of one seed."""
    found = values * np.exp(NOISE * np.random.default_rng(seed).standard_normal(values.shape))
    return Dataset(*angles, found, found > 0.0, ("R", "G", "B"), {}, np.zeros(found.shape, bool), "grid", "made here")


def once(model: str, data: Dataset) -> tuple[Any, float, float]:
    """Return a fit, its seconds and its CPU seconds."""
    clock, cpu = time.perf_counter(), time.process_time()
    result = fit_points(parse(model, None, MODELS[model]), data, Options())
    return result, time.perf_counter() - clock, time.process_time() - cpu


def first(model: str) -> dict[str, float]:
    """Return the times of a first fit in a fresh process that finds no kept programs."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": folder}
        call = [sys.executable, __file__, "--first", model]
        done = subprocess.run(call, env=environment, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def summary(model: str, data: list[Dataset]) -> dict[str, Any]:
    """Return means over the seeds: parameters minus truth, chi^2 a value, and times of compiled fits."""
    once(model, data[0])
    runs = [once(model, one) for one in data]
    results = [r for r, _, _ in runs]
    alpha = np.array([r.values["alpha"] for r in results]) - ALPHA
    f0 = np.array([r.values["f0"] for r in results]) - F0
    biases = [r.solver["bias_in_standard_errors"] for r in results]
    chi = [2.0 * r.cost / r.points["residuals"] / NOISE**2 for r in results]
    return {
        "alpha_error_mean": float(alpha.mean()),
        "alpha_error_worst": float(np.abs(alpha).max()),
        "f0_error_mean": f0.mean(axis=0).tolist(),
        "f0_error_worst": float(np.abs(f0).max()),
        "alpha_stderr": float(results[0].stderr["alpha"]),
        "chi2_per_value": float(np.mean(chi)),
        "log_rms": float(np.mean([r.metrics["log_rms"] for r in results])),
        "rule_bias_in_standard_errors": max((b for b in biases if b is not None), default=None),
        "seconds_min": min(s for _, s, _ in runs),
        "seconds_median": float(np.median([s for _, s, _ in runs])),
        "cpu_median": float(np.median([c for _, _, c in runs])),
        "first": first(model),
    }


def main() -> None:
    """Print the summary of every model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="sets of noise [default: 5]")
    parser.add_argument("--json", action="store_true", help="the output is JSON with and without it")
    parser.add_argument("--first", choices=tuple(MODELS), help=argparse.SUPPRESS)
    options = parser.parse_args()
    angles, values = truth()
    if options.first:
        result, seconds, cpu = once(options.first, noisy(angles, values, 0))
        print(json.dumps({"seconds": seconds, "cpu": cpu, "compile": result.times["compile"]}))
        return
    data = [noisy(angles, values, seed) for seed in range(options.seeds)]
    report = {
        "machine": {"cpus": os.cpu_count(), "system": platform.platform(), "load": os.getloadavg()[0]},
        "truth": {"alpha": ALPHA, "f0": F0, "noise": NOISE, "directions": values.shape[0], "seeds": options.seeds},
        "fits": {model: summary(model, data) for model in MODELS},
    }
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
