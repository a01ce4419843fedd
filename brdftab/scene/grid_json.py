"""The grids of a plan as JSON: one in full or as its text, the others by what they keep of it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from brdftab.errors import GridError
from brdftab.scene.subgrid import kept_of, part
from brdftab.tables.grid import Grid


@lru_cache(maxsize=64)
def _parsed(text: str, cell: str) -> Grid | None:
    try:
        return Grid.parse(text, cell)
    except GridError:
        return None


def to_json(grid: Grid | None, of: Grid | None = None) -> dict[str, Any] | None:
    """Return a grid as JSON: ``{"text", "cell"}``, ``{"kept": {axis: indices}}`` of another grid, or all of it."""
    if grid is None:
        return None
    if of is not None:
        kept = kept_of(of, grid)
        if kept is not None:
            return {"kept": {name: index.tolist() for name, index in kept.items()}}
    text = "x".join(map(str, grid.shape))
    if _parsed(text, grid.cell) == grid:
        return {"text": text, "cell": grid.cell}
    return grid.to_json()


def from_json(data: Mapping[str, Any] | None, of: Grid | None = None) -> Grid | None:
    """Return the grid that `to_json` described.

    Raises
    ------
    GridError
        Where it is none, or keeps positions that the other does not have.
    """
    if data is None:
        return None
    if "text" in data:
        return Grid.parse(str(data["text"]), str(data.get("cell")))
    if "kept" not in data:
        return Grid.from_json(data)
    if of is None or not isinstance(data["kept"], Mapping):
        raise GridError("kept needs a mapping of axes and the grid that it is a part of")
    kept = {}
    for name, index in data["kept"].items():
        if name not in of.axes or not isinstance(index, list) or not all(type(k) is int for k in index):
            raise GridError(f"kept.{name} must list whole numbers, positions of an axis of the grid")
        if not index or index[0] < 0 or index[-1] >= of.axes[name].size or any(np.diff(index) <= 0):
            raise GridError(f"kept.{name} must increase from 0 to {of.axes[name].size - 1} at most")
        kept[name] = np.array(index, dtype=np.int64)
    return part(of, kept)
