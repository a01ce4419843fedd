"""Fewer bounces where both directions are steep: multiple scattering shows at grazing angles first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import ORDERS, is_stochastic
from brdftab.models.resolve import Setup
from brdftab.scene.plan import SHARES, Item, Plan
from brdftab.scene.simplify import SAFETY
from brdftab.scene.subgrid import part
from brdftab.scene.test_pairs import EXACT, Probes
from brdftab.tables.grid import Grid
from brdftab.typing import Array

# (largest polar angle in radians, bounces that are enough where light and view stay within it), steepest first
Zones = tuple[tuple[float, int], ...]
Draw = Callable[[Grid], Probes]
# a zone with a smaller share of the pairs is not worth its share of the error; times decide nothing, for they vary
LEAST = 0.02
# how often a zone is narrowed until probes of its own find nothing
NARROWED = 4
# by how much where averages over cells miss what is allowed, which do not say where
NARROWER = 0.8


def capped(setup: Setup, bounces: int) -> Setup:
    """Return the setup with a cap of its bounces; luminance stays luminance."""
    return replace(setup, max_bounces=bounces, parameters={**setup.parameters, "max_bounces": bounces})


class Zoned(Engine):
    """Evaluates each pair of directions with as many bounces as its zone takes, directly.

    Parameters
    ----------
    setup : Setup
        For pairs outside all zones.
    tolerance : float
        Relative error asked.
    zones : tuple
        See `Zones`.
    """

    def __init__(self, setup: Setup, tolerance: float, zones: Zones) -> None:
        super().__init__(setup, tolerance, fast=False)
        self._zones = [(limit, Engine(capped(setup, cap), tolerance, fast=False)) for limit, cap in zones]

    def points(self, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Return (N, 1, C) in 1/sr at N pairs of directions, 1-D arrays in radians."""
        angles = tuple(np.broadcast_arrays(theta_i, theta_o, phi, phi_i))
        steep, left = np.maximum(angles[0], angles[1]), np.ones(angles[0].size, dtype=bool)
        found = np.empty((left.size, 1, len(self.setup.channels)))
        for limit, engine in self._zones:
            inside = left & (steep <= limit + 1e-9)
            if inside.any():
                found[inside] = engine.points(*(a[inside] for a in angles))
            left &= ~inside
        if left.any():
            found[left] = super().points(*(a[left] for a in angles))
        return found


def engine(setup: Setup, plan: Plan) -> Engine:
    """Return what fills the table of a plan."""
    return Zoned(setup, plan.rules, plan.zones) if plan.zones else Engine(setup, plan.rules)


def within(grid: Grid, limit: float) -> Grid | None:
    """Return the part of a grid whose polar angles stay within a limit, or None without any."""
    kept = {name: np.flatnonzero(grid.axes[name] <= limit + 1e-9) for name in ("theta_i", "theta_o")}
    return part(grid, kept) if all(index.size for index in kept.values()) else None


def _errors(setup: Setup, probes: Probes, tolerance: float, cap: int) -> tuple[Array, Array]:
    """Return the error (N,) of leaving out the orders beyond a cap, and the larger polar angle (N,) of each pair."""
    parts, _ = probes.values(setup, EXACT * tolerance, ORDERS)
    scale = np.maximum(np.abs(parts.sum(axis=1)).max(axis=1), probes.floor)
    left_out = np.abs(parts[:, cap:].sum(axis=1)).max(axis=1)
    return SAFETY * left_out / scale, np.maximum(probes.theta_i, probes.theta_o)


def _zone(
    setup: Setup, grid: Grid, draw: Draw, tolerance: float, cap: int, allowed: float
) -> tuple[Grid | None, float]:
    """Return the widest part of a grid within which a cap costs no more than allowed, and what it costs there."""
    steps = np.union1d(grid.theta_i, grid.theta_o)
    inner: Grid | None = grid
    for _ in range(NARROWED):
        if inner is None:
            break
        probes = draw(inner)
        error, steep = _errors(setup, probes, tolerance, cap)
        averages = probes.averages(setup, EXACT * tolerance, ORDERS)
        mirrored = SAFETY * probes.error(averages[:, :cap].sum(axis=1), averages.sum(axis=1)) if len(averages) else 0.0
        bad = steep[error > allowed]
        if not bad.size and mirrored <= allowed:
            return inner, max(float(error.max(initial=0.0)), mirrored)
        below = float(bad.min(initial=np.inf))
        if mirrored > allowed:
            below = min(below, NARROWER * float(min(inner.theta_i[-1], inner.theta_o[-1])))
        left = steps[steps < below - 1e-9]
        inner = within(grid, float(left[-1])) if left.size else None
    return None, 0.0


def fewer_near_the_normal(
    setup: Setup, grid: Grid, draw: Draw, tolerance: float, used: float
) -> tuple[Zones, Item] | None:
    """Return the zones of fewer bounces and what they save, or None where there are none.

    Parameters
    ----------
    setup : Setup
        Reduced. Isotropic ones have fast paths of their own, which fewer bounces do not make faster.
    grid : Grid
        Positions that are computed.
    draw : callable
        Draws probes on a part of the grid.
    tolerance : float
        Error that the scene tolerates.
    used : float
        What leaving bounces out everywhere has used up of their share of it.
    """
    model = setup.model
    if model.components != ("order",) or not model.shares("max_bounces") or setup.isotropic or is_stochastic(setup):
        return None
    allowed = SHARES["bounces"] * tolerance - used
    zones: list[tuple[float, int]] = []
    worst, saved, covered = 0.0, 0.0, 0
    most = setup.max_bounces or ORDERS
    seconds = draw(grid).cost(setup, tolerance)
    for cap in range(1, most):
        inner, error = _zone(setup, grid, draw, tolerance, cap, allowed)
        if inner is None or inner.size <= covered:
            continue
        share = (inner.size - covered) / grid.size
        if share < LEAST:
            continue
        quick = draw(inner).cost(capped(setup, cap), tolerance)
        gain = share * max(0.0, 1.0 - quick / max(seconds, 1e-9))
        zones.append((float(max(inner.theta_i[-1], inner.theta_o[-1])), cap))
        worst, saved, covered = max(worst, error), saved + gain, inner.size
        if inner.size == grid.size:
            break
    if not zones:
        return None
    told = ", ".join(f"beyond {cap} to {np.degrees(limit):.3g} degrees" for limit, cap in zones)
    item = Item("bounces", f"of light and view near the normal, bounces {told}", "measured", worst, 1.1 * worst, saved)
    return tuple(zones), item
