"""Tracing a scratch: error against run time of random rays, of stratified rays, and of brdftab's.

Prints a table or JSON. The error is the L1 distance of the flux matrix (256 x 256 bins, F = 1) to a trace with 65536
rays a bin; 2 is the largest possible. `random` throws rays at random over aperture and bin, bounces as brdftab's do,
and counts them; `stratified` has one in each cell of a grid over both; brdftab splits intervals between rays, spreads
their light over the exit angles in between, and scales the result. Seconds are the least of some repeats, wall and CPU,
compiled before; they hold three bounce orders and more, with the cosines that materials need.
"""

from __future__ import annotations

import argparse
import json
import math
import time

import numpy as np

from brdftab.scratch_layers.counted import BINS, counted, split

FINEST = 65536

PROFILES = ("v:30", "quartic:0.05", "quartic:1")
COUNTS = {"brdftab": (32, 64, 128, 256, 512, 1024, 2048), "random": (1000, 10000), "stratified": (1000, 10000)}


def timed(work, repeats):
    """Return a result and the least wall and CPU seconds."""
    best = [math.inf, math.inf]
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        found = work()
        best = [min(best[0], time.perf_counter() - wall), min(best[1], time.process_time() - cpu)]
    return found, best


def measure(text, repeats):
    """Return error and seconds of every method on one profile."""
    truth = split(text, FINEST)
    split(text, 16)
    counted(text, 64, False)
    rows = []
    for method, counts in COUNTS.items():
        for rays in counts:
            if method == "brdftab":
                flux, seconds = timed(lambda rays=rays: split(text, rays), repeats)
            else:
                even = method == "stratified"
                flux, seconds = timed(lambda rays=rays, even=even: counted(text, rays, even), max(1, repeats // 2))
            error = float(np.abs(flux - truth).sum() / 2.0)
            rows.append({"method": method, "rays": rays, "l1": error, "wall_s": seconds[0], "cpu_s": seconds[1]})
    return {"profile": text, "rows": rows}


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    results = [measure(text, options.repeats) for text in PROFILES]
    if options.json:
        print(json.dumps({"bins": BINS, "results": results}, indent=1))
        return
    for result in results:
        print(result["profile"])
        for r in result["rows"]:
            print(
                f"  {r['method']:11s}{r['rays']:>7d} rays  L1 {r['l1']:.4f}  wall {r['wall_s']:.3f}  "
                f"cpu {r['cpu_s']:.3f} s"
            )


if __name__ == "__main__":
    main()
