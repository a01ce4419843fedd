"""Two tables held against each other, cell by cell.

By hand, for numpy.testing tells neither which cell is worst nor what the table calls it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import GridError, ParameterError
from brdftab.tables.axis import SAME
from brdftab.tables.content import told
from brdftab.tables.table import Table

# float32 keeps 6e-8 and runs on different processors may differ in their last digits; 1e-5 is far below any change
# of a formula, and float64 values are compared as tightly as the kernels' quadrature repeats itself
RTOL = {"float32": 1e-5, "float64": 1e-9}
# values below this part of the largest one are noise of cancelled sums
ATOL_PART = 1e-12


@dataclass(repr=False)
class Comparison:
    """How far two tables agree.

    A number differs where ``|a - b| > atol + rtol * max(|a|, |b|)``, where either is NaN, where infinities are not the
    same, or where just one is masked out. Numbers that both masks leave out are skipped.

    Attributes
    ----------
    rtol, atol : float
        The tolerances.
    differing, total : int
        Cells with at least one differing number (channel or component), and cells in all.
    worst_index : tuple of int or None
        Index of the worst number along the grid's axes and the channels; None where no number could be compared.
    directions : dict of str to float
        Positions of the worst cell in degrees, by axis.
    channel, component : str
        Of the worst number; the component is "" for the total.
    value_a, value_b, abs_difference, rel_difference : float
        At the worst number; relative to the larger magnitude.
    max_rel, max_abs, rms : float
        Over all compared finite numbers; rms is that of the difference over the root mean square of `a`'s values.
    mask_differs : int
        Numbers that just one table masks out.
    not_finite : int
        Compared numbers that are NaN or infinite in one of the tables.
    components : dict of str to int
        Differing numbers by component, "" for the total.
    """

    rtol: float
    atol: float
    differing: int = 0
    total: int = 0
    worst_index: tuple[int, ...] | None = None
    directions: dict[str, float] = field(default_factory=dict)
    channel: str = ""
    component: str = ""
    value_a: float = math.nan
    value_b: float = math.nan
    abs_difference: float = 0.0
    rel_difference: float = 0.0
    max_rel: float = 0.0
    max_abs: float = 0.0
    rms: float = 0.0
    mask_differs: int = 0
    not_finite: int = 0
    components: dict[str, int] = field(default_factory=dict)

    def __repr__(self) -> str:
        return told(
            self,
            f"{'equal' if self.equal else 'differ'}: {self.differing:,} of {self.total:,} cells differ",
            f"max_rel = {self.max_rel:.3g}",
            f"max_abs = {self.max_abs:.3g}",
            f"rtol = {self.rtol:g}",
            f"atol = {self.atol:g}",
        )

    @property
    def equal(self) -> bool:
        """Whether no cell differs."""
        return self.differing == 0

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as a JSON-able dict; NaN and infinities become text."""
        data = {"equal": self.equal} | {item.name: getattr(self, item.name) for item in fields(self)}
        return {name: _jsonable(value) for name, value in data.items()}


def tolerances(table: Table) -> tuple[float, float]:
    """Return the relative and absolute tolerance within which a table must repeat.

    Parameters
    ----------
    table : Table

    Returns
    -------
    rtol : float
        1e-5 for float32, 1e-9 for float64.
    atol : float
        1e-12 of the table's largest finite magnitude.
    """
    finite = np.abs(table.values[np.isfinite(table.values)])
    return RTOL[table.dtype.name], ATOL_PART * float(finite.max(initial=0.0))


def compare(a: Table, b: Table, *, rtol: float | None = None, atol: float | None = None) -> Comparison:
    """Compare two tables over the same grid and channels.

    Parameters
    ----------
    a, b : Table
        float32 and float64 tables may be compared with each other. Components are compared where both have any.
    rtol, atol : float or None
        Finite and not negative. None takes `tolerances` of the table with the coarser type.

    Returns
    -------
    Comparison

    Raises
    ------
    GridError
        Where axes (beyond 1e-12), cells or channels do not match.
    ParameterError
        For a tolerance that is negative or not finite, and where both have components but not the same ones.
    """
    default = tolerances(a if a.dtype.itemsize <= b.dtype.itemsize else b)
    rtol, atol = (default[0] if rtol is None else rtol), (default[1] if atol is None else atol)
    for name, value in (("rtol", rtol), ("atol", atol)):
        if not math.isfinite(value) or value < 0.0:
            raise ParameterError.out_of_range(name, value, "[0, inf)", "give a finite tolerance, such as 1e-5")
    _check_match(a, b)
    result = Comparison(float(rtol), float(atol), total=a.grid.size)
    valid, only_one = masks(a, b)
    cells = np.zeros(a.grid.shape, dtype=bool)
    if only_one is not None:
        cells |= only_one.any(axis=-1)
        result.mask_differs = int(only_one.sum())
    worst, square, weight = -1.0, 0.0, 0.0
    names = ["", *(a.components if a.components and b.components else [])]
    for name in names:
        result.components[name] = 0
        for i, x, y in rows(a, b, name):
            here = np.ones(x.shape, dtype=bool) if valid is None else valid[i]
            gap, size, differs = _differences(x, y, result.rtol, result.atol, here)
            cells[i] |= differs.any(axis=-1)
            result.components[name] += int(differs.sum())
            finite = here & np.isfinite(gap)
            result.not_finite += int((here & ~finite).sum())
            badness = np.where(here, _badness(gap, size, differs, result.rtol, result.atol), -1.0)
            at = np.unravel_index(int(np.argmax(badness)), badness.shape)
            if badness[at] > worst:
                worst = float(badness[at])
                _note(result, a, name, (i, *map(int, at)), float(x[at]), float(y[at]))
            relative = np.divide(gap, size, out=np.zeros_like(gap), where=finite & (size > 0.0))
            result.max_rel = max(result.max_rel, float(relative.max(initial=0.0)))
            result.max_abs = max(result.max_abs, float(gap.max(where=finite, initial=0.0)))
            if not name:
                square += float(np.sum(gap[finite] ** 2))
                weight += float(np.sum(x[finite] ** 2))
    result.rms = math.sqrt(square / weight) if weight > 0.0 else math.sqrt(square)
    result.differing = int(cells.sum())
    return result


def _check_match(a: Table, b: Table) -> None:
    """Refuse tables whose cells do not correspond."""
    if a.channels != b.channels:
        raise GridError(
            f"the channels differ: {' '.join(a.channels)} and {' '.join(b.channels)}; compare like with like"
        )
    if a.grid.axis_names != b.grid.axis_names or a.grid.shape != b.grid.shape:
        sizes = ["x".join(map(str, grid.shape)) for grid in (a.grid, b.grid)]
        raise GridError(f"the grids differ: {sizes[0]} and {sizes[1]}; tabulate both on the same grid")
    if a.grid.cell != b.grid.cell:
        raise GridError(f"the cells differ: {a.grid.cell} and {b.grid.cell}; tabulate both with the same cell")
    for name, axis in a.grid.axes.items():
        apart = float(np.abs(axis - b.grid.axes[name]).max())
        apart = max(apart, float(np.abs(a.grid.edges[name] - b.grid.edges[name]).max()))
        if apart > SAME:
            degrees = math.degrees(apart)
            raise GridError(f"the axis {name} differs by up to {degrees:.3g} degrees; tabulate both on the same grid")
    if a.components and b.components and set(a.components) != set(b.components):
        missing = sorted(set(a.components) ^ set(b.components))
        raise ParameterError(f"the component {missing[0]} is in only one table; tabulate both with the same components")


def masks(a: Table, b: Table) -> tuple[NDArray[np.bool_] | None, NDArray[np.bool_] | None]:
    """Return where both are valid and where just one is; None where neither table has a mask."""
    if a.mask is None and b.mask is None:
        return None, None
    one, two = (np.ones(t.shape, dtype=bool) if t.mask is None else t.mask for t in (a, b))
    return one & two, one ^ two


def rows(a: Table, b: Table, name: str) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Yield the rows of theta_i as float64, so that a large table needs no second copy."""
    one, two = (t.components[name] if name else t.values for t in (a, b))
    for i in range(one.shape[0]):
        yield i, one[i].astype(np.float64), two[i].astype(np.float64)


def _differences(
    x: NDArray[np.float64], y: NDArray[np.float64], rtol: float, atol: float, here: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return |x - y|, max(|x|, |y|) and where they differ; equal infinities agree, NaN never does."""
    with np.errstate(invalid="ignore", over="ignore"):
        gap = np.abs(x - y)
        gap[x == y] = 0.0
        size = np.maximum(np.abs(x), np.abs(y))
        # an infinite size would allow any gap
        agree = (x == y) | (np.isfinite(size) & (gap <= atol + rtol * size))
    return gap, size, here & ~agree


def _badness(
    gap: NDArray[np.float64], size: NDArray[np.float64], differs: NDArray[np.bool_], rtol: float, atol: float
) -> NDArray[np.float64]:
    """Rank numbers: the gap over what is allowed; differing ones always above agreeing ones."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        ratio = gap / (atol + rtol * size)
        ratio = np.where(gap == 0.0, 0.0, ratio)
        # exact comparison allows nothing: rank by the relative gap, all of them above the others
        ratio = np.where(np.isinf(ratio) & np.isfinite(gap), 1e300 * gap / size, ratio)
    return np.where(np.isnan(gap) | (differs & ~np.isfinite(size)), np.inf, ratio)


def _note(result: Comparison, a: Table, name: str, index: tuple[int, ...], x: float, y: float) -> None:
    """Keep the worst number found so far."""
    result.worst_index, result.channel, result.component = index, a.channels[index[-1]], name
    result.directions = directions(a, index)
    result.value_a, result.value_b = x, y
    gap, size = (0.0 if x == y else abs(x - y)), max(abs(x), abs(y))
    result.abs_difference = gap
    result.rel_difference = gap / size if size > 0.0 and math.isfinite(size) else (0.0 if gap == 0.0 else math.nan)


def directions(table: Table, index: tuple[int, ...]) -> dict[str, float]:
    """Return the positions of a cell in degrees, by axis."""
    axes = table.grid.axes.items()
    # fifteen digits of a degree: the radians of 0.5 degrees come back as 0.5
    return {name: round(math.degrees(axis[k]), 12) for (name, axis), k in zip(axes, index, strict=False)}


def _jsonable(value: Any) -> Any:
    """Turn tuples into lists, and numbers that JSON lacks into text."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return list(value) if isinstance(value, tuple) else value
