"""How well the registry's models follow measured materials: two tables, from the files of a folder.

    python benchmarks/real_materials.py FOLDER                   # RGL (EPFL) or MERL files, theta <= 75 degrees
    python benchmarks/real_materials.py FOLDER --only ilm,smith+lambert --json

The first table has the log-RMS of fits with the log residual, the second the RMS of log10(1 + f) of fits with that
residual (`--loss l1p`); the reciprocity floor of the data stands beside them, and the seconds of each fit apart from
compilation. A setting is a sum of models and fixed choices. The data are not part of the project; the six files of
docs/results.md come from the material database of EPFL's Realistic Graphics Lab (Dupuy and Jakob, An Adaptive
Parameterization for Efficient Material Acquisition and Rendering, 2018).
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

import brdftab

# what is fitted: a sum, and what is held besides
SETTINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "ilm": ("ilm", {"ndf": "ggx"}),
    "ilm beckmann": ("ilm", {"ndf": "beckmann"}),
    "ilm smith": ("ilm", {"ndf": "ggx", "masking": "smith"}),
    "smith+lambert": ("smith+lambert", {"ndf": "ggx"}),
    "smith+lambert beckmann": ("smith+lambert", {"ndf": "beckmann"}),
    "cook-torrance+lambert": ("cook-torrance+lambert", {"ndf": "ggx"}),
    "vgroove-sym+lambert": ("vgroove-sym+lambert", {"ndf": "ggx"}),
    "smith+oren-nayar": ("smith+oren-nayar", {"ndf": "ggx"}),
    "cook-torrance+oren-nayar": ("cook-torrance+oren-nayar", {"ndf": "ggx"}),
    "smith+ilm": ("smith+ilm", {"ndf": "ggx"}),
    "cook-torrance+ilm": ("cook-torrance+ilm", {"ndf": "ggx"}),
    "smith+smith+lambert": ("smith+smith+lambert", {"ndf": "ggx"}),
    "smith+smith+lambert beckmann second": ("smith+smith+lambert", {"smith.ndf": "ggx", "smith2.ndf": "beckmann"}),
    "smith+cook-torrance+lambert": ("smith+cook-torrance+lambert", {"ndf": "ggx"}),
    "smith+smith+oren-nayar": ("smith+smith+oren-nayar", {"ndf": "ggx"}),
    "smith+smith+ilm": ("smith+smith+ilm", {"ndf": "ggx"}),
}
# fitted with the residual of libbsdf, too
ALSO_L1P = ("smith+lambert", "ilm", "smith+smith+lambert")


def measure(file: Any, name: str, loss: str, chosen: argparse.Namespace) -> dict[str, Any]:
    """Fit one setting to one material."""
    model, fixed = SETTINGS[name]
    found = brdftab.fit_model(
        file,
        model,
        theta_max=math.radians(chosen.theta_max),
        loss=loss,
        samples=chosen.samples,
        starts=chosen.starts,
        fixed=fixed,
    )
    return {
        "setting": name,
        "loss": loss,
        "metrics": found.metrics,
        "bic": found.bic,
        "values": found.to_json()["values"],
        "starts": [found.starts["agreed"], found.starts["tried"]],
        "verdict": found.solver["verdict"],
        "seconds": found.times["total"],
        "compile": found.times["compile"],
        "directions": found.points["directions"],
        "left_out": found.points["left_out"],
        "warnings": found.warnings,
    }


def show(materials: list[str], rows: list[dict[str, Any]], loss: str, metric: str) -> None:
    """Print one table: a line a setting, a column a material, seconds of the slowest fit last."""
    width = max(len(r["setting"]) for r in rows)
    short = [m.removesuffix("_rgb").removeprefix("vch_").removeprefix("cc_") for m in materials]
    columns = [max(len(s), 8) for s in short]
    print(f"{metric} of fits with the residual {loss}")
    print(f"{'':<{width}}" + "".join(f"  {s:>{c}}" for s, c in zip(short, columns, strict=True)) + "  slowest")
    floors = {r["material"]: r["metrics"]["reciprocity_floor"] for r in rows}
    if loss == "log":
        shown = [f"{floors[m]:.3f}" if floors[m] is not None else "-" for m in materials]
        cells = "".join(f"  {s:>{c}}" for s, c in zip(shown, columns, strict=True))
        print(f"{'reciprocity floor':<{width}}{cells}")
    for name in dict.fromkeys(r["setting"] for r in rows if r["loss"] == loss):
        mine = {r["material"]: r for r in rows if r["setting"] == name and r["loss"] == loss}
        digits = 3 if metric != "l1p" else 4
        cells = "".join(
            f"  {mine[m]['metrics'][metric]:>{c}.{digits}f}" for m, c in zip(materials, columns, strict=True)
        )
        slowest = max(r["seconds"] for r in mine.values())
        print(f"{name:<{width}}{cells}  {slowest:>5.2f} s")
    print()


def main() -> None:
    """Fit everything and print two tables, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--theta-max", type=float, default=75.0, help="degrees")
    parser.add_argument("--samples", type=int, default=20000)
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--only", help="settings, separated by commas")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    files = sorted(p for p in chosen.folder.iterdir() if p.suffix in (".bsdf", ".binary"))
    if not files:
        parser.error(f"{chosen.folder} holds no .bsdf or .binary file")
    names = [n.strip() for n in chosen.only.split(",")] if chosen.only else list(SETTINGS)
    unknown = sorted(set(names) - set(SETTINGS))
    if unknown:
        parser.error(f"unknown setting {unknown[0]}; choose from {', '.join(SETTINGS)}")
    rows = []
    sources = {p.stem: brdftab.read(p) for p in files}
    for name in names:
        for loss in ("log", "l1p") if name in ALSO_L1P else ("log",):
            for material, source in sources.items():
                row = {"material": material, **measure(source, name, loss, chosen)}
                rows.append(row)
                print(
                    f"{name}, {loss}, {material}: log-RMS {row['metrics']['log_rms']:.4f}, l1p "
                    f"{row['metrics']['l1p']:.5f}, {row['starts'][0]} of {row['starts'][1]} starts, "
                    f"{row['seconds']:.2f} s + {row['compile']:.1f} s",
                    file=sys.stderr,
                )
    if chosen.json:
        print(json.dumps(rows, indent=2))
        return
    for loss, metric in (("log", "log_rms"), ("log", "logeps"), ("l1p", "l1p")):
        if any(r["loss"] == loss for r in rows):
            show(list(sources), rows, loss, metric)


if __name__ == "__main__":
    main()
