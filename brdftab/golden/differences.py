"""Which numbers of two arrays differ most, with their place in words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.golden.points import Held
from brdftab.golden.quantities import ALBEDO_ANGLES, DRAW_ANGLE, DRAW_AZIMUTH
from brdftab.tables.table import Table

WORST = 5


@dataclass(frozen=True)
class Cell:
    """One number that differs.

    Attributes
    ----------
    where : str
        Setting, quantity, component and channel in words.
    degrees : dict of str to float
        Directions by name.
    golden, now : float
        The recorded number and today's.
    relative : float
        |golden - now| over the larger magnitude; infinite where one is NaN or infinite.
    """

    where: str
    degrees: dict[str, float]
    golden: float
    now: float
    relative: float

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON-able dict; NaN and infinities become text."""
        numbers = {"golden": self.golden, "now": self.now, "relative": self.relative}
        shown = {name: value if math.isfinite(value) else str(value) for name, value in numbers.items()}
        return {"where": self.where, "degrees": self.degrees, **shown}


@dataclass
class Differences:
    """What was found over several arrays.

    Attributes
    ----------
    total, differing : int
        Numbers compared, and those that differ.
    largest : float
        Largest relative difference of numbers that count (above the absolute tolerance).
    worst : list of Cell
        The worst ones that differ, at most `WORST` an array, in falling order.
    """

    total: int = 0
    differing: int = 0
    largest: float = 0.0
    worst: list[Cell] = field(default_factory=list)

    def close(self) -> None:
        """Keep the worst of all arrays alone."""
        self.worst = sorted(self.worst, key=lambda cell: -cell.relative)[:WORST]


def relative(a: NDArray[Any], b: NDArray[Any], atol: float) -> NDArray[np.float64]:
    """Return |a - b| / max(|a|, |b|), 0 where they agree within `atol`, infinite where just one is finite or none."""
    x, y = a.astype(np.float64), b.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        gap = np.abs(x - y)
        found = np.where((x == y) | (gap <= atol), 0.0, gap / np.maximum(np.abs(x), np.abs(y)))
    return np.where(np.isfinite(found), found, np.inf)


def compare_points(found: Differences, golden: Held, now: Held, rtol: float, atol_part: float) -> None:
    """Add the numbers of one setting to what was found."""
    for name, a in golden.quantities.items():
        b = now.quantities.get(name)
        if b is None or a.shape != b.shape:
            place = f"{golden.label}: {name} is {'gone' if b is None else f'of shape {b.shape}, was {a.shape}'}"
            found.worst.append(Cell(place, {}, math.nan, math.nan, math.inf))
            found.differing += a.size
            found.total += a.size
            continue
        finite = np.abs(a[np.isfinite(a)])
        gap = relative(a, b, atol_part * float(finite.max(initial=0.0)))
        _add(found, gap, rtol, lambda at, n=name, a=a, b=b: _point(golden, n, at, float(a[at]), float(b[at])))


def _add(found: Differences, gap: NDArray[np.float64], rtol: float, cell: Any) -> None:
    """Count an array by its relative differences `gap`, and describe its worst numbers by `cell(index)`."""
    found.total += gap.size
    found.differing += int((gap > rtol).sum())
    found.largest = max(found.largest, float(gap.max(initial=0.0)))
    for flat in np.argsort(-gap, axis=None, kind="stable")[:WORST]:
        at = tuple(int(k) for k in np.unravel_index(int(flat), gap.shape))
        if gap[at] > rtol:
            where, degrees, golden, now = cell(at)
            found.worst.append(Cell(where, degrees, golden, now, float(gap[at])))


def _point(
    held: Held, name: str, at: tuple[int, ...], a: float, b: float
) -> tuple[str, dict[str, float], float, float]:
    """Describe one number of a setting."""
    words = [f"{held.label}: {name}"]
    if name == "samples":
        columns = ("theta_o", "phi_o", "pdf", *(f"weight {c}" for c in held.channels))
        return f"{words[0]} {at[0]} {columns[at[1]]}", _degrees(theta_i=DRAW_ANGLE, phi_i=DRAW_AZIMUTH), a, b
    if name == "components":
        words.append(held.components[at[1]])
    if len(at) > 1:
        words.append(held.channels[at[-1]])
    if name == "albedo":
        return " ".join(words), _degrees(theta_i=ALBEDO_ANGLES[at[0]], phi_i=DRAW_AZIMUTH), a, b
    angles = dict(zip(("theta_i", "theta_o", "phi", "phi_i"), held.directions[:, at[0]], strict=True))
    return " ".join(words), _degrees(**angles), a, b


def compare_tables(found: Differences, golden: Table, now: Table, rtol: float, atol: float) -> None:
    """Add the numbers of two tables over the same grid, total and components."""
    for name in ("", *golden.components):
        a, b = (t.components[name] if name else t.values for t in (golden, now))

        def cell(at: tuple[int, ...], a: Any = a, b: Any = b, name: str = name) -> tuple[str, Any, float, float]:
            axes = zip(golden.grid.axes.items(), at, strict=False)
            degrees = _degrees(**{axis: float(positions[k]) for (axis, positions), k in axes})
            return f"{name + '.' if name else ''}{golden.channels[at[-1]]}", degrees, float(a[at]), float(b[at])

        _add(found, relative(a, b, atol), rtol, cell)


def _degrees(**angles: float) -> dict[str, float]:
    """Return angles in degrees; fifteen digits, so that the radians of 0.5 degrees come back as 0.5."""
    return {name: round(math.degrees(angle), 12) for name, angle in angles.items()}
