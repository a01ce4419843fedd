"""Random materials of random scenes over the whole registry: promised and true errors, run time and bytes saved.

    python benchmarks/random_scenes.py                  # 200 scenes three axes on the grid that users get
    python benchmarks/random_scenes.py --count 20 --models smith,ilm

Run times are from start to finish, planning and checks included, beside a full table at the same tolerance in the same
run; the first scene of a model compiles and is measured again. Exit status 1 where a promise is broken.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from random_scenes import scenes

from brdftab.scene import carry_out, plan_material, verify

# four axes and dielectrics coarser than by default: full tables take minutes there
GRIDS = ("90x90x180", "6x12x6x12", "16x16+16x32")


def main() -> None:
    """Draw, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--models", help="names with commas; all by default")
    parser.add_argument("--small", action="store_true", help="coarse grids")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    more = {} if chosen.small else {"grids": GRIDS}
    rows, seen = [], set()
    for one in scenes(chosen.count, chosen.seed, names=chosen.models and chosen.models.split(","), **more):
        kind = (one.model, one.quantity, one.grid)
        if kind not in seen:
            verify(one, carry_out(plan_material(one)), timed=True)
            seen.add(kind)
        table = carry_out(plan_material(one))
        found = verify(one, table, timed=True)
        size = table.provenance["plan"]["predicted"]
        row = {
            "model": one.model,
            "quantity": one.quantity,
            "tolerance": one.tolerance,
            "items": [item["name"] for item in table.provenance["plan"]["items"]],
            "time": found["seconds_unplanned"] / found["seconds"],
            "bytes": size["bytes_unplanned"] / size["bytes"],
            **found,
        }
        rows.append(row)
        if not chosen.json:
            promised = found["promised"]
            print(
                f"{one.model:18} {one.quantity:9} cell {found['cell_error']:.1e}/{promised['cell_error']:.1e}  albedo "
                f"{found['albedo_error']:.1e}/{promised['albedo_error']:.1e}  {'holds' if found['holds'] else 'BROKEN'}"
                f"  time {found['seconds_unplanned']:.2f}/{found['seconds']:.2f} s = {row['time']:.1f}  "
                f"bytes {row['bytes']:.0f}",
                flush=True,
            )
    broken = sum(not row["holds"] for row in rows)
    facts = {
        "scenes": len(rows),
        "broken": broken,
        "time": _quartiles([row["time"] for row in rows]),
        "bytes": _quartiles([row["bytes"] for row in rows]),
        "rows": rows,
    }
    if chosen.json:
        print(json.dumps(facts, indent=2))
    else:
        for name in ("time", "bytes"):
            low, middle, high = facts[name]
            print(f"saving in {name}: median {middle:.1f}, quartiles {low:.1f} and {high:.1f}")
        print(f"{broken} of {len(rows)} promises broken")
    sys.exit(1 if broken else 0)


def _quartiles(values: list[float]) -> list[float]:
    return statistics.quantiles(values, n=4) if len(values) > 1 else values * 3


if __name__ == "__main__":
    main()
