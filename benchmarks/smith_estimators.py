"""Noise of the estimators of multi-bounce Smith surfaces: mean squared error by samples, and time a sample.

python -m benchmarks.smith_estimators [--repeats N]

Prints JSON. F = 1, GGX, eight pairs of directions. `walk` estimates every order (k >= 1) by random walks with heights
that start at the light, as the paper's comparison does (Wang et al. 2022, Fig. 8); pt and bdpt know the single bounce.
pt starts at the more grazing direction. The reference of pt and bdpt is the solver; that of the walk, which is another
model, its own mean over 2^20 walks a pair.
"""

from __future__ import annotations

import argparse
import json

from benchmarks.papers.wang import SAMPLES, sample_cost, squared_errors


def measure(estimator: str, alpha: float, repeats: int) -> dict[str, object]:
    """Return mean squared errors by samples, and microseconds a sample."""
    errors = squared_errors(estimator, alpha, repeats)
    spent = sample_cost(estimator, alpha, None, 1 << 14, 5)
    found = {str(n): float(e) for n, e in zip(SAMPLES, errors, strict=True)}
    return {"mean_squared_error": found, "us_per_sample": round(spent, 3)}


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
