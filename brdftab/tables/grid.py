"""Where a table holds values: named angle axes, their cells, and how a cell's value is meant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from brdftab.errors import GridError, proposal
from brdftab.tables import axis
from brdftab.tables.axis import SAME, TWO_PI
from brdftab.tables.content import SeveralArrays, told
from brdftab.typing import Array

CELLS = ("center", "average", "point")
DEFAULT_CELL = "center"

ISOTROPIC = ("theta_i", "theta_o", "phi")
ANISOTROPIC = ("theta_i", "phi_i", "theta_o", "phi_o")


@dataclass(frozen=True, eq=False)
class Grid(SeveralArrays):
    """Axes of a table, in radians, with the edges of their cells.

    Attributes
    ----------
    theta_i, theta_o : ndarray of float64, shape (n,)
        Polar angles of light and view, strictly increasing in [0, pi]; beyond pi/2 they lie below the surface.
    phi : ndarray of float64 or None
        Isotropic grids: relative azimuth phi_o - phi_i, strictly increasing in [0, pi].
    phi_i, phi_o : ndarray of float64 or None
        Anisotropic grids: azimuths of light and view, strictly increasing in [0, 2 pi).
    cell : {"center", "average", "point"}
        What a value means: the value at the position (but the average in cells of a singular mirror direction), the
        cell's average, or strictly the value at the position.
    theta_i_edges, theta_o_edges, phi_edges, phi_i_edges, phi_o_edges : ndarray of float64 or None, shape (n + 1,)
        Edges of the cells. Left out, they are Voronoi edges: midpoints between positions, the outer ones at the ends
        of the range; 4-D azimuths are periodic, so their last edge is the first one plus 2 pi.

    Raises
    ------
    GridError
        For an axis that is empty, not finite, not strictly increasing or out of range, and for too many cells.
    """

    theta_i: Array
    theta_o: Array
    phi: Array | None = None
    phi_i: Array | None = None
    phi_o: Array | None = None
    cell: str = DEFAULT_CELL
    theta_i_edges: Array = None  # type: ignore[assignment]  # filled in __post_init__
    theta_o_edges: Array = None  # type: ignore[assignment]  # filled in __post_init__
    phi_edges: Array | None = None
    phi_i_edges: Array | None = None
    phi_o_edges: Array | None = None

    _arrays = "axes['theta_i'], edges['theta_i'] and so on"

    def __post_init__(self) -> None:
        if self.cell not in CELLS:
            raise GridError.not_known("cell", repr(self.cell), CELLS)
        if (self.phi is None) == (self.phi_i is None and self.phi_o is None) or (
            (self.phi_i is None) != (self.phi_o is None)
        ):
            raise GridError("a grid needs either phi (isotropic) or both phi_i and phi_o (anisotropic)")
        for name in (*ISOTROPIC, "phi_i", "phi_o"):
            if name in self.axis_names:
                positions = axis.check(name, getattr(self, name))
                edges = getattr(self, f"{name}_edges")
                edges = axis.check_edges(name, positions, axis.voronoi(name, positions) if edges is None else edges)
                for key, array in ((name, positions), (f"{name}_edges", edges)):
                    array.setflags(write=False)
                    object.__setattr__(self, key, array)
            elif getattr(self, f"{name}_edges") is not None:
                raise GridError(f"{name}_edges is given without {name}")
        axis.check_size(self.shape)

    @property
    def isotropic(self) -> bool:
        """Whether the azimuth is one relative angle (3-D grid)."""
        return self.phi is not None

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the axes in the order of the table's dimensions."""
        return ISOTROPIC if self.isotropic else ANISOTROPIC

    @property
    def axes(self) -> dict[str, Array]:
        """Positions by axis name, in the order of the table's dimensions."""
        return {name: getattr(self, name) for name in self.axis_names}

    @property
    def edges(self) -> dict[str, Array]:
        """Cell edges by axis name, in the order of the table's dimensions."""
        return {name: getattr(self, f"{name}_edges") for name in self.axis_names}

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of positions an axis."""
        return tuple(getattr(self, name).size for name in self.axis_names)

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @property
    def below(self) -> bool:
        """Whether any direction lies below the surface."""
        return max(float(self.theta_i[-1]), float(self.theta_o[-1])) > axis.HALF_PI + SAME

    @property
    def square(self) -> bool:
        """Whether light and view share their positions and edges, so that reciprocity maps cells to cells."""
        pairs = [("theta_i", "theta_o")] if self.isotropic else [("theta_i", "theta_o"), ("phi_i", "phi_o")]
        return all(
            np.array_equal(getattr(self, a + end), getattr(self, b + end)) for a, b in pairs for end in ("", "_edges")
        )

    def nbytes(self, channels: int, dtype: DTypeLike = np.float32) -> int:
        """Return the bytes of one array over this grid with so many channels."""
        return self.size * int(channels) * np.dtype(dtype).itemsize

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Grid):
            return NotImplemented
        return (
            self.cell == other.cell
            and self.axis_names == other.axis_names
            and all(np.array_equal(a, b) for a, b in zip(self.axes.values(), other.axes.values(), strict=True))
            and all(np.array_equal(a, b) for a, b in zip(self.edges.values(), other.edges.values(), strict=True))
        )

    def __hash__(self) -> int:
        return hash((self.cell, self.axis_names, *(array.tobytes() for array in self.axes.values())))

    def __repr__(self) -> str:
        sizes = " x ".join(f"{name} {array.size}" for name, array in self.axes.items())
        return told(self, sizes, f"cell={self.cell!r}")

    @classmethod
    def parse(cls, text: str, cell: str = DEFAULT_CELL) -> Grid:
        """Build a regular grid from ``"90x90x180"`` (isotropic) or ``"12x24x12x24"`` (anisotropic).

        Parameters
        ----------
        text : str
            Counts in the order theta_i x theta_o x phi, or theta_i x phi_i x theta_o x phi_o. A polar count as
            ``45+45`` gives positions above and below the surface, for dielectrics that transmit.
        cell : {"center", "average", "point"}
            With center and average the cells are equally wide and positions are their centres; with point the
            positions are equally spaced and include both ends (4-D azimuths: without 360 degrees).

        Returns
        -------
        Grid

        Raises
        ------
        GridError
            For malformed text, a count below 1, too many cells or an unknown `cell`.
        """
        words = [word.strip() for word in str(text).lower().split("x")]
        names = ISOTROPIC if len(words) == 3 else ANISOTROPIC
        halves = [word.split("+") if word.count("+") == 1 and word[0] != "+" else [word] for word in words]
        if (
            len(words) not in (3, 4)
            or not all(axis.COUNT.fullmatch(part) for half in halves for part in half)
            or any(len(half) > 1 and name not in axis.POLAR for name, half in zip(names, halves, strict=True))
        ):
            raise GridError(
                f"grid = {axis.short(text)} is malformed; write theta_i x theta_o x phi as in 90x90x180, "
                "or theta_i x phi_i x theta_o x phi_o as in 12x24x12x24; 45+45 polar angles lie above and below"
            )
        counts = [[int(part) for part in half] for half in halves]
        if any(min(half) < 0 for half in counts if len(half) > 1):
            raise GridError(f"grid = {axis.short(text)} asks for a negative count; give 0 or more on each side")
        axis.check_size([sum(half) for half in counts])
        if cell not in CELLS:
            raise GridError.not_known("cell", repr(cell), CELLS)
        given: dict[str, Any] = {}
        for name, half in zip(names, counts, strict=True):
            given |= axis.regular(name, half[0], cell, *half[1:])
        return cls(**given, cell=cell)

    @classmethod
    def from_axes(
        cls,
        *,
        theta_i: ArrayLike | str,
        theta_o: ArrayLike | str | None = None,
        phi: ArrayLike | str | None = None,
        phi_i: ArrayLike | str | None = None,
        phi_o: ArrayLike | str | None = None,
        cell: str = DEFAULT_CELL,
    ) -> Grid:
        """Build a grid from explicit positions; the cells are Voronoi cells.

        Parameters
        ----------
        theta_i, theta_o, phi, phi_i, phi_o : array_like of float or str
            Positions in radians, or text in degrees: ``"start:stop:count"`` (both ends included) or ``"a,b,c"``.
            `theta_o` left out equals `theta_i`. Give `phi` for an isotropic grid, or `phi_i` and `phi_o`.
        cell : {"center", "average", "point"}
            What a value means.

        Returns
        -------
        Grid

        Raises
        ------
        GridError
            For malformed text and for whatever `Grid` refuses.
        """
        given = {"theta_i": theta_i, "theta_o": theta_i if theta_o is None else theta_o}
        given |= {
            name: value for name, value in (("phi", phi), ("phi_i", phi_i), ("phi_o", phi_o)) if value is not None
        }
        axes: dict[str, Any] = {name: axis.positions(name, value) for name, value in given.items()}
        return cls(**axes, cell=cell)

    @classmethod
    def resolve(cls, obj: Grid | str | Mapping[str, Any], cell: str | None = None) -> Grid:
        """Return a grid from what a user may give for one.

        Parameters
        ----------
        obj : Grid, str or mapping
            A grid, text for `parse`, or the arguments of `from_axes`.
        cell : str or None
            What a value means; None takes the grid's own, or "center".

        Returns
        -------
        Grid

        Raises
        ------
        GridError
            Where `obj` is none of these, or its own `cell` contradicts `cell`.
        """
        if isinstance(obj, str):
            return cls.parse(obj, cell or DEFAULT_CELL)
        if isinstance(obj, Mapping):
            unknown = [str(key) for key in obj if key not in (*axis.TOP, "cell")]
            if unknown or "theta_i" not in obj:
                wrong = f"has the unknown key {axis.short(unknown[0])}" if unknown else "lacks theta_i"
                near = proposal(unknown[0], (*axis.TOP, "cell")) if unknown else ""
                raise GridError(f"grid {wrong}; {near}valid keys: {', '.join(axis.TOP)}, cell")
            own = obj.get("cell")
            if own is None or cell is None or own == cell:
                return cls.from_axes(**{**obj, "cell": own or cell or DEFAULT_CELL})
        elif isinstance(obj, Grid):
            own = obj.cell
            if cell is None or own == cell:
                return obj
        else:
            raise GridError(
                f"grid = {axis.short(obj)} is neither a Grid, a text such as 90x90x180, nor a mapping of axes"
            )
        raise GridError(f"cell = {cell} contradicts the grid's own cell = {own}; give it in one place")

    def mirror_cells(self) -> NDArray[np.int64]:
        """Return the cells that hold a mirror direction, where singular models are infinite.

        Returns
        -------
        ndarray of int64, shape (k, 3) or (k, 4)
            Indices along the grid's axes, in C order. Cells (center, average): the cells of theta_i and theta_o
            share more than an edge, and the azimuth cell touches phi_o - phi_i = pi (4-D: the light's cell turned
            by pi shares more than an edge with the view's cell, so that equal cells mark just the opposite one).
            Point: positions with theta_i = theta_o and phi = pi or theta = 0, within 1e-12.
        """
        if self.cell == "point":
            equal = np.abs(self.theta_i[:, None] - self.theta_o) <= SAME
            pole = equal & (self.theta_i[:, None] <= SAME)
        else:
            equal = _overlap(self.theta_i_edges, self.theta_o_edges, 0.0) > SAME
            pole = np.zeros_like(equal)
        azimuths = self._opposite()
        polar, turned = np.argwhere(equal), np.argwhere(azimuths)
        found = _product(polar, turned)
        if pole.any():
            anywhere = _product(np.argwhere(pole), np.argwhere(np.ones_like(azimuths)))
            found = np.unique(np.concatenate([found, anywhere]), axis=0)
        if not self.isotropic:
            found = found[:, [0, 2, 1, 3]]
        return found[np.lexsort(found.T[::-1])]

    def _opposite(self) -> NDArray[np.bool_]:
        """Azimuth cells, shape (phi,) or (phi_i, phi_o), that hold phi_o - phi_i = pi."""
        if self.phi is not None and self.phi_edges is not None:
            reach = self.phi if self.cell == "point" else self.phi_edges[1:]
            return reach >= math.pi - SAME
        assert self.phi_i is not None
        assert self.phi_o is not None
        if self.cell == "point":
            return np.abs(np.mod(self.phi_o - self.phi_i[:, None], TWO_PI) - math.pi) <= SAME
        assert self.phi_i_edges is not None
        assert self.phi_o_edges is not None
        turns = (-math.pi, math.pi, 3.0 * math.pi, -3.0 * math.pi)
        return np.max([_overlap(self.phi_i_edges, self.phi_o_edges, turn) for turn in turns], axis=0) > SAME

    def to_json(self) -> dict[str, Any]:
        """Return the grid as JSON-able dict ``{"cell", "axes", "edges"}``; floats keep every bit."""
        return {
            "cell": self.cell,
            "axes": {name: array.tolist() for name, array in self.axes.items()},
            "edges": {name: array.tolist() for name, array in self.edges.items()},
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Grid:
        """Build the grid that `to_json` described, bit for bit.

        Raises
        ------
        GridError
            Where a key is missing, has the wrong type, or holds an axis that `Grid` refuses.
        """
        axes, edges = (data.get(key) if isinstance(data, Mapping) else None for key in ("axes", "edges"))
        if not isinstance(axes, Mapping) or not isinstance(edges, Mapping) or not isinstance(data.get("cell"), str):
            raise GridError("the grid needs cell (text), axes and edges (mappings)")
        if set(axes) not in (set(ISOTROPIC), set(ANISOTROPIC)) or set(edges) != set(axes):
            raise GridError(f"axes and edges must both name {', '.join(ISOTROPIC)} or {', '.join(ANISOTROPIC)}")
        given: dict[str, Any] = {}
        for source, end in ((axes, ""), (edges, "_edges")):
            for name, numbers in source.items():
                if not isinstance(numbers, list) or not all(type(x) in (int, float) for x in numbers):
                    raise GridError(f"{name}{end} must be a list of numbers")
                given[name + end] = numbers
        return cls(**given, cell=data["cell"])


def _overlap(a: Array, b: Array, turn: float) -> Array:
    """Shared length, shape (n_a, n_b), of the cells with edges `a` shifted by `turn` and those with edges `b`."""
    low = np.maximum((a[:-1] + turn)[:, None], b[:-1])
    high = np.minimum((a[1:] + turn)[:, None], b[1:])
    return high - low


def _product(left: NDArray[np.int64], right: NDArray[np.int64]) -> NDArray[np.int64]:
    """Every row of `left` with every row of `right`, shape (n_left * n_right, columns)."""
    return np.hstack([np.repeat(left, len(right), axis=0), np.tile(right, (len(left), 1))])
