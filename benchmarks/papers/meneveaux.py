"""Meneveaux et al. 2018, interfaced Lambertian: energy of single bounces (Fig. 7), cost, the approximate model."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.papers.section import Cell, Scale, Section, Sheet, cite
from brdftab.bench.methods import Kernel, filled
from brdftab.bench.report import seconds
from brdftab.bench.timing import timed
from brdftab.evaluation.albedo import albedo
from brdftab.evaluation.points import evaluate
from brdftab.models.resolve import resolve
from brdftab.quadrature import unit_gauss
from brdftab.tables.grid import Grid

SIGMAS = (0.1, 0.3, 0.5, 0.7, 1.0, 1.5)
IOR = 1.5
NODES = 16


def reflectance(sigma: float, bounces: str, nodes: int = NODES) -> float:
    """Return the share of uniform light that a surface with kd = 1 reflects, over all directions (Fig. 7)."""
    x, w = unit_gauss(nodes)
    # u = sin^2: the cosine-weighted mean over the hemisphere
    theta = np.arcsin(np.sqrt(x))
    found = albedo("ilm", theta, kd=1.0, ior=IOR, sigma=sigma, bounces=bounces)[:, 0]
    return float(w @ found)


def _figure_7(scale: Scale) -> Sheet:
    rows: list[tuple[Cell, ...]] = []
    nodes = scale.of(NODES, 4)
    for sigma in SIGMAS[:: scale.of(1, 5)]:
        single = reflectance(sigma, "1", nodes)
        full = "" if scale.quick else f"{reflectance(sigma, 'inf', nodes):.5f}"
        said = "less than 0.8" if sigma == 1.0 else "plot"
        rows.append((sigma, said, f"{single:.4f}", 1, full))
    return Sheet(
        "Fig. 7: reflectance for kd = 1, n_i 1.5, Beckmann",
        ("sigma", "single bounces, paper", "single bounces, ours", "all bounces, paper", "all bounces, ours"),
        rows,
        ("Paper: at sigma 1 more than 20 % of the light meets several facets; all bounces together must give 1.",),
    )


def _cost(scale: Scale) -> Sheet:
    grid = Grid.parse("6x6x12" if scale.quick else "45x45x90")
    rows: list[tuple[Cell, ...]] = []
    for sigma in (0.1, 0.3, 1.5)[: scale.of(3, 1)]:
        times = []
        for bounces in ("1", "2", "inf")[: scale.of(3, 1)]:
            setup = resolve("ilm", kd=[0.6, 0.5, 0.4], ior=IOR, sigma=sigma, bounces=bounces)
            kernel = filled(setup, grid, 1e-3, True)

            def work(make: Callable[[], Kernel] = kernel) -> None:
                make()()

            work()
            times.append(timed(work, min(3, scale.repeats), 2.0).min)
        rows.append((sigma, seconds(times[0]), *(f"{t / times[0]:.2f}" for t in times[1:]), *("",) * (3 - len(times))))
    return Sheet(
        f"Cost of several bounces: a table of {'x'.join(map(str, grid.shape))} RGB cells at tolerance 1e-3",
        ("sigma", "single bounces", "ratio, two", "ratio, all"),
        rows,
        (
            "Paper: 1.3 to 1.6 in a path tracer, by more rays with noise. Ours solves the cavity without noise, and is "
            "made anew for every table.",
        ),
    )


def body_errors(sigma: float, count: int) -> tuple[float, float]:
    """Return the RMS and the largest relative error of the closed form's body up to 75 degrees."""
    rng = np.random.default_rng(7)
    u = np.stack([(rng.permutation(count) + rng.random(count)) / count for _ in range(3)])
    top = math.radians(75.0)
    angles = top * u[0], top * u[1], math.pi * u[2]
    given: dict[str, Any] = {"kd": 1.0, "ior": IOR, "sigma": sigma, "components": True, "tolerance": 5e-4}
    parts: list[Any] = [evaluate(name, *angles, **given) for name in ("ilm", "ilm-approx")]
    exact, rough = (found["body"][:, 0] for found in parts)
    error = rough / exact - 1.0
    return float(math.sqrt(np.mean(error * error))), float(np.abs(error).max())


# RMS of the body with the best coefficients of the paper's own Eq. 33, by sigma; from docs/ilm-approx.md
BEST_EQ_33 = {0.1: 0.013, 0.3: 0.054, 1.0: 0.107}


def _approximate(scale: Scale) -> Sheet:
    grid = Grid.parse("4x4x8" if scale.quick else "16x16x32")
    rows: list[tuple[Cell, ...]] = []
    for sigma in (0.1, 0.3, 1.0, 1.5)[: scale.of(4, 1)]:
        rms, largest = body_errors(sigma, scale.of(1500, 30))
        times = []
        for model in ("ilm", "ilm-approx"):
            kernel = filled(resolve(model, kd=0.6, ior=IOR, sigma=sigma), grid, 1e-3, False)()
            kernel()
            times.append(timed(kernel, scale.repeats, 1.0).min / grid.size)
        known = f"{100.0 * BEST_EQ_33[sigma]:.1f} %" if sigma in BEST_EQ_33 else ""
        rows.append(
            (sigma, f"{100.0 * rms:.2f} %", f"{100.0 * largest:.1f} %", known, *map(seconds, times),
             f"{times[0] / times[1]:.0f}")
        )  # fmt: skip
    return Sheet(
        "The approximate model: error of the body up to 75 degrees, and its speed",
        ("sigma", "RMS, ours", "largest", "RMS, Eq. 33 at its best", "exact, a pair", "approximate, a pair", "faster"),
        rows,
        (
            "Paper: plots (Fig. 15), largest differences at large sigma and grazing angles; the coefficients are not "
            "public. Eq. 33 at its best is our fit of its two coefficients at each sigma, with an exact Lambertian "
            "factor.",
        ),
    )


def section(scale: Scale) -> Section:
    """Measure what the paper states."""
    sheets = [_figure_7(scale), _cost(scale), _approximate(scale)]
    return Section("Meneveaux et al. 2018: interfaced Lambertian microfacets", cite("ilm"), sheets)
