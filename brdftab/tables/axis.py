"""One axis of angles: reading it from text or an array, checking it, and the edges of its cells."""

from __future__ import annotations

import math
import re

import numpy as np
from numpy.typing import ArrayLike

from brdftab.errors import GridError
from brdftab.typing import Array

MAX_CELLS = 2**31
# a million positions on one axis is a slip of the pen, and their text in a file's header would outgrow the values
MAX_POSITIONS = 2**20
HALF_PI = 0.5 * math.pi
TWO_PI = 2.0 * math.pi
# axes closer than this are the same direction: far above rounding of degrees to radians, far below any real cell
SAME = 1e-12

# polar angles beyond 90 degrees lie below the surface, where dielectrics transmit to
TOP_DEGREES = {"theta_i": 180.0, "theta_o": 180.0, "phi": 180.0, "phi_i": 360.0, "phi_o": 360.0}
TOP = {"theta_i": math.pi, "theta_o": math.pi, "phi": math.pi, "phi_i": TWO_PI, "phi_o": TWO_PI}
PERIODIC = ("phi_i", "phi_o")
POLAR = ("theta_i", "theta_o")
COUNT = re.compile(r"[+-]?\d{1,18}")

_SPEC_HELP = 'write "start:stop:count" or "a,b,c" in degrees'


def voronoi(name: str, positions: Array) -> Array:
    """Return the edges half way between positions, shape (n + 1,), radians.

    Parameters
    ----------
    name : str
        Axis: its range ends the outer cells; ``phi_i`` and ``phi_o`` are periodic instead. Polar angles reach over
        the hemispheres that they touch, and the horizon is an edge between these.
    positions : ndarray, shape (n,)
        Strictly increasing, radians.

    Returns
    -------
    ndarray of float64, shape (n + 1,)
    """
    middle = 0.5 * (positions[:-1] + positions[1:])
    if name in PERIODIC:
        first = 0.5 * (positions[-1] - TWO_PI + positions[0])
        return np.concatenate([[first], middle, [first + TWO_PI]])
    if name in POLAR:
        crossing = (positions[:-1] < HALF_PI) & (positions[1:] > HALF_PI)
        middle = np.where(crossing, HALF_PI, middle)
        first = HALF_PI if positions[0] > HALF_PI else 0.0
        return np.concatenate([[first], middle, [math.pi if positions[-1] > HALF_PI else HALF_PI]])
    return np.concatenate([[0.0], middle, [TOP[name]]])


def regular(name: str, count: int, cell: str, below: int = 0) -> dict[str, Array]:
    """Return positions and edges of `count` equal cells or equally spaced points over the axis's range.

    Polar axes have `count` of them above the surface and `below` of them under it.
    """
    parts = [_regular(name, count, cell, 0.0, 90.0 if name in POLAR else TOP_DEGREES[name])] if count else []
    if below:
        parts.append(_regular(name, below, cell, 90.0, 180.0))
    if len(parts) == 1:
        return {key: np.deg2rad(degrees) for key, degrees in parts[0].items()}
    # the horizon stands once
    return {key: np.deg2rad(np.unique(np.concatenate([part[key] for part in parts]))) for key in parts[0]}


def _regular(name: str, count: int, cell: str, low: float, high: float) -> dict[str, Array]:
    """Return positions and edges in degrees over one range."""
    if cell == "point":
        return {name: np.linspace(low, high, count, endpoint=name not in PERIODIC)}
    # whole steps in degrees first, so that 90 cells sit at 0.5, 1.5, ... degrees to the last bit
    steps = low + np.arange(2 * count + 1, dtype=np.float64) * ((high - low) / (2 * count))
    steps[-1] = high
    return {name: steps[1::2], f"{name}_edges": steps[::2]}


def positions(name: str, value: ArrayLike | str) -> ArrayLike:
    """Return positions in radians from an array in radians or a text in degrees."""
    if not isinstance(value, str):
        return value
    ranged = value.count(":") == 2
    words = value.split(":" if ranged else ",")
    try:
        numbers = [float(word) for word in (words[:2] if ranged else words)]
    except ValueError:
        numbers = []
    if not numbers or (ranged and not COUNT.fullmatch(words[2].strip())):
        raise GridError(f"{name} = {short(value)} is malformed; {_SPEC_HELP}")
    if not all(map(math.isfinite, numbers)):
        raise GridError(f"{name} = {short(value)} is not finite; {_SPEC_HELP}")
    if not ranged:
        return np.deg2rad(np.array(numbers))
    count = int(words[2])
    check_size([count], name)
    if count > 1 and not numbers[0] < numbers[1]:
        raise GridError(f"{name} = {short(value)} does not increase; write start below stop")
    return np.deg2rad(np.linspace(numbers[0], numbers[1], count))


def check(name: str, values: ArrayLike) -> Array:
    """Return a float64 copy of an axis that is one-dimensional, finite, strictly increasing and in range."""
    try:
        axis = np.array(values)
    except (ValueError, TypeError) as error:
        raise GridError(f"{name} is not an array of numbers; {_SPEC_HELP}, or give radians as an array") from error
    if axis.dtype.kind not in "fiu":
        raise GridError(f"{name} has the type {axis.dtype}; give floats in radians, or {_SPEC_HELP}")
    axis = np.atleast_1d(axis.astype(np.float64))
    if axis.ndim != 1 or axis.size < 1:
        raise GridError(f"{name} has the shape {axis.shape}; give one dimension with at least one position")
    if not np.isfinite(axis).all():
        raise GridError(f"{name} holds a NaN or infinity; give finite angles")
    if (np.diff(axis) <= 0.0).any():
        k = int(np.argmax(np.diff(axis) <= 0.0))
        raise GridError(
            f"{name} does not increase: {math.degrees(axis[k]):.6g} then {math.degrees(axis[k + 1]):.6g} degrees; "
            "sort it and drop repeats"
        )
    top, periodic = TOP[name], name in PERIODIC
    if axis[0] < 0.0 or axis[-1] > top or (periodic and axis[-1] >= top):
        worst = axis[0] if axis[0] < 0.0 else axis[-1]
        valid = f"[0, {TOP_DEGREES[name]:g}{')' if periodic else ']'} degrees"
        raise GridError(f"{name} = {math.degrees(worst):.9g} degrees is outside {valid}; arrays are in radians")
    return axis + 0.0  # no -0.0


def check_edges(name: str, positions: Array, values: ArrayLike) -> Array:
    """Return a float64 copy of cell edges that increase and enclose their positions."""
    try:
        edges = np.array(values, dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise GridError(f"{name}_edges is not an array of numbers") from error
    if edges.shape != (positions.size + 1,):
        raise GridError(f"{name}_edges has the shape {edges.shape}; {name} needs ({positions.size + 1},)")
    if not np.isfinite(edges).all() or (np.diff(edges) <= 0.0).any():
        raise GridError(f"{name}_edges must be finite and strictly increasing; take positions further apart")
    top = TOP[name]
    low, high = (-math.pi, 2.0 * TWO_PI) if name in PERIODIC else (0.0, top)
    if edges[0] < low - SAME or edges[-1] > high + SAME or edges[-1] - edges[0] > top + SAME:
        raise GridError(f"{name}_edges reach beyond the axis's range of {TOP_DEGREES[name]:g} degrees")
    if (edges[:-1] > positions).any() or (edges[1:] < positions).any():
        raise GridError(f"{name}_edges do not enclose the positions of {name}")
    return edges


def check_size(counts: tuple[int, ...] | list[int], name: str = "grid") -> None:
    """Refuse counts below 1 or above `MAX_POSITIONS`, and more cells than an index of 31 bits reaches."""
    if min(counts) < 1:
        raise GridError(f"{name} asks for {min(counts)} positions on an axis; give at least 1")
    if max(counts) > MAX_POSITIONS:
        raise GridError(f"{name} asks for {max(counts):,} positions on an axis; give at most 2**20")
    if math.prod(counts) > MAX_CELLS:
        raise GridError(f"{name} asks for {math.prod(counts):,} cells, more than 2**31; take fewer positions")


def short(value: object) -> str:
    """Return at most 60 characters of what the user gave, on one line."""
    text = repr(value) if not isinstance(value, str) else repr(str(value))
    return text if len(text) <= 60 else text[:57] + "..."
