"""Values between the positions of a table: cubic in the logarithm, the way a planned table is meant to be read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.errors import ParameterError
from brdftab.scene.cubic import from_log, matrix, stencil, to_log
from brdftab.scene.plan import Plan
from brdftab.tables.grid import Grid
from brdftab.tables.table import Table
from brdftab.typing import Array

FLOOR = 1e-9
EVEN = {"phi": (0.0, math.pi)}
_BLOCK = 1 << 12


def _settings(table: Table) -> tuple[float, int, bool]:
    """Return floor, azimuths apart, and whether a quarter of the light's azimuths stands for all."""
    plan = table.provenance.get("plan", {})
    return plan.get("floor", FLOOR), plan.get("apart", 0), plan.get("symmetric", False)


def options(name: str, apart: int = 0, symmetric: bool = False) -> dict[str, Any]:
    """Return how an axis goes on beyond its ends: evenly, periodically, or not at all."""
    if name == "phi":
        return {"even": EVEN[name], "apart": apart}
    return {"period": 2.0 * math.pi} if name.startswith("phi_") and not (name == "phi_i" and symmetric) else {}


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
    rules = [stencil(grid.axes[name], at[name], **options(name, apart, symmetric)) for name in grid.axis_names]
    # of few directions only what they touch is taken to its logarithm
    values = table.values if ti.size * 4 ** len(rules) < grid.size else to_log(table.values.astype(np.float64), floor)
    found = np.empty((ti.size, table.shape[-1]))
    for start in range(0, ti.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        logs, total = _gather(values, [(index[block], weight[block]) for index, weight in rules])
        logs = to_log(logs.astype(np.float64), floor) if values is table.values else logs
        found[block] = np.einsum("nk,nkc->nc", total, logs)
    return from_log(found, floor).reshape(*shape, table.shape[-1])


def _folded(phi_i: Array, phi_o: Array, symmetric: bool) -> tuple[Array, Array]:
    """Return azimuths in [0, 2 pi), of the light in [0, pi/2] where the surface is symmetric about both axes."""
    i, o = np.mod(phi_i, 2.0 * math.pi), phi_o
    if symmetric:
        back = i > math.pi + 1e-12
        i, o = np.where(back, 2.0 * math.pi - i, i), np.where(back, -o, o)
        across = i > 0.5 * math.pi + 1e-12
        i, o = np.where(across, math.pi - i, i), np.where(across, math.pi - o, o)
    return i, np.mod(o, 2.0 * math.pi)


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
    wanted = {n: full.axes[n][picked[n]] if picked and n in picked else full.axes[n] for n in full.axis_names}
    if full.isotropic:
        return _product(table, wanted)
    azimuths = np.broadcast_arrays(wanted["phi_i"][:, None], wanted["phi_o"])
    phi_i, phi_o = _folded(azimuths[0], azimuths[1], _settings(table)[2])
    # lights that fold alike share the azimuths of their views
    ways, which = np.unique(phi_o, axis=0, return_inverse=True)
    found = np.empty((*(a.size for a in wanted.values()), table.shape[-1]))
    for n, views in enumerate(ways):
        lights = np.flatnonzero(which.reshape(-1) == n)
        found[:, lights] = _product(table, wanted | {"phi_i": phi_i[lights, 0], "phi_o": views})
    return found


def _product(table: Table, wanted: Mapping[str, Array]) -> Array:
    """Return float64 values at the product of some positions of each axis, one axis after the other."""
    floor, apart, symmetric = _settings(table)
    rules, used = [], []
    for name, x in wanted.items():
        dense = matrix(table.grid.axes[name], x, **options(name, apart, symmetric))
        used.append(np.flatnonzero(dense.any(axis=0)))
        rules.append(dense[:, used[-1]])
    logs = to_log(table.values[np.ix_(*used)].astype(np.float64), floor)
    for axis, dense in enumerate(rules):
        logs = np.moveaxis(np.tensordot(dense, logs, axes=(1, axis)), 0, axis)
    return from_log(logs, floor)
