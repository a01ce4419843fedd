"""How wrong values are: four numbers over one set of directions."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.tables.grid import Grid
from brdftab.tabulation.cell_averages import FLOOR
from brdftab.tabulation.error_estimate import cell_angles
from brdftab.typing import Array


@dataclass(frozen=True)
class Measures:
    """Errors relative to a reference r; f are the values, w = cos(theta_o) d omega_o of each cell.

    Attributes
    ----------
    l1 : float
        sum w |f - r| / sum w |r|: the share of the reflected light that is in the wrong place.
    l2 : float
        sqrt(sum w (f - r)^2 / sum w r^2): highlights count most.
    max : float
        Largest |f - r| of a pair over the pair's largest channel (at least 1e-9/sr).
    albedo : float
        Largest |A_f - A_r| / A_r over light directions and channels, with A the sum of w f over the views.
    """

    l1: float
    l2: float
    max: float
    albedo: float

    def to_json(self) -> dict[str, float]:
        """Return plain JSON."""
        return asdict(self)


NAMES = tuple(item.name for item in fields(Measures))


def view_weights(grid: Grid) -> Array:
    """Return cos(theta_o) d omega_o of every cell, shape of the grid without its axes of light broadcast to all."""
    low, high = grid.theta_o_edges[:-1], grid.theta_o_edges[1:]
    # the cell's integral of |cos| sin, which cells across the horizon split in two
    split = np.clip(0.5 * math.pi, low, high)
    rings = 0.5 * np.abs(np.sin(split) ** 2 - np.sin(low) ** 2) + 0.5 * np.abs(np.sin(high) ** 2 - np.sin(split) ** 2)
    if grid.isotropic:
        assert grid.phi_edges is not None
        # phi runs over half the circle
        turns = 2.0 * np.diff(grid.phi_edges)
        return np.broadcast_to(rings[None, :, None] * turns, grid.shape)
    assert grid.phi_o_edges is not None
    return np.broadcast_to(rings[None, None, :, None] * np.diff(grid.phi_o_edges), grid.shape)


def all_angles(grid: Grid) -> tuple[Array, Array, Array, Array]:
    """Return theta_i, theta_o, phi, phi_i (N,) of all cells in C order."""
    cells = np.stack(np.unravel_index(np.arange(grid.size), grid.shape), axis=1)
    return tuple(np.ascontiguousarray(a) for a in cell_angles(grid, cells))  # type: ignore[return-value]  # four of them


def measure(found: NDArray[Any], reference: Array, grid: Grid, kept: NDArray[np.bool_]) -> Measures:
    """Return the errors of values (*grid, C) against a reference of that shape, over the cells that `kept` marks."""
    lights = (0,) if grid.isotropic else (0, 1)
    views = tuple(k for k in range(len(grid.shape)) if k not in lights)
    weight = np.where(kept, view_weights(grid), 0.0)[..., None]
    gap = np.where(kept[..., None], np.asarray(found, dtype=np.float64) - reference, 0.0)
    size = np.where(kept[..., None], np.abs(reference), 0.0)
    scale = np.maximum(size.max(axis=-1, keepdims=True), FLOOR)
    lost, there = np.abs((weight * gap).sum(axis=views)), np.abs((weight * size).sum(axis=views))
    return Measures(
        l1=_ratio(float((weight * np.abs(gap)).sum()), float((weight * size).sum())),
        l2=math.sqrt(_ratio(float((weight * gap * gap).sum()), float((weight * size * size).sum()))),
        max=float((np.abs(gap) / scale).max()),
        albedo=float(np.divide(lost, there, out=np.zeros_like(lost), where=there > 0.0).max()),
    )


def mean(many: list[Measures]) -> Measures:
    """Return the mean of each measure."""
    return Measures(*(float(np.mean([getattr(m, name) for m in many])) for name in NAMES))


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else 0.0
