"""Flux of a scratch by rays that are counted where they leave, and by brdftab's own rays: what the two are worth."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import exact_kernel
from brdftab.models.scratch.flux import aperture
from brdftab.models.scratch.profiles import Profile, parse
from brdftab.models.scratch.trace import trace
from brdftab.models.scratch.tracer import GROUPS, block_tops, path
from brdftab.typing import Array

BINS, CAP = 256, 64


@exact_kernel
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


def counted(text: str, rays: int, stratified: bool, bins: int = BINS) -> Array:
    """Return the flux matrix (M, M) of counted rays, with the symmetries of reciprocity and of the profile."""
    profile: Profile = parse(text)
    shape = profile.knots, profile.height, profile.slope, profile.bend
    out = np.zeros((bins, bins))
    side = math.isqrt(rays) // 4 if stratified else 0
    count_rays(shape, block_tops(*shape), bins, rays // side * side if side else rays, side, 1, out)
    flux = out * aperture(bins)[None, :]
    flux = 0.5 * (flux + flux.T)
    return np.asarray(0.5 * (flux + flux[::-1, ::-1]) if profile.symmetric else flux)


def split(text: str, rays: int, bins: int = BINS) -> Array:
    """Return the flux matrix (M, M) as brdftab traces it: intervals split between rays, F = 1."""
    return np.asarray(trace(parse(text), bins, rays).layers.sum(axis=0))
