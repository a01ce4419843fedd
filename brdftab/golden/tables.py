"""Special tables beside the points: a list in tables.toml, made by `brdftab.tabulate`."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from brdftab import models
from brdftab.errors import FileFormatError, ParameterError
from brdftab.io import ENDINGS, write
from brdftab.io.atomic import show
from brdftab.tabulation.tabulate import TOLERANCE, tabulate

LIST = "tables.toml"


@dataclass(frozen=True)
class Special:
    """One table of the list.

    Attributes
    ----------
    file : str
        Name of the file, ending in .exr or .npz.
    model : str
        Registry name.
    grid : str, dict or None
        As `brdftab.tabulate` takes it, positions in degrees; None for the default.
    cell : str or None
    dtype : str
    tolerance : float
    components : bool
    parameters : dict
        Of the model; angles in degrees, as on the command line.
    """

    file: str
    model: str
    grid: str | dict[str, Any] | None = None
    cell: str | None = None
    dtype: str = "float32"
    tolerance: float = TOLERANCE
    components: bool = False
    parameters: dict[str, Any] = field(default_factory=dict)

    def in_radians(self) -> dict[str, Any]:
        """Return the parameters as the API takes them."""
        spec = models.spec(self.model)
        return {
            name: math.radians(value) if spec.param(name).unit == "rad" else value
            for name, value in self.parameters.items()
        }


def special_tables(folder: Path) -> list[Special]:
    """Read the list of a folder; empty where there is none.

    Raises
    ------
    FileFormatError
        If the list is no TOML or an entry is malformed.
    ParameterError
        If an entry names an unknown model.
    """
    path = folder / LIST
    if not path.exists():
        return []
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8")).get("table", [])
        found = [Special(**entry) for entry in entries]
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, TypeError) as error:
        raise FileFormatError(
            f"{show(path)}: {' '.join(str(error).split())}; a [[table]] takes file, model, grid, cell, dtype, "
            "tolerance, components and parameters"
        ) from error
    names = [entry.file for entry in found]
    for entry in found:
        if not entry.file.endswith(ENDINGS) or "/" in entry.file or names.count(entry.file) > 1:
            raise FileFormatError(
                f"{show(path)}: file = {entry.file} is no name of its own ending in {' or '.join(ENDINGS)}; mend it"
            )
        if entry.model not in models.names():
            raise ParameterError.not_known(f"{show(path)}: model", entry.model, models.names())
    return found


def write_special(entry: Special, folder: Path, *, overwrite: bool = False) -> None:
    """Tabulate one entry and write it into the folder; raises as `brdftab.tabulate` and `brdftab.write`."""
    table = tabulate(
        entry.model,
        entry.grid,
        cell=entry.cell,
        dtype=entry.dtype,
        tolerance=entry.tolerance,
        components=entry.components,
        **entry.in_radians(),
    )
    write(table, folder / entry.file, overwrite=overwrite)
