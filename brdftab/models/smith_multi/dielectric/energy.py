"""Directional albedo of all bounces, reflected and transmitted: the solver's mode 0 alone.

The first bounce is integrated over panels of its own, whose edges are where the light of one direction meets total
reflection or grazes its facets; what scatters on is smooth and is left to the states that all directions share.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.models._shared.random_walk.refraction import weight
from brdftab.models.resolve import Setup
from brdftab.models.smith_multi.dielectric.levels import Level, energy_levels
from brdftab.models.smith_multi.dielectric.solve import SWEEPS, System, sweep
from brdftab.typing import Array

# directions solved together
GROUP = 32
# the series ends where a bounce adds less than this to every albedo
SMALL = 1e-12
# sine of directions that have panels of their own beyond the first bounce, too
STEEP = 0.1
# how panels close in on such an edge, in p
CLOSER = 0.02 * 0.2 ** np.arange(5)


def _leaving(system: System) -> tuple[Array, Array]:
    """Return what a state's light brings out of the surface, |p| of those that leave; (above, below)."""
    return np.maximum(system.above.p, 0.0), np.maximum(-system.below.p, 0.0)


def _start(system: System) -> Array:
    """Return 1/(|p| (1 + Lambda)) of the directions (D,)."""
    v = system.views
    index = np.where(v.below, system.n, 1.0)
    rows = zip(v.s / index, v.p / index, index, strict=True)
    return np.array([weight(system.ndf, system.alpha, s, c) / k for s, c, k in rows])


def _kinks(theta: float, n: float) -> Array:
    """Return p of the states where the light of one direction starts or ends to be reflected totally, or to pass."""
    below = theta > 0.5 * math.pi
    away = math.pi - theta if below else theta
    turn = 2.0 * math.asin(1.0 / n)
    bent = math.acos(1.0 / n)
    # in the plane of incidence, as angles from the vertical: reflected by pi minus turn, refracted by at most bent
    steps = np.array([away + math.pi - turn, away - math.pi + turn]) if below else np.zeros(0)
    other = 1.0 if below else n
    passed = np.array([away + bent, away - bent])
    at = np.concatenate([(n if below else 1.0) * np.cos(steps), other * np.cos(passed)])
    # F falls like a root behind them
    return (at[:, None] + np.concatenate([-CLOSER, [0.0], CLOSER])).ravel()


def _first(theta: float, n: float, ndf: int, alpha: float, fine: Level) -> tuple[float, float]:
    """Return what leaves above and below after one bounce of light from one direction."""
    system = System(np.array([theta]), n, ndf, alpha, fine, _kinks(theta, n))
    m = system.rows(0, 1)
    up, down = _leaving(system)
    factor = _start(system)[0]
    return factor * float(m[0][0, 0] @ (system.above.weights * up)), factor * float(
        m[1][0, 0] @ (system.below.weights * down)
    )


def _further(system: System, most: float) -> tuple[Array, Array]:
    """Return what leaves above and below (D,) after two bounces and more, up to `most`."""
    m = system.matrices(0, 1)
    weights = system.above.weights, system.below.weights
    up, down = _leaving(system)
    upper, lower = m.rows_above, m.rows_below
    above, below = np.zeros(system.views.p.size), np.zeros(system.views.p.size)
    for _ in range(int(min(most - 1, SWEEPS))):
        upper, lower = sweep(m, weights, upper, lower)
        a, b = upper[0] @ (weights[0] * up), lower[0] @ (weights[1] * down)
        above += a
        below += b
        if max(a.max(), b.max()) < SMALL:
            break
    first = _start(system)
    return above * first, below * first


def _albedo(theta: Array, n: float, setup: Setup, shared: Level, fine: Level) -> tuple[Array, Array]:
    """Return reflected and transmitted albedo (D,) of one index."""
    surface = n, setup.ndf, setup.alpha_x
    most = math.inf if setup.max_bounces is None else setup.max_bounces
    up, down = np.zeros(theta.size), np.zeros(theta.size)
    for start in range(0, theta.size, GROUP):
        some = slice(start, start + GROUP)
        # only near the normal does an edge meet all azimuths at once
        steep = [_kinks(float(angle), n) for angle in theta[some] if math.sin(angle) < STEEP]
        system = System(theta[some], *surface, shared, np.concatenate([np.zeros(0), *steep]))
        up[some], down[some] = _further(system, most)
    for k, angle in enumerate(theta):
        a, b = _first(float(angle), *surface, fine)
        up[k] += a
        down[k] += b
    below = theta > 0.5 * math.pi
    return np.where(below, down, up), np.where(below, up, down)


def split_albedo(setup: Setup, theta_i: Array, tolerance: float) -> tuple[Array, Array]:
    """Return what a surface reflects and what it transmits of the light from N directions.

    Parameters
    ----------
    setup : Setup
        An isotropic dielectric.
    theta_i : ndarray (N,)
        Radians in [0, pi]; light from below beyond pi/2.
    tolerance : float
        Error of R + T that is asked for.

    Returns
    -------
    tuple of ndarray (N, C)
        R and T of all bounces, up to max_bounces: int f |cos theta_o| over the light's side, and over the other one.
    """
    assert setup.fresnel is not None
    shared, fine = energy_levels(tolerance, setup.alpha_x)
    theta, at = np.unique(np.asarray(theta_i, dtype=np.float64), return_inverse=True)
    index, channel = np.unique(np.broadcast_to(setup.fresnel.a, len(setup.channels)), return_inverse=True)
    both = np.stack([np.stack(_albedo(theta, float(n), setup, shared, fine)) for n in index], axis=-1)
    reflected, transmitted = both[:, at][..., channel]
    return reflected, transmitted


def albedo(setup: Setup, theta_i: Array, tolerance: float) -> Array:
    """Return R + T of all bounces (N, C); see `split_albedo`."""
    reflected, transmitted = split_albedo(setup, theta_i, tolerance)
    return reflected + transmitted
