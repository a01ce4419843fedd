"""Figures of tables, drawn with matplotlib (extra ``report``)."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.plotting.figure import figure
from brdftab.tables.comparison import Comparison, masks, rows
from brdftab.tables.table import Table


def difference(
    a: Table, b: Table, result: Comparison, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Draw where two tables differ: a map of the worst theta_i row and a histogram over all cells.

    Parameters
    ----------
    a, b : Table
        The tables that gave `result`.
    result : Comparison
    path : str or path-like
        Ends in .png, .pdf or .svg; written whole or not at all.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    BrdftabError
        Where matplotlib is missing, the ending is unknown or the file cannot be written.
    """
    with figure(path, (11, 4.2), "figure", overwrite=overwrite) as picture:
        left, right = picture.subplots(1, 2)
        _draw_map(picture, left, a, b, result)
        _draw_histogram(right, a, b, result)


def _relative(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    """Signed relative difference, NaN where it has no meaning."""
    x, y = a.astype(np.float64), b.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        return np.where(x == y, 0.0, (y - x) / np.maximum(np.abs(x), np.abs(y)))


def _draw_map(picture: Any, axes: Any, a: Table, b: Table, result: Comparison) -> None:
    """Draw theta_o x phi of the worst row of theta_i in the worst channel."""
    index = result.worst_index or (0,) * a.values.ndim
    one, two = (t.components[result.component] if result.component else t.values for t in (a, b))
    select: tuple[Any, ...] = (*index[:-3], slice(None), slice(None), index[-1])
    difference = _relative(one[select], two[select])
    if a.mask is not None or b.mask is not None:
        valid = masks(a, b)[0]
        assert valid is not None
        difference = np.where(valid[select], difference, np.nan)
    names = a.grid.axis_names
    edges = [np.degrees(a.grid.edges[name]) for name in names[-2:]]
    span = float(np.nanmax(np.abs(difference), initial=0.0)) or 1.0
    mesh = axes.pcolormesh(edges[1], edges[0], difference, cmap="RdBu_r", vmin=-span, vmax=span, rasterized=True)
    picture.colorbar(mesh, ax=axes, label="(b - a) / max(|a|, |b|)")
    where = ", ".join(f"{name} = {result.directions[name]:.4g}" for name in names[:-2] if name in result.directions)
    if result.worst_index is not None:
        axes.plot(result.directions[names[-1]], result.directions[names[-2]], "kx", label="worst cell")
        axes.legend(loc="upper left")
    label = f"{result.component + '.' if result.component else ''}{a.channels[index[-1]]}"
    axes.set(title=f"{label} at {where} degrees", xlabel=f"{names[-1]} (degrees)", ylabel=f"{names[-2]} (degrees)")


def _draw_histogram(axes: Any, a: Table, b: Table, result: Comparison) -> None:
    """Draw the distribution of log10 relative differences; equal numbers are counted in the title."""
    both = masks(a, b)[0]
    edges = np.linspace(-17.0, 1.0, 73)
    counts, equal, total = np.zeros(edges.size - 1, dtype=np.int64), 0, 0
    for i, x, y in rows(a, b, ""):
        difference = np.abs(_relative(x, y))
        difference = difference[np.isfinite(difference) if both is None else both[i] & np.isfinite(difference)]
        moved = difference[difference > 0.0]
        equal, total = equal + difference.size - moved.size, total + difference.size
        counts += np.histogram(np.clip(np.log10(moved), edges[0], edges[-1]), edges)[0]
    axes.stairs(counts, edges, fill=True)
    if result.rtol > 0.0:
        axes.axvline(math.log10(result.rtol), color="k", linestyle="--", label=f"rtol = {result.rtol:g}")
        axes.legend()
    axes.set(
        title=f"{equal:,} of {total:,} numbers are equal, {result.differing:,} cells differ",
        xlabel="log10 of the relative difference",
        ylabel="numbers",
    )
    if counts.any():
        axes.set_yscale("log")
