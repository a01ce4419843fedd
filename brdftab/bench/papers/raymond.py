"""Raymond et al. 2016, scratches: time to fill 256 x 256 bins, at the error of the paper's rays."""

from __future__ import annotations

import math
from functools import partial

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab.bench.papers.section import Cell, Scale, Section, Sheet, cite
from brdftab.bench.report import seconds
from brdftab.bench.timing import Timing, timed
from brdftab.models.scratch.flux import aperture
from brdftab.models.scratch.profiles import Profile, parse
from brdftab.models.scratch.trace import trace
from brdftab.models.scratch.tracer import GROUPS, block_tops, path

Array = NDArray[np.float64]
BINS, CAP = 256, 64
FINEST = 65536
# rays a bin of the paper
RAYS = 10_000


@numba.njit(parallel=True, cache=True)
def count_rays(shape: tuple[Array, ...], tops: Array, bins: int, rays: int, side: int, seed: int, out: Array) -> None:
    """Fill out (M, M), exit by incident bin, with shares of rays; side > 0: strata a side instead of random rays."""
    for j in numba.prange(bins):
        np.random.seed(seed + j)
        low, high = math.sin(math.pi * (j / bins - 0.5)), math.sin(math.pi * ((j + 1.0) / bins - 0.5))
        cosines, ray = np.empty(CAP), np.empty(3 + GROUPS)
        for n in range(rays):
            u, v = np.random.random(), np.random.random()
            if side > 0:
                u, v = (n // side + u) * side / rays, (n % side + v) / side
            sine = low + (high - low) * v
            path(shape, tops, 2.0 * u - 1.0, sine, math.sqrt(1.0 - sine * sine), cosines, ray)
            if ray[2] > 0.0:
                out[min(int((ray[1] / math.pi + 0.5) * bins), bins - 1), j] += 1.0 / rays


def counted(profile: Profile, rays: int, stratified: bool, bins: int = BINS) -> Array:
    """Return the flux matrix of counted rays, symmetrised and, of a symmetric profile, mirrored."""
    shape = profile.knots, profile.height, profile.slope, profile.bend
    out = np.zeros((bins, bins))
    side = math.isqrt(rays) // 4 if stratified else 0
    count_rays(shape, block_tops(*shape), bins, rays // side * side if side else rays, side, 1, out)
    flux = out * aperture(bins)[None, :]
    flux = 0.5 * (flux + flux.T)
    return np.asarray(0.5 * (flux + flux[::-1, ::-1]) if profile.symmetric else flux)


def _row(name: str, rays: int, flux: Array, truth: Array, took: Timing) -> tuple[Cell, ...]:
    error = float(np.abs(flux - truth).sum() / 2.0)
    return name, rays, f"{error:.4f}", seconds(took.median), seconds(took.min), seconds(took.max)


def _times(text: str, scale: Scale) -> Sheet:
    profile, bins = parse(text), scale.of(BINS, 32)
    truth = trace(profile, bins, scale.of(FINEST, 256)).layers.sum(axis=0)
    rows: list[tuple[Cell, ...]] = []
    for rays in (64, 256, 512, 2048)[: scale.of(4, 1)]:
        flux = trace(profile, bins, rays).layers.sum(axis=0)
        took = timed(partial(trace, profile, bins, rays), scale.repeats, 2.0)
        rows.append(_row("brdftab", rays, flux, truth, took))
    for name in ("random", "stratified"):
        rays = scale.of(RAYS, 256)
        flux = counted(profile, rays, name == "stratified", bins)
        took = timed(partial(counted, profile, rays, name == "stratified", bins), scale.repeats, 2.0)
        rows.append(_row(f"{name} rays, counted", rays, flux, truth, took))
    return Sheet(
        f"One scratch of {bins} x {bins} bins, profile {text}",
        ("method", "rays a bin", "L1 error of the flux", "median", "min", "max"),
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
            "The error is the L1 distance of the flux (F = 1) to a trace with 65,536 rays a bin; 2 is the largest "
            "possible. The paper states none; random rays counted as it describes have the error in the last rows.",
            "Ours keeps bounce orders and the cosines that any material needs; the paper's texture has neither.",
        ),
    )
    return Section("Raymond et al. 2016: scratches", cite("scratch"), [known, *sheets])
