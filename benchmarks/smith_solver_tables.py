"""Tables of the all-bounce Smith solver: CPU seconds, peak memory so far and the largest error of any cell.

The error is the largest difference of a channel to a run at a hundredth of the tolerance, over the cell's largest
channel; cells below 1e-10 of the largest value of their pair of polar angles, or below 1e-11/sr, are compared with it:
between narrow lobes that fall between the table's azimuths there is only the rounding of the lobe's modes.
"""

from __future__ import annotations

import argparse
import json
import resource
import time

import numpy as np

from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import resolve
from brdftab.tables.grid import Grid

GOLD = {"eta": [0.143, 0.375, 1.442], "k": [3.983, 2.386, 1.603]}
WHITE = {"material": "mirror"}
USUAL = "90x90x180"
CASES = [
    # first, as the peak of memory is that of all work before
    ("ggx 0.5 gold fine", "180x180x180", 1e-5, {"ndf": "ggx", "alpha": 0.5, **GOLD}),
    *[(f"ggx {a:g} F = 1", USUAL, 1e-5 if a >= 0.05 else 1e-4, {"ndf": "ggx", "alpha": a, **WHITE})
      for a in (0.02, 0.05, 0.1, 0.5, 1.0)],
    *[(f"ggx {a:g} gold", USUAL, 1e-5, {"ndf": "ggx", "alpha": a, **GOLD}) for a in (0.1, 0.5)],
    *[(f"beckmann {a:g} F = 1", USUAL, 1e-4, {"ndf": "beckmann", "alpha": a, **WHITE}) for a in (0.1, 0.5, 1.0)],
    ("beckmann 0.5 gold", USUAL, 1e-4, {"ndf": "beckmann", "alpha": 0.5, **GOLD}),
    ("ggx 0.5 n 1.5", "45x45+45x90", 1e-3, {"ndf": "ggx", "alpha": 0.5, "ior": 1.5}),
]  # fmt: skip


def fill(setup, grid, tolerance, dtype):
    """Return a table's values, its CPU seconds and its wall seconds."""
    out = np.empty((1, *grid.shape, len(setup.channels)), dtype=dtype)
    started, wall = time.process_time(), time.perf_counter()
    Engine(setup, tolerance).fill(grid.theta_i, grid.theta_o, grid.phi, out)
    return out[0], time.process_time() - started, time.perf_counter() - wall


def measure(name, text, tolerance, given, repeats, check):
    """Return time, memory and, if asked, the error of one case."""
    grid, setup = Grid.parse(text), resolve("smith-multi", **given)
    fill(setup, Grid.parse("3x3+3x3" if grid.below else "3x3x3"), tolerance, np.float32)
    runs = [fill(setup, grid, tolerance, np.float32)[1:] for _ in range(repeats)]
    row = {"case": name, "grid": text, "tolerance": tolerance}
    row |= {"cpu_s": min(r[0] for r in runs), "wall_s": min(r[1] for r in runs)}
    row["cpu_median_s"] = float(np.median([r[0] for r in runs]))
    row["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    if check:
        mine, fine = (fill(setup, grid, t, np.float64)[0] for t in (tolerance, 0.01 * tolerance))
        floor = np.maximum(1e-10 * fine.max(axis=(2, 3))[:, :, None], 1e-11)
        error = np.abs(mine - fine).max(axis=3) / np.maximum(fine.max(axis=3), floor)
        row |= {"error": float(error.max()), "error_p99": float(np.quantile(error, 0.99))}
        if mine.shape[0] == mine.shape[1]:
            row["reciprocal"] = bool(np.array_equal(mine, mine.transpose(1, 0, 2, 3)))
    return row


def main():
    """Measure the cases and print them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="", help="cases whose name holds this")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = []
    for name, text, tolerance, given in CASES:
        if options.only not in name:
            continue
        rows.append(measure(name, text, tolerance, given, options.repeats, check=text != "180x180x180"))
        if not options.json:
            error = f"{rows[-1]['error']:.1e}" if "error" in rows[-1] else "-"
            print(
                f"{name:22s} {text:12s} tolerance {tolerance:g}  cpu {rows[-1]['cpu_s']:.2f} (median "
                f"{rows[-1]['cpu_median_s']:.2f}) wall {rows[-1]['wall_s']:.2f} s  error {error}  "
                f"peak {rows[-1]['peak_gb']:.2f} GB",
                flush=True,
            )
    if options.json:
        print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
