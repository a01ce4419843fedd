"""A traced scratch: flux by bounce order between bins of angle, ready for any material."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from brdftab.materials.fresnel import Fresnel
from brdftab.models.scratch import shade
from brdftab.models.scratch.flux import aperture, assemble, edges
from brdftab.models.scratch.profiles import Profile, parse
from brdftab.models.scratch.shoot import CLASSES, KEPT, LAYERS, shoot
from brdftab.models.scratch.tracer import block_tops
from brdftab.typing import Array

BINS, CAP = 256, 64
# rays a column at tolerances down to these
RAYS = ((1e-3, 512), (1e-5, 2048), (0.0, 4096))
GOLDEN = 0.6180339887498949


@dataclass(frozen=True, eq=False)
class Traced:
    """What rays through a scratch leave behind.

    Attributes
    ----------
    profile : Profile
        The cross-section.
    rays : int
        Rays a column.
    cap : int
        Largest number of bounces.
    layers : float64 (L, M, M)
        Flux by layer, exit and incident bin: the first is order 1, then three classes an order (see `shoot`).
    facts : float32 (L, 7, M, M)
        What `shade` needs of each entry.
    lost : float64 (M,)
        Share of a column that the cap cuts off.
    deviation : float
        Largest relative deviation of a column's sum from what energy asks.
    change : float64 (M,)
        Factors of the scaling that mended energy.
    """

    profile: Profile
    rays: int
    cap: int
    layers: Array
    facts: NDArray[np.float32]
    lost: Array
    deviation: float
    change: Array

    def __repr__(self) -> str:
        return f"Traced({self.profile.text}, {self.bins} bins, {self.rays:,} rays a bin, cap {self.cap})"

    @property
    def bins(self) -> int:
        """Number M of bins of angle across the scratch."""
        return self.lost.size

    @cached_property
    def phi_edges(self) -> Array:
        """Edges (M + 1,) of the bins of angle, radians."""
        return edges(self.bins)

    @cached_property
    def aperture(self) -> Array:
        """Integral of the cosine over each bin (M,), 2 in all."""
        return aperture(self.bins)

    @cached_property
    def flux(self) -> Array:
        """Flux (5, M, M) by bounce order (1 to 4, and more), exit and incident bin; F = 1."""
        starts = [0, *range(1, LAYERS, CLASSES)]
        return np.add.reduceat(self.layers, starts, axis=0)

    @cached_property
    def cumulative(self) -> Array:
        """Sums over exit bins (M, M + 1) of each incident bin's flux, from 0 to 1; 0 where no light comes back."""
        total = self.layers.sum(axis=0).T
        sums = np.concatenate([np.zeros((self.bins, 1)), np.cumsum(total, axis=1)], axis=1)
        return np.divide(sums, sums[:, -1:], out=np.zeros_like(sums), where=sums[:, -1:] > 0.0)

    @cached_property
    def entries(self) -> shade.Entries:
        """The entries that hold light."""
        return shade.entries(self.layers, self.facts, self.profile.symmetric)

    def shaded(self, t: float, fresnel: Fresnel) -> Array:
        """Return rho (M, M, C) in 1/rad, by exit and incident bin, with Fresnel at the angle t along the scratch."""
        return shade.shaded(self.entries, self.aperture, t, fresnel)

    def reflected(self, t: float, fresnel: Fresnel) -> Array:
        """Return the share (M, C) of each incident bin's light that leaves, at the angle t along the scratch."""
        return np.einsum("kjc,k->jc", self.shaded(t, fresnel), self.aperture)


def rays_for(tolerance: float) -> int:
    """Return how many rays a column serve a tolerance."""
    return next(rays for least, rays in RAYS if tolerance >= least)


def trace(profile: Profile, bins: int = BINS, rays: int = RAYS[0][1], cap: int = CAP, shift: float = 0.0) -> Traced:
    """Trace a scratch.

    Parameters
    ----------
    profile : Profile
        The cross-section.
    bins : int
        Bins of angle across the scratch, [8, 512].
    rays : int
        Rays a column, shared among angles within the bin; intervals between rays that differ get more.
    cap : int
        Largest number of bounces.
    shift : float
        Other values start the rays elsewhere, for an independent result.
    """
    # an independent result has other angles as well as other places
    angles = max(1, round(math.sqrt(rays / 32.0))) + (shift != 0.0)
    strata = max(1, round(rays / angles))
    offsets = ((np.arange(angles) + 0.5) * GOLDEN + shift) % 1.0
    shape = profile.knots, profile.height, profile.slope, profile.bend
    counts = np.empty((bins, LAYERS, bins, KEPT))
    lost = np.zeros(bins)
    half = bins // 2 if profile.symmetric else 0
    shoot(shape, block_tops(*shape), offsets, strata, cap, half, counts, lost)
    if profile.symmetric:
        lost[:half] = lost[::-1][:half]
    layers, facts, deviation, change = assemble(counts, lost, profile.symmetric)
    return Traced(profile, rays, cap, layers, facts, lost, deviation, change)


@lru_cache(maxsize=8)
def traced(text: str, bins: int, rays: int, cap: int) -> Traced:
    """Return the traced scratch of a profile's name, kept for the next call."""
    return trace(parse(text), bins, rays, cap)


def distance(one: Traced, other: Traced) -> float:
    """Return the L1 distance of two traced scratches: the share of the flux that goes elsewhere, twice."""
    return float(np.abs(one.layers.sum(axis=0) - other.layers.sum(axis=0)).sum() / 2.0)
