"""Random materials of random scenes over the whole registry: promised and true errors, run time and bytes saved.

    python benchmarks/random_scenes.py                  # 200 scenes on the grids that users get
    python benchmarks/random_scenes.py --count 20 --models smith,ilm
    python benchmarks/random_scenes.py --json scenes.jsonl --minutes 20        # goes on where it was stopped

A run time goes from the material to the file on disk: planning, checks and writing, beside the full table at the same
tolerance and its file; what models keep between calls is thrown away before each, compiled kernels are not. Of three
runs in turn the median counts, one where the full table takes more than two seconds. Grids are the defaults, but
coarser for four axes above ten seconds and for all else above about half a minute. Errors are those of every cell where
the full table takes less than two seconds, else of a thousand seeded cells. Exit status 1 where a promise is broken.
"""

from __future__ import annotations

import argparse
import functools
import json
import statistics
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from random_scenes import scenes

import brdftab
from brdftab.io import write
from brdftab.scene import carry_out, plan_material, verify
from brdftab.scene.execute import check
from brdftab.scene.plan import Plan
from brdftab.scene.scene import Material
from brdftab.tables.grid import Grid
from brdftab.tabulation.albedo_table import AlbedoTable, write_albedo

# three axes and both sides of a pane: the defaults; four axes of dear models are coarser than the default below
GRIDS = ("90x90x180", "6x12x6x12", "45x45+45x90")
FOUR, WAIT = "15x24x15x24", 10.0
# grids on which kernels are compiled and cells timed; and those of full tables that would take more seconds than this
SMALL, COARSE, DEAR = ("6x6x12", "3x4x3x4", "4x4+4x8"), ("30x30x60", "5x8x5x8", "16x16+16x32"), 30.0
LONG, SEEDS = 2.0, (11, 12, 13, 14)


def forget() -> None:
    """Throw away what models keep of earlier calls."""
    for name, module in list(sys.modules.items()):
        if name.startswith("brdftab.models."):
            for value in list(vars(module).values()):
                if isinstance(value, functools._lru_cache_wrapper):
                    value.cache_clear()


def stored(table: object, folder: Path) -> None:
    """Write a table of either kind to a new file."""
    path = folder / f"{len(list(folder.iterdir()))}.npz"
    (write_albedo if isinstance(table, AlbedoTable) else write)(table, path)


def full(one: Material) -> brdftab.Table:
    """Tabulate without a plan: who looks up albedos has a table of directions, too."""
    return brdftab.tabulate(one.model, one.grid, dtype=one.dtype, tolerance=one.tolerance, **one.parameters)


def timed(call: object, folder: Path) -> tuple[float, float, object]:
    """Return seconds of a call and of writing what it returns, and that."""
    forget()
    for path in folder.iterdir():
        path.unlink()
    started = time.perf_counter()
    table = call()  # type: ignore[operator]
    made = time.perf_counter()
    stored(table, folder)
    return made - started, time.perf_counter() - made, table


def measure(one: Material, folder: Path, warm: bool) -> dict[str, object]:
    """Make both tables and compare them."""
    kind = GRIDS.index(one.grid)
    small = replace(one, grid=SMALL[kind])
    if not warm:
        carry_out(plan_material(small))
        full(small)
    seconds = timed(functools.partial(full, small), folder)[0]
    if seconds > DEAR / 3.0:
        one = small
    else:
        coarse = replace(one, grid=COARSE[kind])
        # what a table takes whatever its size says nothing of larger ones
        more = timed(functools.partial(full, coarse), folder)[0] - seconds
        if seconds + more * Grid.resolve(one.grid).size / Grid.resolve(coarse.grid).size > DEAR:
            one = coarse

    def both() -> tuple[tuple[float, float, object], tuple[float, float, object]]:
        return timed(lambda: carry_out(plan_material(one)), folder), timed(lambda: full(one), folder)

    pairs = [both()]
    if one.grid == GRIDS[1] and 25.0 * pairs[0][1][0] < WAIT:
        # so many times as many cells
        one = replace(one, grid=FOUR)
        pairs = [both()]
    if sum(pairs[0][1][:2]) < LONG:
        pairs += [both(), both()]
    planned, whole = ([statistics.median(p[k][n] for p in pairs) for n in (0, 1)] for k in (0, 1))
    table = pairs[-1][0][2]
    plan = Plan.from_json(table.provenance["plan"])  # type: ignore[attr-defined]
    every = isinstance(table, AlbedoTable) or sum(whole) < LONG
    if every:
        found = verify(one, table)
        holds, error = found["holds"], max(found["cell_error"] / max(plan.cell_error, 1e-300), 0.0)
        if plan.cell_error == 0.0:
            error = found["albedo_error"] / plan.albedo_error
    else:
        seen = [check(table, plan, seed) for seed in SEEDS]
        error = max(s["estimate"] for s in seen) / plan.cell_error
        holds = error <= 1.0
    return {
        "model": one.model, "quantity": one.quantity, "grid": one.grid, "tolerance": one.tolerance,
        "items": [item.name for item in plan.items], "every_cell": every, "holds": bool(holds),
        "error_of_promise": error, "seconds": planned, "seconds_unplanned": whole,
        "time": sum(whole) / sum(planned), "without_writing": whole[0] / planned[0],
        "bytes": plan.predicted["bytes_unplanned"] / plan.predicted["bytes"],
    }  # fmt: skip


def main() -> None:
    """Draw, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--models", help="names with commas; all by default")
    parser.add_argument("--grooves", action="store_true", help="anisotropic V-grooves, too: minutes a table")
    parser.add_argument("--json", type=Path, help="file of results, a line each; appended")
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no scene after so long")
    chosen = parser.parse_args()
    rows = (
        [json.loads(line) for line in chosen.json.read_text().splitlines()]
        if chosen.json and chosen.json.exists()
        else []
    )
    started, warm = time.perf_counter(), set()
    with tempfile.TemporaryDirectory() as folder:
        drawn = scenes(
            chosen.count,
            chosen.seed,
            grids=GRIDS,
            names=chosen.models and chosen.models.split(","),
            grooves=chosen.grooves,
        )
        for number, one in enumerate(drawn):
            if number < len(rows):
                continue
            if time.perf_counter() - started > 60.0 * chosen.minutes:
                break
            kind = (one.model, one.quantity == "albedo", one.grid)
            row = measure(one, Path(folder), kind in warm)
            warm.add(kind)
            rows.append(row)
            if chosen.json:
                with chosen.json.open("a") as file:
                    file.write(json.dumps(row) + "\n")
            print(
                f"{row['model']:17} {row['quantity']:9} {row['grid']:11} error {row['error_of_promise']:.2f} of the "
                f"promise{'' if row['every_cell'] else ' (sampled)'}{'' if row['holds'] else ' BROKEN'}  time "
                f"{sum(row['seconds_unplanned']):.3f}/{sum(row['seconds']):.3f} s = {row['time']:.1f}  "
                f"bytes {row['bytes']:.0f}",
                flush=True,
            )
    for name, told in (("time", "run time, files written"), ("without_writing", "run time"), ("bytes", "bytes")):
        low, middle, high = statistics.quantiles([row[name] for row in rows], n=4)
        print(f"saving in {told}: median {middle:.2f}, quartiles {low:.2f} and {high:.2f}")
    broken = sum(not row["holds"] for row in rows)
    print(
        f"{broken} of {len(rows)} promises broken, {sum(row['every_cell'] for row in rows)} of them seen in every cell"
    )
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
