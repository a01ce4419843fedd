"""Raymond et al. 2016, scratches: time to fill 256 x 256 bins, at the error of the paper's rays."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks.papers.section import Cell, Scale, Section, Sheet, cite
from brdftab.bench.report import seconds
from brdftab.bench.timing import Timing, timed
from brdftab.scratch_layers.counted import BINS, counted, split
from brdftab.typing import Array

FINEST = 16384
# rays a bin of the paper
RAYS = 10_000


def _row(name: str, rays: int, flux: Array, truth: Array, took: Timing) -> tuple[Cell, ...]:
    error = float(np.abs(flux - truth).sum() / 2.0)
    times = (seconds(t) for t in (took.median, took.min, took.max, took.cpu_min))
    return name, rays, f"{error:.1e}", *times


def _times(text: str, scale: Scale) -> Sheet:
    bins = scale.of(BINS, 32)
    truth = split(text, scale.of(FINEST, 256), bins)
    rows: list[tuple[Cell, ...]] = []
    for rays in (64, 256, 512, 2048)[: scale.of(4, 1)]:
        flux = split(text, rays, bins)
        took = timed(partial(split, text, rays, bins), scale.repeats, 2.0)
        rows.append(_row("brdftab", rays, flux, truth, took))
    for name in ("random", "stratified"):
        rays = scale.of(RAYS, 256)
        flux = counted(text, rays, name == "stratified", bins)
        took = timed(partial(counted, text, rays, name == "stratified", bins), scale.repeats, 2.0)
        rows.append(_row(f"{name} rays, counted", rays, flux, truth, took))
    return Sheet(
        f"One scratch of {bins} x {bins} bins, profile {text}",
        ("method", "rays a bin", "L1 error of the flux", "median", "min", "max", "processor time"),
        rows,
    )


def section(scale: Scale) -> Section:
    """Measure what the paper states."""
    sheets = [_times(text, scale) for text in ("v:30", "quartic:1")[: scale.of(2, 1)]]
    known = Sheet(
        "Paper: 256 x 256 bins with 10,000 rays a bin",
        ("device", "time"),
        [("Nvidia GTX 680, CUDA", "100 to 300 ms, by profile")],
        (
            "The error is the L1 distance of the flux (F = 1) to a trace with 16,384 rays a bin; 2 is the largest "
            "possible. The paper states none; random rays counted as it describes have the error in the last rows.",
            "Ours keeps bounce orders and the cosines that any material needs; the paper's texture has neither.",
        ),
    )
    return Section("Raymond et al. 2016: scratches", cite("scratch"), [known, *sheets])
