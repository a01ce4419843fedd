"""Other programs on the same work, in the same run: Mitsuba 3 for a single bounce, SciPy for a fit."""

from __future__ import annotations

import importlib.util
from typing import Any

from benchmarks.papers.section import Cell, Scale, Section, Sheet
from brdftab.bench.report import seconds
from brdftab.bench.run import benchmark

GOLD: dict[str, Any] = {"eta": [0.143, 0.375, 1.442], "k": [3.983, 2.386, 1.603]}
MASKINGS = {"ggx": "separable", "beckmann": "smith-walter"}


def _mitsuba(scale: Scale) -> tuple[Sheet, list[str]]:
    rows: list[tuple[Cell, ...]] = []
    missing: list[str] = []
    grid = "6x6x12" if scale.quick else "32x32x64"
    for ndf, masking in MASKINGS.items():
        found = benchmark("smith", grid, quick=True, repeats=scale.repeats, seconds=1.0, ndf=ndf, alpha=0.3,
                          masking=masking, **GOLD)  # fmt: skip
        missing = [f"{left['name']}: {left['reason']}" for left in found["left_out"] if "mitsuba" in left["name"]]
        shown = [r for r in found["methods"] if r["family"] in ("direct", "prepared float32") or r["peer"]]
        for row in shown:
            took = row["kernel_s"]
            rows.append(
                (ndf, row["name"], f"{row['error']['max']:.1e}", *(seconds(took[k]) for k in ("median", "min", "max")),
                 seconds(took["min"] / found["pairs"]))
            )  # fmt: skip
    sheet = Sheet(
        f"smith (gold, alpha 0.3, RGB) and Mitsuba's roughconductor on {grid} directions",
        ("distribution", "method", "largest error", "median", "min", "max", "a pair"),
        rows,
        (
            "Errors against our direct rule in float64. Mitsuba computes in float32; scalar_rgb is called pair by pair "
            "from Python, which is most of its time; values are copied to NumPy.",
        ),
    )
    return sheet, missing


def _scipy(scale: Scale) -> Sheet:
    from benchmarks.scipy_fits import compare, make

    found = compare(make(scale.of(20_000, 500)), min(3, scale.repeats))
    rows: list[tuple[Cell, ...]] = [
        (name, seconds(found["wall_s"][key]["min"]), seconds(found["wall_s"][key]["median"]),
         seconds(found["cpu_s"][key]), starts)
        for name, key, starts in (("brdftab", "ours", 8), ("scipy.optimize.least_squares (trf)", "scipy", 1))
    ]  # fmt: skip
    return Sheet(
        f"A fit of ilm to {found['points']} MERL-like points, RGB, five parameters",
        ("method", "min", "median", "processor time", "starts"),
        rows,
        (
            "The same twin, rule and residual; SciPy gets the engine's first start and the twin's forward Jacobian. "
            f"Largest difference of a parameter: {found['apart_in_standard_errors']:.3f} standard errors.",
        ),
    )


def section(scale: Scale) -> Section:
    """Measure other programs where they are installed; a line says what is missing."""
    found = Section("Other programs in the same run", "Mitsuba 3 (Jakob et al. 2022), SciPy (Virtanen et al. 2020)")
    if not scale.peer:
        return found
    sheet, missing = _mitsuba(scale)
    found.sheets.append(sheet)
    found.missing.extend(missing)
    if importlib.util.find_spec("scipy") is None:
        found.missing.append("scipy is not installed; pip install scipy")
    else:
        found.sheets.append(_scipy(scale))
    return found
