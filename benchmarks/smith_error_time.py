"""Error against run time of all-bounce Smith tables: solver, pt, bdpt and the random walk, side by side.

Prints JSON; --figure FILE draws it. Relative errors are the root mean square over stratified cells of a 90x90x180
table (F = 1, GGX). The solver is held against its own run at tolerance 1e-7, pt and bdpt too. The random walk has
another masking by design, so its error is its standard error. CPU seconds of a table are measured for the solver and
for pt with path reuse; those of estimates cell by cell are the time of the stratified cells scaled to all cells. The
time that an estimator needs for a smaller error is extrapolated as error^-2.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace

import numpy as np

from brdftab import models
from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import resolve
from brdftab.tables.grid import Grid
from brdftab.tabulation.error_estimate import cell_angles, stratified_cells

ALPHAS = (0.1, 0.2, 0.5, 1.0)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
SAMPLES = (64, 512, 4096)
GRID = Grid.parse("90x90x180")
CELLS = 512


def cpu(work):
    """Return a function's result and the CPU seconds of all its threads."""
    started = time.process_time()
    found = work()
    return found, time.process_time() - started


def rms(found, reference):
    """Return the root mean square of the relative error."""
    return float(np.sqrt(np.mean(((found - reference) / reference) ** 2)))


def solver_points(setup, angles, cells, reference):
    """Return error and CPU time of whole tables for each tolerance, and the table of the finest one."""
    rows = []
    out = np.empty((1, *GRID.shape, 1), dtype=np.float32)
    for tolerance in TOLERANCES:
        Engine(setup, tolerance).fill(GRID.theta_i, GRID.theta_o, GRID.phi, out)

        def work(tolerance=tolerance):
            Engine(setup, tolerance).fill(GRID.theta_i, GRID.theta_o, GRID.phi, out)

        seconds = min(cpu(work)[1] for _ in range(2))
        rows.append({"tolerance": tolerance, "cpu_s": seconds, "error": rms(out[0][tuple(cells.T)][:, 0], reference)})
    return rows


def estimator_points(setup, angles, reference):
    """Return error and CPU time, scaled to all cells, for each number of samples; no reference: the standard error."""
    rows = []
    module = models.kernel(setup.model.name)
    for samples in SAMPLES:
        fixed = replace(setup, values={**setup.values, "samples": samples})
        module.estimates(replace(setup, values={**setup.values, "samples": 1}), *angles, orders=0, tolerance=0.5)
        found, seconds = cpu(lambda fixed=fixed: module.estimates(fixed, *angles, orders=0, tolerance=0.5))
        value, spread = found.values[:, 0, 0], found.standard_error[:, 0]
        error = rms(value, reference) if reference is not None else float(np.sqrt(np.mean((spread / value) ** 2)))
        rows.append({"samples": samples, "cpu_s": seconds * GRID.size / len(value), "error": error})
    return rows


def reused_points(setup, cells, reference, samples=16):
    """Return error and CPU time of one pt table, whose paths serve all views of a light."""
    module = models.kernel(setup.model.name)
    fixed = replace(setup, values={**setup.values, "samples": samples})
    options = {"orders": 0, "tolerance": 0.5, "progress": None}
    found, seconds = cpu(lambda: module.estimate_table(fixed, GRID.axes, **options))
    return {"samples": samples, "cpu_s": seconds, "error": rms(found.values[0][tuple(cells.T)][:, 0], reference)}


def advantage(solver, rows):
    """Return how many times the solver's CPU time an estimator needs for the error of its 1e-4 table."""
    aim = next(row for row in solver if row["tolerance"] == 1e-4)
    last = rows[-1]
    return last["cpu_s"] * (last["error"] / aim["error"]) ** 2 / aim["cpu_s"]


def measure(alpha):
    """Return error and CPU time of every method on one mirror-like surface."""
    cells = stratified_cells(GRID, CELLS)
    angles = [np.ascontiguousarray(a) for a in cell_angles(GRID, cells)]
    surface = {"ndf": "ggx", "alpha": alpha, "material": "mirror"}
    setup = resolve("smith-multi", **surface)
    reference = Engine(setup, 1e-7, fast=False).points(*angles)[:, 0, 0]
    solver = solver_points(setup, angles, cells, reference)
    result = {"alpha": alpha, "solver": solver, "advantage": {}}
    for name in ("pt", "bdpt"):
        rows = estimator_points(resolve("smith-multi", estimator=name, **surface), angles, reference)
        result[name] = rows
        result["advantage"][name] = advantage(solver, rows)
    result["walk"] = estimator_points(resolve("smith-walk", **surface), angles, None)
    result["advantage"]["walk"] = advantage(solver, result["walk"])
    result["pt_reused"] = [reused_points(resolve("smith-multi", estimator="pt", **surface), cells, reference)]
    result["advantage"]["pt_reused"] = advantage(solver, result["pt_reused"])
    return result


def draw(results, path):
    """Draw error against CPU seconds, an axis a roughness."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(results), figsize=(4 * len(results), 4), sharey=True, squeeze=False)
    for axis, result in zip(axes[0], results, strict=True):
        for name in ("solver", "pt", "bdpt", "walk", "pt_reused"):
            rows = result[name]
            axis.loglog([r["cpu_s"] for r in rows], [r["error"] for r in rows], "o-", label=name.replace("_", ", "))
        axis.set_title(f"GGX, alpha = {result['alpha']:g}")
        axis.set_xlabel("CPU seconds a table")
        axis.grid(alpha=0.3)
    axes[0][0].set_ylabel("relative error (rms)")
    axes[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def main():
    """Measure, print JSON, and draw if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--alphas", default=",".join(map(str, ALPHAS)), help="roughnesses, separated by commas")
    parser.add_argument("--figure", help="draw the curves to this file")
    options = parser.parse_args()
    results = [measure(float(alpha)) for alpha in options.alphas.split(",")]
    json.dump({"grid": "90x90x180", "cells": CELLS, "results": results}, sys.stdout, indent=1)
    print()
    if options.figure:
        draw(results, options.figure)


if __name__ == "__main__":
    main()
