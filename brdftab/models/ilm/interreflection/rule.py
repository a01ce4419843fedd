"""Resolution of the cavity's quadratures, and the coefficients that join light and view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from brdftab.models._shared.codes import GGX
from brdftab.models._shared.fresnel.interface import body_factor
from brdftab.models.ilm.interreflection.exchange import exchange, unit_rule
from brdftab.models.ilm.interreflection.light import recurrence
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# beyond this stretched slope Beckmann facets are rarer than 1e-9
FARTHEST = 4.6
# tilts closer than this to a right angle are not told apart from it
STEEPEST = 1e-7


@dataclass(frozen=True)
class Rule:
    """How finely the cavity is resolved.

    Attributes
    ----------
    rings : int
        Tilts of the facets.
    azimuths : int
        Steps in a quarter of the circle.
    functions : int
        Legendre functions on a facet, for even and for odd distributions of light each.
    modes : int
        Fourier modes in azimuth.
    knots : int
        Polar angles of the interpolant that serves many unrelated directions.
    """

    rings: int
    azimuths: int
    functions: int
    modes: int
    knots: int


def rule(tolerance: float) -> Rule:
    """Return the resolution for a relative tolerance; below 1e-5 the error hardly falls any more."""
    digits = max(-math.log10(tolerance) - 3.0, -1.0)
    # every digit up to 1e-5 costs its nodes; beyond, two more digits still change the rule visibly
    scale = min(digits, 2.0) + 0.1 * max(digits - 2.0, 0.0)
    azimuths = math.ceil(28 * 2.0**scale)
    return Rule(
        rings=math.ceil(24 * 2.0**scale),
        azimuths=azimuths,
        functions=math.ceil(14 + 4 * scale),
        modes=2 * azimuths,
        knots=math.ceil(48 * 1.6**scale),
    )


@lru_cache(maxsize=16)
def stretched_rings(ndf: int, count: int) -> tuple[Array, Array]:
    """Return slopes (count,) in units of the roughness, and weights of int D cos(tilt) domega, which add up to 1."""
    x, w = unit_rule(count)
    if ndf == GGX:
        psi = 0.5 * math.pi * x * x * (3.0 - 2.0 * x)
        return np.tan(psi), w * 3.0 * math.pi * x * (1.0 - x) * np.sin(2.0 * psi)
    slope = FARTHEST * x**1.5
    return slope, w * 3.0 * FARTHEST * np.sqrt(x) * slope * np.exp(-slope * slope)


def steepness(slope: Array) -> tuple[Array, Array, Array]:
    """Return tilt, its sine and its cosine for slopes of any shape."""
    tilt = np.minimum(np.arctan(slope), 0.5 * math.pi - STEEPEST)
    return tilt, np.sin(tilt), np.cos(tilt)


@dataclass(frozen=True)
class Channels:
    """Albedo and index of every channel, and the distinct indices among them."""

    kd: Array
    index: Array
    distinct: tuple[float, ...]

    @classmethod
    def of(cls, setup: Setup) -> Channels:
        """Read a setup, spreading a single value over all channels."""
        assert setup.fresnel is not None
        shape = (len(setup.channels),)
        index = np.broadcast_to(np.asarray(setup.fresnel.a, dtype=np.float64), shape)
        kd = np.broadcast_to(np.asarray(setup.values["kd"], dtype=np.float64), shape)
        return cls(kd, index, tuple(float(n) for n in np.unique(index)))

    def sharing(self, n: float) -> list[int]:
        """Return the channels that have index n."""
        return [c for c in range(self.kd.size) if self.index[c] == n]


def set_count(two: bool) -> int:
    """Return how many sets of light `cavity_light.lit` writes."""
    return 3 if two else 2


def couplings(eigenvalues: Array, kd: float, n: float, two: bool) -> Array:
    """Return what multiplies light and view in every set and eigenfunction so that the sum is two hits and more.

    With kappa the factor of the body, W the light of all chains, D the direct and M the once mirrored light, and mu the
    eigenvalues, all bounces are kappa W (1 - kappa mu)^-1 W - kappa D D and two bounces are
    kappa (D M + M D) + kappa^2 mu D D = kappa ((D + M)(D + M) - D D - M M) + kappa^2 mu D D.

    Parameters
    ----------
    eigenvalues : ndarray (...)
        From `cavity_exchange.exchange`.
    kd, n : float
        Albedo of the body and index of the interface.
    two : bool
        Stop after two hits.

    Returns
    -------
    ndarray (S, ...)
    """
    kappa = float(body_factor(kd, n))
    flat = np.full_like(eigenvalues, kappa / math.pi)
    if two:
        return np.stack([flat, flat * (kappa * eigenvalues - 1.0), -flat])
    return np.stack([flat / (1.0 - kappa * eigenvalues), -flat])


@lru_cache(maxsize=6)
def exchange_of(slopes: bytes, n: float, two: bool, size: int) -> tuple[Array, Array, Array]:
    """Return eigenvalues (R, 2, N), eigenvectors (R, 2, N, N) and the recurrence for slopes given as bytes."""
    steps = recurrence(size)
    values, vectors = exchange(steepness(np.frombuffer(slopes))[0], n, 0 if two else 1_000_000, steps)
    return values, vectors, steps
