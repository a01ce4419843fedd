"""Values between the positions of a table: cubic in the logarithm, the way a planned table is meant to be read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.errors import ParameterError
from brdftab.grid import Grid
from brdftab.scene.knots import from_log, matrix, stencil, to_log
from brdftab.scene.plan import Plan
from brdftab.table import Table

Array = NDArray[np.float64]
FLOOR = 1e-9
EVEN = {"phi": (0.0, math.pi)}
_BLOCK = 1 << 12


def _settings(table: Table) -> tuple[float, int, bool]:
    """Return floor, azimuths apart, and whether a quarter of the light's azimuths stands for all."""
    plan = table.provenance.get("plan", {})
    return plan.get("floor", FLOOR), plan.get("apart", 0), plan.get("symmetric", False)


def _options(name: str, apart: int) -> dict[str, Any]:
    return {"even": EVEN[name], "apart": apart} if name == "phi" else {}


def interpolate(
    table: Table, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike, *, phi_i: ArrayLike = 0.0
) -> Array:
    """Look a table up at any directions within its range.

    Four positions along each axis carry a cubic in asinh(50 f/floor), the logarithm of bright values; relative azimuths
    are continued evenly beyond 0 and 180 degrees, absolute ones periodically. Positions of the table
    give its own values back.

    Parameters
    ----------
    table : Table
        Planned or not.
    theta_i, theta_o : array_like
        Polar angles, radians. Half a cell beyond the table's positions the outermost cubic goes on.
    phi : array_like
        phi_o - phi_i, radians.
    phi_i : array_like, optional
        Azimuth of the light, radians; matters for tables of four axes.

    Returns
    -------
    ndarray (..., C)
        f in 1/sr.

    Raises
    ------
    ParameterError
        If an angle lies outside the cells of the table.
    """
    angles = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (theta_i, theta_o, phi, phi_i)))
    shape = angles[0].shape
    ti, to, dphi, az = (a.reshape(-1) for a in angles)
    grid, (floor, apart, symmetric) = table.grid, _settings(table)
    for name, given in (("theta_i", ti), ("theta_o", to)):
        edges = grid.edges[name]
        out = ~((given >= edges[0] - 1e-9) & (given <= edges[-1] + 1e-9))
        if out.any():
            low, high = (math.degrees(edges[k]) for k in (0, -1))
            raise ParameterError.out_of_range(
                name, f"{math.degrees(given[out][0]):g} degrees", f"[{low:g}, {high:g}]", "the table holds no more"
            )
    at = {"theta_i": ti, "theta_o": to}
    if grid.isotropic:
        at["phi"] = np.abs(np.mod(dphi + math.pi, 2.0 * math.pi) - math.pi)
    else:
        at["phi_i"], at["phi_o"] = _folded(az, az + dphi, symmetric)
    rules = [_rule(grid, name, at[name], apart, symmetric) for name in grid.axis_names]
    # of few directions only what they touch is taken to its logarithm
    values = table.values if ti.size * 4 ** len(rules) < grid.size else to_log(table.values.astype(np.float64), floor)
    found = np.empty((ti.size, table.shape[-1]))
    for start in range(0, ti.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        logs, total = _gather(values, [(index[block], weight[block]) for index, weight in rules])
        logs = to_log(logs.astype(np.float64), floor) if values is table.values else logs
        found[block] = np.einsum("nk,nkc->nc", total, logs)
    return from_log(found, floor).reshape(*shape, -1)


def _folded(phi_i: Array, phi_o: Array, symmetric: bool) -> tuple[Array, Array]:
    """Return azimuths in [0, 2 pi), of the light in [0, pi/2] where the surface is symmetric about both axes."""
    i, o = np.mod(phi_i, 2.0 * math.pi), phi_o
    if symmetric:
        back = i > math.pi + 1e-12
        i, o = np.where(back, 2.0 * math.pi - i, i), np.where(back, -o, o)
        across = i > 0.5 * math.pi + 1e-12
        i, o = np.where(across, math.pi - i, i), np.where(across, math.pi - o, o)
    return i, np.mod(o, 2.0 * math.pi)


def _rule(grid: Grid, name: str, x: Array, apart: int, symmetric: bool) -> tuple[NDArray[np.int64], Array]:
    """Return indices and weights along one axis."""
    knots = grid.axes[name]
    if not name.startswith("phi_") or (name == "phi_i" and symmetric):
        return stencil(knots, x, **_options(name, apart))
    turns = np.concatenate([knots - 2.0 * math.pi, knots, knots + 2.0 * math.pi])
    index, weight = stencil(turns, x)
    return index % knots.size, weight


def _gather(values: NDArray[Any], rules: list[tuple[NDArray[np.int64], Array]]) -> tuple[NDArray[Any], Array]:
    """Return values (N, K, C) and weights (N, K) of the products of all axes' stencils."""
    axes, count = len(rules), rules[0][0].shape[0]
    where, total = [], np.ones((count,) + (1,) * axes)
    for axis, (index, weight) in enumerate(rules):
        shape = [count] + [1] * axes
        shape[axis + 1] = index.shape[1]
        where.append(index.reshape(shape))
        total = total * weight.reshape(shape)
    return values[tuple(where)].reshape(count, -1, values.shape[-1]), total.reshape(count, -1)


def expand(table: Table) -> Table:
    """Return a planned table on the grid that would have been taken without a plan, within the scene's ranges.

    Raises
    ------
    ParameterError
        If the table holds no plan.
    """
    plan = table.provenance.get("plan")
    if not plan or not plan.get("full"):
        raise ParameterError("the table holds no plan with a grid; only tables of a scene can be expanded")
    full = Plan.from_json(plan).full
    assert full is not None
    return Table(
        expanded(table, full).astype(table.dtype), full, table.channels, {}, None, dict(table.provenance), table.version
    )


def expanded(table: Table, full: Grid, picked: Mapping[str, NDArray[np.int64]] | None = None) -> Array:
    """Return float64 values of a table at the positions of another grid of the same kind, or at picked ones of it."""
    floor, apart, _ = _settings(table)
    if not full.isotropic:
        mesh = np.meshgrid(*full.axes.values(), indexing="ij")
        ti, pi_, to, po = mesh
        return interpolate(table, ti, to, po - pi_, phi_i=pi_)
    rules, used = [], []
    for name in full.axis_names:
        wanted = full.axes[name][picked[name]] if picked and name in picked else full.axes[name]
        dense = matrix(table.grid.axes[name], wanted, **_options(name, apart))
        used.append(np.flatnonzero(dense.any(axis=0)))
        rules.append(dense[:, used[-1]])
    logs = to_log(table.values[np.ix_(*used)].astype(np.float64), floor)
    for axis, dense in enumerate(rules):
        logs = np.moveaxis(np.tensordot(dense, logs, axes=(1, axis)), 0, axis)
    return from_log(logs, floor)
