"""What a plan says: the reduced setup, the grid that is left, and item by item what was left out at which cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import FileFormatError, GridError
from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import LUMINANCE, Setup, luminance, resolve
from brdftab.scene import grid_json
from brdftab.scene.scene import Material
from brdftab.scene.subgrid import first_quarter
from brdftab.tables.grid import Grid

# shares of the tolerated error that each kind of item may use up; they add up to 1
SHARES = {"rules": 0.25, "resolution": 0.5, "bounces": 0.125, "lobe": 0.0625, "wavelengths": 0.0625}
KINDS = {
    "exact": "costs nothing: what is left out follows from what is kept, or is never looked up",
    "bound": "a proved bound",
    "measured": "the largest of many probes stays a factor below the number, and the table is checked again",
}


def added_up(values: NDArray[np.floating], luminance: bool) -> NDArray[np.floating]:
    """Return one channel of luminance from R, G, B, where the setup did not do so itself."""
    if not luminance or values.shape[-1] != 3:
        return values
    return (values @ np.array(LUMINANCE))[..., None].astype(values.dtype)


_done: set[str] = set()


def once(name: str, call: Callable[[], object]) -> None:
    """Call the first time in a process: it loads or compiles what a time measured after it shall leave out."""
    if name not in _done:
        call()
        _done.add(name)


@dataclass(frozen=True)
class Item:
    """One thing that is left out.

    Attributes
    ----------
    name : str
        directions, channels, wavelengths, symmetry, reciprocity, bounces, lobe, resolution, rules, layers, table.
    told : str
        What is left out and why, one line.
    kind : {"exact", "bound", "measured"}
        How sure the numbers are, see `KINDS`.
    cell, albedo : float
        Largest error that it causes: in a cell, relative; in the directional albedo, absolute.
    time : float
        Share of the run time before it that it saves, in [0, 1], predicted.
    size : float
        Share of the bytes before it that it saves, in [0, 1].
    """

    name: str
    told: str
    kind: str
    cell: float = 0.0
    albedo: float = 0.0
    time: float = 0.0
    size: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return it as plain JSON."""
        return {
            "name": self.name, "told": self.told, "kind": self.kind, "cell_error": self.cell,
            "albedo_error": self.albedo, "time_saved": self.time, "bytes_saved": self.size,
        }  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """How one material is tabulated for a scene.

    Attributes
    ----------
    model : str
        Registry name.
    given, parameters : dict
        Canonical parameters of the material, and of the reduced setup.
    luminance : bool
        Whether the channels are added up to luminance.
    quantity : str
        As in `Material`.
    grid : Grid or None
        Positions that are computed; None for albedo tables.
    full, whole : Grid or None
        The unplanned grid within the scene's ranges, to which the table can be expanded; the unplanned grid.
    cosines : int
        Cells of an albedo table.
    symmetric : bool
        Whether a quarter of the light's azimuths stands for all.
    apart : int
        Last azimuths that hold averages of cells and enter no cubic.
    zones : tuple of (float, int)
        Largest polar angle (radians) of light and view within which so many bounces are enough, narrowest first.
    floor, tolerance, rules : float
        Values below the first count absolutely (1/sr); error tolerated; error asked of the quadratures.
    dtype : str
        Type of the stored values.
    items : tuple of Item
        What is left out.
    predicted : dict
        ``seconds``, ``seconds_unplanned``, ``bytes``, ``bytes_unplanned``.
    """

    model: str
    given: dict[str, Any]
    parameters: dict[str, Any]
    luminance: bool
    quantity: str
    grid: Grid | None
    full: Grid | None
    whole: Grid | None
    cosines: int = 0
    symmetric: bool = False
    apart: int = 0
    zones: tuple[tuple[float, int], ...] = ()
    floor: float = 1e-9
    tolerance: float = 1e-2
    rules: float = 2.5e-3
    dtype: str = "float32"
    items: tuple[Item, ...] = ()
    predicted: dict[str, float] = field(default_factory=dict)

    @property
    def cell_error(self) -> float:
        """The promised error of a cell, relative."""
        return sum(item.cell for item in self.items)

    @property
    def albedo_error(self) -> float:
        """The promised error of the directional albedo, absolute."""
        return sum(item.albedo for item in self.items)

    @cached_property
    def _setup(self) -> Setup:
        found = resolve(self.model, **self.parameters)
        return luminance(found) if self.luminance else found

    @property
    def folded(self) -> Grid:
        """The positions within the scene's ranges, without those that symmetry gives."""
        assert self.full is not None
        return first_quarter(self.full) if self.symmetric else self.full

    def setup(self) -> Setup:
        """Return the reduced setup."""
        return self._setup

    def to_json(self) -> dict[str, Any]:
        """Return the plan as plain JSON; `from_json` gives it back."""
        return {
            "model": self.model,
            "given": self.given,
            "parameters": self.parameters,
            "luminance": self.luminance,
            "quantity": self.quantity,
            "grid": grid_json.to_json(self.grid, self.full),
            "full": grid_json.to_json(self.full, self.whole),
            "whole": grid_json.to_json(self.whole),
            "cosines": self.cosines,
            "symmetric": self.symmetric,
            "apart": self.apart,
            "zones": [list(zone) for zone in self.zones],
            "floor": self.floor,
            "tolerance": self.tolerance,
            "rules": self.rules,
            "dtype": self.dtype,
            "promised": {"cell_error": self.cell_error, "albedo_error": self.albedo_error},
            "items": [item.to_json() for item in self.items],
            "kinds": KINDS,
            "predicted": self.predicted,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Plan:
        """Build the plan that `to_json` described.

        Raises
        ------
        FileFormatError
            Where a key is missing or has the wrong type.
        """
        try:
            whole = grid_json.from_json(data["whole"])
            full = grid_json.from_json(data["full"], whole)
            grids: dict[str, Any] = {"grid": grid_json.from_json(data["grid"], full), "full": full, "whole": whole}
            items = tuple(
                Item(
                    i["name"], i["told"], i["kind"], i["cell_error"], i["albedo_error"], i["time_saved"],
                    i["bytes_saved"],
                )
                for i in data["items"]
            )  # fmt: skip
            plain = (
                "model",
                "given",
                "parameters",
                "luminance",
                "quantity",
                "cosines",
                "symmetric",
                "apart",
                "floor",
            )
            rest = ("tolerance", "rules", "dtype", "predicted")
            zones = tuple((float(limit), int(cap)) for limit, cap in data["zones"])
            return cls(items=items, zones=zones, **grids, **{key: data[key] for key in (*plain, *rest)})
        except GridError as error:
            raise FileFormatError(
                f"the plan stored in the file is damaged: {error}; tabulate the scene again"
            ) from error
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"the plan stored in the file lacks {error}; tabulate the scene again") from error


@dataclass
class Planned:
    """A material's plan, and what planning has made already: the engine that fills the table, cells of albedos."""

    material: Material
    plan: Plan
    engine: Engine | None = None
    seconds: float = 0.0
    cells: NDArray[np.float64] | None = None
