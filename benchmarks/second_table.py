"""A second `brdftab tabulate --model smith`, from shell to file, beside a process that only starts the same libraries.

    python benchmarks/second_table.py
    python benchmarks/second_table.py --most 1.8    # exit status 1 where every pair exceeds that ratio

Both run in turn in one run; a time is the smaller of wall time and the CPU time of all threads. The ratio stays the
same on slow and busy machines, where seconds do not.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

GOAL = 1.5
BARE = """
import numba, numpy, OpenEXR
@numba.njit(cache=True)
def plain(x):
    return x + 1.0
plain(1.0)
"""


def seconds(words: list[str], folder: str) -> float:
    before, started = os.times(), time.perf_counter()
    subprocess.run(words, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    after, wall = os.times(), time.perf_counter() - started
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return min(cpu, wall)


def main() -> None:
    """Measure in pairs and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--most", type=float, help="largest ratio that may stand")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    table = ["brdftab", "tabulate", "--model", "smith", "--overwrite"]
    pairs = []
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "bare.py"), "w") as file:
            file.write(BARE)
        bare = [sys.executable, "bare.py"]
        for words in (bare, table):
            seconds(words, folder)
        for _ in range(chosen.repeats):
            pairs.append((seconds(bare, folder), seconds(table, folder)))
    ratios = [b / a for a, b in pairs]
    facts = {
        "bare_s": [a for a, _ in pairs],
        "table_s": [b for _, b in pairs],
        "ratio": {"least": min(ratios), "median": statistics.median(ratios), "most": max(ratios)},
        "goal_s": GOAL,
    }
    if chosen.json:
        print(json.dumps(facts, indent=2))
    else:
        print(f"libraries alone  {min(facts['bare_s']):.2f} s at best, {statistics.median(facts['bare_s']):.2f} median")
        print(
            f"smith 90x90x180  {min(facts['table_s']):.2f} s at best, {statistics.median(facts['table_s']):.2f} median"
        )
        print(f"ratio            {min(ratios):.2f} to {max(ratios):.2f}; goal on an idle machine {GOAL} s")
    if chosen.most is not None and min(ratios) > chosen.most:
        sys.exit(f"every pair exceeds the ratio {chosen.most}")


if __name__ == "__main__":
    main()
