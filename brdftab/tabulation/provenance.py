"""What a table says of itself beside its numbers: verdict on its error, albedo, spectrum, machine."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from brdftab import models
from brdftab.evaluation import delta
from brdftab.evaluation.albedo import directional
from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import spectral
from brdftab.models.protocols import HasEnergyLeftOut, HasSmoothAlbedo
from brdftab.models.resolve import Setup, resolve
from brdftab.tables.grid import Grid
from brdftab.tabulation.error_estimate import Estimate
from brdftab.tabulation.monte_carlo import Spread

ALBEDO_ANGLES = (0.0, 30.0, 60.0, 80.0)
ALBEDO_TOLERANCE = 1e-4


def physics(setup: Setup, engine: Engine, tolerance: float, grid: Grid) -> dict[str, Any]:
    """Return what follows from the setup: spectrum, albedo, delta, energy left out, formula and citation."""
    return {
        "spectral": spectral(setup),
        "albedo": _albedo(engine),
        "delta": delta.described(setup, grid, ALBEDO_ANGLES),
        "energy_left_out": _with_delta(_left_out(setup, tolerance), setup, grid),
        "variant": setup.model.variant,
        "citation": setup.model.citation,
        "doi": setup.model.doi,
    }


def verdict(judged: Estimate | Spread, tolerance: float, dtype: DTypeLike) -> dict[str, Any]:
    """Say whether the tolerance is met, and why not."""
    if judged.largest <= tolerance:
        return {"met": True, "reason": ""}
    if np.dtype(dtype) == np.float32 and judged.largest <= 1.2e-7:
        return {"met": False, "reason": "float32 rounds to 6e-8; ask for --dtype float64"}
    return {"met": False, "reason": judged.reason}


def _albedo(engine: Engine) -> dict[str, Any]:
    """Return the directional albedo at four angles, a value a channel; five digits do."""
    module = models.kernel(engine.setup.model.name)
    if engine.tolerance < ALBEDO_TOLERANCE and isinstance(module, HasSmoothAlbedo):
        engine = Engine(engine.setup, ALBEDO_TOLERANCE)
    values = [directional(engine, math.radians(a)).sum(axis=0).tolist() for a in ALBEDO_ANGLES]
    return {"theta_i_degrees": list(ALBEDO_ANGLES), "values": values}


def _with_delta(left_out: dict[str, Any] | None, setup: Setup, grid: Grid) -> dict[str, Any] | None:
    """Return the energy left out with that of a delta which no value of the table holds."""
    if delta.holds(grid) or not delta.exists(setup):
        return left_out
    lost = delta.reflectance(setup, np.radians(ALBEDO_ANGLES))
    if left_out is not None:
        lost = lost + np.array(left_out["values"])
    return {"theta_i_degrees": list(ALBEDO_ANGLES), "values": lost.tolist()}


def _left_out(setup: Setup, tolerance: float) -> dict[str, Any] | None:
    """Return the albedo that a cap of the bounces leaves out at four angles, a value a channel; None without cap."""
    if setup.max_bounces is None:
        return None
    angles = np.radians(ALBEDO_ANGLES)
    module = models.kernel(setup.model.name)
    if isinstance(module, HasEnergyLeftOut):
        values = module.energy_left_out(setup, angles)
        return None if values is None else {"theta_i_degrees": list(ALBEDO_ANGLES), "values": values.tolist()}
    if not setup.model.shares("max_bounces"):
        return None
    free = resolve(setup.model.name, **{n: v for n, v in setup.parameters.items() if n != "max_bounces"})
    engines = [Engine(s, min(tolerance, 1e-4), fast=False) for s in (free, setup)]
    lost = [(directional(engines[0], a)[0] - directional(engines[1], a)[0]).tolist() for a in map(float, angles)]
    return {"theta_i_degrees": list(ALBEDO_ANGLES), "values": lost}
