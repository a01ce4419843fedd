"""The light in a table's rows beside the albedo: a lobe that falls between the cells, or that they miss, shows here."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.evaluation.albedo import directional, nodes_for, split
from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import Setup
from brdftab.quadrature import unit_gauss
from brdftab.tables.axis import HALF_PI, SAME
from brdftab.tables.grid import Grid
from brdftab.tabulation.cell_averages import axis_nodes
from brdftab.typing import Array

# rows whose albedo is integrated, and nodes over each axis of a light's cell; at the horizon, where masking sets in
# within alpha, more of them, crowded there
ROWS, LIGHTS, GRAZING = {True: 6, False: 3}, {True: 3, False: 2}, {True: 12, False: 6}
# albedos below this are compared absolutely
FLOOR = 1e-9


def is_whole(grid: Grid) -> bool:
    """Tell whether the views of every row fill one or both hemispheres."""
    polar = grid.edges["theta_o"]
    around = grid.edges["phi" if grid.isotropic else "phi_o"]
    turn = math.pi if grid.isotropic else 2.0 * math.pi
    return bool(
        polar[0] <= SAME
        and min(abs(polar[-1] - HALF_PI), abs(polar[-1] - math.pi)) <= SAME
        and abs(around[-1] - around[0] - turn) <= SAME
    )


def table_energy(grid: Grid, values: NDArray[np.floating]) -> Array:
    """Return sum f cos(theta_o) domega_o over the views of every row, shape of the light's axes and channels."""
    strip = 0.5 * np.abs(np.diff(np.sin(grid.edges["theta_o"]) ** 2))
    if grid.edges["theta_o"][-1] > HALF_PI + SAME:
        # a cell that holds the horizon has light on both sides
        low, high = grid.edges["theta_o"][:-1], grid.edges["theta_o"][1:]
        across = (low < HALF_PI) & (high > HALF_PI)
        strip = np.where(across, 0.5 * (np.cos(low) ** 2 + np.cos(high) ** 2), strip)
    if grid.isotropic:
        return 2.0 * np.einsum("iopc,o,p->ic", values, strip, np.diff(grid.edges["phi"]), optimize=True)
    return np.einsum("iaobc,o,b->iac", values, strip, np.diff(grid.edges["phi_o"]), optimize=True)


def _albedo(setup: Setup, engine: Engine, grid: Grid, theta_i: float, phi_i: float, tolerance: float) -> Array:
    """Return the albedo (C,) of one light, of the sides that the grid's views reach."""
    if not setup.transmits:
        return directional(engine, theta_i, phi_i, nodes_for(tolerance))[0]
    reflected, transmitted = (part[0] for part in split(setup, np.array([theta_i]), phi_i, tolerance))
    both = grid.edges["theta_o"][-1] > HALF_PI + SAME
    return reflected + transmitted if both else (reflected if theta_i < HALF_PI else transmitted)


def _lights(grid: Grid, name: str, index: int) -> tuple[Array, Array]:
    """Return nodes and weights, which add up to 1, over a cell of the light; the position alone of point values."""
    if grid.cell != "average":
        return grid.axes[name][index : index + 1], np.ones(1)
    edges = grid.edges[name][index : index + 2]
    if name == "theta_i" and np.abs(edges - HALF_PI).min() <= SAME:
        x, w = unit_gauss(GRAZING[grid.isotropic])
        width = float(np.abs(edges - HALF_PI).max())
        rise = width * x * x
        # d elevation = 2 width x dx; cos(theta) = sin(elevation)
        weight = w * x * np.sin(rise) * np.cos(rise)
        return HALF_PI + math.copysign(1.0, float(edges.mean()) - HALF_PI) * rise, weight / weight.sum()
    nodes, weights = axis_nodes(edges, LIGHTS[grid.isotropic], name == "theta_i")
    return nodes[:, 0], weights[:, 0]


def _rows(grid: Grid) -> list[tuple[int, ...]]:
    """Return the rows that are looked at: first, last and some between."""
    count = ROWS[grid.isotropic]
    polar = np.unique(np.linspace(0, grid.shape[0] - 1, count).round().astype(int))
    if grid.isotropic:
        return [(int(i),) for i in polar]
    return [(int(i), (k * grid.shape[1]) // count) for k, i in enumerate(polar)]


def energies(
    setup: Setup, grid: Grid, values: NDArray[np.floating], tolerance: float, engine: Engine | None = None
) -> dict[str, Any] | None:
    """Return the energy of some rows beside their albedo; None where the views do not fill the hemisphere.

    Parameters
    ----------
    setup : Setup
        A setup without noise.
    grid : Grid
        The grid; averages are compared with the albedo's average over the light's cell, weighted by cos sin.
    values : ndarray (*grid, C)
        The table, 1/sr.
    tolerance : float
        Relative error asked of the albedo.
    engine : Engine, optional
        What evaluates the albedo; by default points, not a fast path that the table may come from.

    Returns
    -------
    dict or None
        theta_i_degrees (with four axes phi_i_degrees), table and albedo by row and channel, largest relative
        difference and the theta_i_degrees where it is, JSON-able.
    """
    if not is_whole(grid):
        return None
    held, engine = table_energy(grid, values), engine or Engine(setup, tolerance, fast=False)
    names = grid.axis_names[:1] if grid.isotropic else grid.axis_names[:2]
    table, albedo, places = [], [], _rows(grid)
    for row in places:
        rules = [_lights(grid, name, k) for name, k in zip(names, row, strict=True)]
        theta, around = rules[0], rules[1] if len(rules) > 1 else (np.zeros(1), np.ones(1))
        mean = np.zeros(len(setup.channels))
        for t, w in zip(*theta, strict=True):
            for p, v in zip(*around, strict=True):
                mean += w * v * _albedo(setup, engine, grid, float(t), float(p), tolerance)
        table.append(held[row])
        albedo.append(mean)
    off = np.abs(np.array(table) - np.array(albedo)).max(axis=1) / np.maximum(np.abs(albedo).max(axis=1), FLOOR)
    # lights at the horizon have no albedo
    off = np.where(np.isclose([grid.axes["theta_i"][r[0]] for r in places], HALF_PI, atol=SAME), 0.0, off)
    worst = int(np.argmax(off))
    degrees = {f"{name}_degrees": [math.degrees(grid.axes[name][r[k]]) for r in places] for k, name in enumerate(names)}
    return {
        **degrees,
        "table": np.array(table).tolist(),
        "albedo": np.array(albedo).tolist(),
        "largest": float(off[worst]),
        "at_degrees": degrees["theta_i_degrees"][worst],
    }
