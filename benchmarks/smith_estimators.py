"""Noise of the estimators of multi-bounce Smith surfaces: mean squared error by samples, and time a sample.

python benchmarks/smith_estimators.py [--repeats N]

Prints JSON. F = 1, GGX, eight pairs of directions. `walk` estimates every order (k >= 1) by random walks with heights
that start at the light, as the paper's comparison does (Wang et al. 2022, Fig. 8); pt and bdpt know the single bounce.
pt starts at the more grazing direction. The reference of pt and bdpt is the solver; that of the walk, which is another
model, its own mean over 2^20 walks a pair.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import brdftab
from brdftab.models.microfacet.walk.reflecting import reflecting
from brdftab.models.microfacet.walk.survey import at_points
from brdftab.models.setup import Setup, resolve
from brdftab.models.smith_multi import montecarlo

Array = NDArray[np.float64]
# theta_i, theta_o, phi in degrees
PAIRS = [
    (30, 50, 220),
    (60, 75, 190),
    (80, 70, 0),
    (45, 45, 180),
    (10, 20, 90),
    (75, 10, 40),
    (50, 30, 120),
    (5, 85, 180),
]
ANGLES = (*(np.radians(np.array(a, dtype=np.float64)) for a in zip(*PAIRS, strict=True)), np.zeros(len(PAIRS)))
SAMPLES = [1, 2, 4, 8, 16, 32, 64]
MANY = 1 << 20


def _setup(estimator: str, alpha: float, samples: int, seed: int) -> Setup:
    given = {"ndf": "ggx", "alpha": alpha, "material": "mirror", "samples": samples, "seed": seed}
    if estimator == "walk":
        return resolve("smith-walk", **given)
    return resolve("smith-multi", estimator=estimator, **given)


def _values(estimator: str, alpha: float, samples: int, seed: int, repeats: int = 1) -> Array:
    """Return independent estimates of each pair (repeats, 8), 1/sr: every point of a call draws paths of its own."""
    angles = tuple(np.tile(a, repeats) for a in ANGLES)
    setup = _setup(estimator, alpha, samples, seed)
    if estimator == "walk":
        road = replace(reflecting(setup, 1e-3, heights=True, least=1), shared=False)
        return at_points(setup, [road], angles, 0, 1e-3).values.reshape(repeats, -1)
    return montecarlo.points(setup, *angles, orders=0, tolerance=1e-3).reshape(repeats, -1)


def _seconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Return the least CPU time of some runs."""
    best = np.inf
    for _ in range(repeats):
        started = time.process_time()
        work()
        best = min(best, time.process_time() - started)
    return float(best)


def measure(estimator: str, alpha: float, repeats: int) -> dict[str, object]:
    """Return mean squared errors by samples, and microseconds a sample."""
    if estimator == "walk":
        known = _values("walk", alpha, MANY, 99)
    else:
        ti, to, phi, _ = ANGLES
        known = np.asarray(
            brdftab.evaluate("smith-multi", ti, to, phi, ndf="ggx", alpha=alpha, material="mirror", tolerance=1e-6)
        ).reshape(-1)
    errors = {str(n): float(np.mean((_values(estimator, alpha, n, n, repeats) - known) ** 2)) for n in SAMPLES}
    spent = _seconds(lambda: _values(estimator, alpha, 1 << 14, 0)) / (len(PAIRS) << 14)
    return {"mean_squared_error": errors, "us_per_sample": round(1e6 * spent, 3)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=2000, help="estimates behind each mean (default 2000)")
    repeats = parser.parse_args().repeats
    found: dict[str, dict[str, object]] = {}
    for alpha in (1.0, 0.5):
        found[f"ggx {alpha:g}"] = {e: measure(e, alpha, repeats) for e in ("pt", "bdpt", "walk")}
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
