"""Scenes that look up albedos alone: a few cosines instead of a table of directions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.evaluation.engine import Engine
from brdftab.models.protocols import HasAlbedo
from brdftab.models.resolve import Setup
from brdftab.scene.cubic import stencil
from brdftab.scene.plan import Item, Plan, Planned
from brdftab.scene.scene import Material
from brdftab.scene.simplify import SAFETY, equal_channels, fewer_wavelengths
from brdftab.tables.grid import Grid
from brdftab.tabulation.albedo_table import AlbedoTable, albedos, assembled, row
from brdftab.tabulation.tabulate import default_grid
from brdftab.timing import Clock
from brdftab.typing import Array

COUNTS = (8, 12, 16, 24, 32, 48, 64, 96, 128, 256)
CHECKS = 9
# at most so many times as many cosines in one step
STEP = 4.0
# the quadrature's share of the tolerance
RULES = 0.3
# light at the horizon itself has no albedo
LOWEST = 1e-3
ALONE = Item("table", "the albedo alone is looked up: no table of directions", "exact", size=1.0)


def at(cosines: Array, values: Array, theta_i: ArrayLike) -> Array:
    """Return albedos (N, C) at polar angles (N,) by cubics in the cosine between table cells (M,), (M, C)."""
    mu = np.cos(np.atleast_1d(np.asarray(theta_i, dtype=np.float64)))
    index, weight = stencil(cosines, mu)
    return np.einsum("ns,nsc->nc", weight, values[index])


def interpolate_albedo(table: AlbedoTable, theta_i: ArrayLike, *, layer: str = "reflected", row: int = 0) -> Array:
    """Look up a directional albedo.

    Parameters
    ----------
    table : AlbedoTable
        Planned or not.
    theta_i : array_like (N,)
        Polar angle of the light, radians in [0, pi/2].
    layer : str
        Which of the table's layers.
    row : int
        Row of the roughness.

    Returns
    -------
    ndarray (N, C)

    Raises
    ------
    ParameterError
        If there is no such layer.
    """
    if layer not in table.directional:
        raise ParameterError.not_known("layer", layer, table.directional)
    return at(table.cosines, table.directional[layer][row], theta_i)


def _lights(material: Material) -> Array:
    """Return angles of the light, between the table's own, at which interpolation is tried."""
    low, high = (min(t, math.acos(LOWEST)) for t in material.theta_i)
    if low >= high:
        raise ParameterError(
            f"{material.name}: theta_i lies below the surface; albedos take light from [0, 90] degrees"
        )
    # denser towards the horizon, where albedos turn
    return low + (high - low) * (1.0 - (1.0 - np.linspace(0.0, 1.0, CHECKS)) ** 2)


def _engine(setup: Setup, tolerance: float) -> Engine | None:
    """Return what evaluates directions, unless the model integrates its albedos itself."""
    own = setup.transmits or isinstance(models.kernel(setup.model.name), HasAlbedo)
    return None if own else Engine(setup, tolerance)


def plan(material: Material, setup: Setup) -> Planned:
    """Plan a table of albedos: as few cosines as the tolerance takes.

    Raises
    ------
    ParameterError
        If no light stands above the surface.
    """
    asked, items = material.albedo_tolerance, [ALONE]
    small = setup
    for step in (equal_channels, fewer_wavelengths):
        found = step(small, material, None, asked)
        if found is not None:
            small, item = found
            items.append(replace(item, cell=0.0))
    lights, rules = _lights(material), RULES * asked
    engine = _engine(small, rules)
    wanted = albedos(small, lights, rules, engine)
    allowed, least = (1.0 - RULES - 0.1) * asked, 0.0
    for count in COUNTS:
        if count < least:
            continue
        cosines = (np.arange(count) + 0.5) / count
        values = albedos(small, np.arccos(cosines), rules, engine)
        error = SAFETY * max(
            float(np.abs(at(cosines, mine, lights) - right).max()) for mine, right in zip(values, wanted, strict=True)
        )
        if error <= allowed:
            break
        # kinks of an albedo leave errors in the square of the spacing
        least = count * min(STEP, math.sqrt(error / allowed))
    told = f"{count} cosines, with cubics between them"
    items.append(Item("resolution", told, "measured", 0.0, error))
    items.append(Item("rules", f"quadratures for an error of {rules:.1e}", "measured", 0.0, rules))
    channels = len(small.channels)
    made = Plan(
        model=setup.model.name, given=setup.parameters, parameters=small.parameters, luminance=False,
        quantity="albedo", grid=None, full=None, whole=None, cosines=count, tolerance=asked, rules=rules,
        dtype="float64", items=tuple(items),
        predicted={"bytes": 8.0 * count * channels * wanted.shape[0], "bytes_unplanned": _unplanned(setup, material)},
    )  # fmt: skip
    return Planned(material, made, engine, cells=values)


def _unplanned(setup: Setup, material: Material) -> float:
    return float(Grid.resolve(material.grid or default_grid(setup)).nbytes(len(setup.channels), material.dtype))


def make(planned: Planned) -> AlbedoTable:
    """Tabulate what a plan of albedos says; cells that the planning took stay."""
    clock, plan = Clock(), planned.plan
    cosines = (np.arange(plan.cosines) + 0.5) / plan.cosines
    found = row(plan.setup(), cosines, plan.rules, planned.cells, planned.engine)
    table = assembled(cosines, [found], plan.rules, planned.seconds + clock.seconds)
    table.provenance["plan"] = plan.to_json()
    return table


def error(table: AlbedoTable, plan: Plan, material: Material) -> float:
    """Return the largest difference between looked-up albedos and those of the full setup by a finer quadrature."""
    low, high = (min(t, math.acos(LOWEST)) for t in material.theta_i)
    lights = np.linspace(low, high, 23)
    right = albedos(material.setup(), lights, 0.1 * plan.rules)
    mine = [interpolate_albedo(table, lights, layer=name) for name in table.directional]
    return float(max(np.abs(a - b).max() for a, b in zip(mine, right, strict=True)))
