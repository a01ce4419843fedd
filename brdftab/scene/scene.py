"""The scene file: materials, what lights and camera can see of them, and the error that the scene tolerates."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brdftab.errors import ParameterError
from brdftab.io.atomic import show
from brdftab.io.toml import Entry, read_toml
from brdftab.models import names, spec
from brdftab.models.resolve import Setup, resolve

QUANTITIES = ("rgb", "luminance", "wavelengths", "albedo")
_SHARED = ("theta_i", "theta_o", "quantity", "wavelengths", "tolerance", "albedo_tolerance", "floor", "grid")
_SCENE = (*_SHARED, "materials", "memory", "files", "dtype")
_MATERIAL = (*_SHARED, "name", "model", "parameters", "layers", "size")
_SIZE = re.compile(r"\s*([0-9.]+)\s*([KMG]?)(i?)B\s*", re.I)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.-]{0,99}")


@dataclass(frozen=True)
class Material:
    """One material of a scene, and what the scene sees of it.

    Attributes
    ----------
    name : str
        Name of its file.
    model : str
        Registry name; empty for layers of scratches.
    parameters : dict
        As the API takes them, radians.
    layers : str
        File of layers of scratches instead of a model, or empty.
    size : int
        Texels a side of the maps of such layers.
    theta_i, theta_o : tuple of float
        Ranges that lights and camera reach, radians, both ends included.
    quantity : {"rgb", "luminance", "wavelengths", "albedo"}
        What is looked up.
    wavelengths : tuple of float
        In nm, for that quantity.
    tolerance : float
        Error of a cell that the scene tolerates, relative to the cell's largest channel or to `floor`.
    albedo_tolerance : float
        Absolute error of the directional albedo that it tolerates.
    floor : float
        Values below it (1/sr) count absolutely.
    grid : str
        The grid that is taken without a plan; empty for the default of the model.
    dtype : str
        Type of the stored values.
    """

    name: str
    model: str
    parameters: dict[str, Any]
    layers: str
    size: int
    theta_i: tuple[float, float]
    theta_o: tuple[float, float]
    quantity: str
    wavelengths: tuple[float, ...]
    tolerance: float
    albedo_tolerance: float
    floor: float
    grid: str
    dtype: str

    def setup(self) -> Setup:
        """Return the model, checked; wavelengths become its channels where it takes them."""
        more = {"wavelengths": list(self.wavelengths)} if self.wavelengths else {}
        return resolve(self.model, **{**self.parameters, **more})


@dataclass(frozen=True)
class Scene:
    """Materials with the budget that they share.

    Attributes
    ----------
    materials : tuple of Material
    memory, files : float
        Bytes that one table may take in memory, and all files together on the disk; inf where not given.
    source : str
        File that it was read from, or another name.
    """

    materials: tuple[Material, ...]
    memory: float
    files: float
    source: str


def _range(entry: Entry, key: str) -> tuple[float, float]:
    """Return a range of polar angles in radians."""
    value = entry.table.get(key, [0.0, 180.0])
    good = isinstance(value, list) and len(value) == 2
    if not good or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in value):
        raise ParameterError(f"{entry.head}: {key} = {value!r} is no range; give [low, high] in degrees, as [0, 75]")
    low, high = (float(x) for x in value)
    if not 0.0 <= low < high <= 180.0:
        raise ParameterError(
            f"{entry.head}: {key} = [{low:g}, {high:g}] is outside 0 <= low < high <= 180 degrees; mend the range"
        )
    return math.radians(low), math.radians(high)


def _bytes(entry: Entry, key: str) -> float:
    """Return a size in bytes from a number or text such as "200 MB"."""
    value = entry.table.get(key)
    if value is None:
        return math.inf
    if isinstance(value, str) and (found := _SIZE.fullmatch(value)):
        step = 1024.0 if found[3] else 1000.0
        value = float(found[1]) * step ** {"": 0, "K": 1, "M": 2, "G": 3}[found[2].upper()]
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise ParameterError(f'{entry.head}: {key} = {value!r} is no size; give bytes or text, as "200 MB" or "2 GiB"')
    return float(value)


def _waves(entry: Entry, quantity: str) -> tuple[float, ...]:
    value = entry.table.get("wavelengths")
    if (value is None) == (quantity == "wavelengths"):
        told = "is missing" if value is None else f'= {value!r} goes with quantity = "wavelengths" only'
        raise ParameterError(
            f"{entry.head}: wavelengths {told}; give a list in nm, as [450, 550, 650], or another quantity"
        )
    if value is None:
        return ()
    if not isinstance(value, list) or not value or not all(isinstance(x, int | float) for x in value):
        raise ParameterError(
            f"{entry.head}: wavelengths = {value!r} is no list of numbers; give nm, as [450, 550, 650]"
        )
    return tuple(float(x) for x in value)


def _choice(entry: Entry, key: str, choices: tuple[str, ...]) -> str:
    value = entry.table.get(key, choices[0])
    if value not in choices:
        raise ParameterError.not_known(f"{entry.head}: {key}", repr(value), choices)
    return str(value)


def _text(entry: Entry, key: str, default: str = "") -> str:
    value = entry.table.get(key, default)
    if not isinstance(value, str):
        raise ParameterError(f"{entry.head}: {key} = {value!r} is no text; put it in quotes")
    return value


def _parameters(entry: Entry, model: str) -> dict[str, Any]:
    """Return a model's parameters; angles in degrees become radians."""
    given = entry.table.get("parameters", {})
    if not isinstance(given, dict):
        raise ParameterError(
            f'{entry.head}: parameters = {given!r} is no table; give {{ alpha = 0.3, material = "Au" }}'
        )
    units = {p.name: p.unit for p in spec(model).params}
    turned = {
        key: math.radians(value) if units.get(key) == "rad" and isinstance(value, int | float) else value
        for key, value in given.items()
    }
    with entry.named():
        resolve(model, **turned)
    return turned


def _material(entry: Entry, folder: Path, dtype: str) -> Material:
    """Return one material from its table, the scene's keys already filled in."""
    layers = _text(entry, "layers")
    model = _text(entry, "model")
    if bool(layers) == bool(model):
        told = "model and layers exclude each other" if model else "model is missing"
        raise ParameterError(f"{entry.head}: {told}; give a model of the registry, or a file of layers of scratches")
    if model and model not in names():
        raise ParameterError.not_known(f"{entry.head}: model", repr(model), names())
    name = _text(entry, "name", model or Path(layers).stem)
    if not _NAME.fullmatch(name):
        raise ParameterError(f"{entry.head}: name = {name!r} cannot name a file; use letters, digits, - and _")
    quantity = _choice(entry, "quantity", QUANTITIES)
    waves = _waves(entry, quantity)
    if waves and model and not spec(model).shares("wavelengths"):
        raise ParameterError(f'{entry.head}: model = {model} has no wavelengths; give quantity = "rgb"')
    tolerance = entry.number("tolerance", 1e-2, 1e-6, 0.5, "relative error of a cell that the scene tolerates")
    found = Material(
        name=name,
        model=model,
        parameters=_parameters(entry, model) if model else {},
        layers=str(folder / layers) if layers else "",
        size=entry.whole("size", 512, 8, 4096, "texels a side of the maps of layers, a power of two"),
        theta_i=_range(entry, "theta_i"),
        theta_o=_range(entry, "theta_o"),
        quantity=quantity,
        wavelengths=waves,
        tolerance=tolerance,
        albedo_tolerance=entry.number("albedo_tolerance", tolerance, 1e-6, 0.5, "absolute error of the albedo"),
        floor=entry.number("floor", 1e-9, 1e-12, 1e3, "values below count absolutely, 1/sr"),
        grid=_text(entry, "grid"),
        dtype=dtype,
    )
    if model:
        with entry.named():
            resolve(model, **found.setup().parameters)
    return found


def _tables(top: Entry, table: dict[str, Any], folder: Path) -> list[tuple[str, Any, Path]]:
    """Return (name in errors, keys, folder) of all materials: those of the file and those of a folder."""
    given = table.get("material", [])
    if not isinstance(given, list):
        raise ParameterError(f"{top.head}: material is no list of tables; write [[material]]")
    found: list[tuple[str, Any, Path]] = [(f"material {n}", one, folder) for n, one in enumerate(given, start=1)]
    more = _text(top, "materials")
    if more:
        files = sorted((folder / more).glob("*.toml"))
        if not files:
            raise ParameterError(f"{top.head}: materials = {more!r} is no folder with .toml files; give one")
        found += [(f"{file.name}", {"name": file.stem, **read_toml(file)}, file.parent) for file in files]
    if not found:
        raise ParameterError(f"{top.head}: material is missing; give at least one [[material]] with a model")
    return found


def parse(table: dict[str, Any], source: str = "scene", folder: str | os.PathLike[str] = ".") -> Scene:
    """Return the scene that a parsed file describes; see `read`.

    Parameters
    ----------
    table : dict
        The file's tables: scene (optional) and material.
    source : str
        Name in errors.
    folder : path-like
        Where paths count from.

    Raises
    ------
    ParameterError
        If a key is unknown, missing or out of range, or two materials have one name.
    FileFormatError
        If a table is none.
    """
    Entry(source, "", table, ("scene", "material"))
    top = Entry(source, "scene", table.get("scene", {}), _SCENE)
    dtype = _choice(top, "dtype", ("float32", "float64"))
    shared = {key: top.table[key] for key in _SHARED if key in top.table}
    materials = []
    for where, given, home in _tables(top, table, Path(folder)):
        own = Entry(source, where, given, _MATERIAL)
        if own.table.get("quantity", "wavelengths") != "wavelengths":
            shared = {key: value for key, value in shared.items() if key != "wavelengths"}
        own.table = {**shared, **own.table}
        materials.append(_material(own, home, dtype))
    seen: set[str] = set()
    for material in materials:
        if material.name in seen:
            raise ParameterError(
                f"{show(source)}: name = {material.name!r} stands twice; give each material its own name"
            )
        seen.add(material.name)
    return Scene(tuple(materials), _bytes(top, "memory"), _bytes(top, "files"), source)


def read(path: str | os.PathLike[str]) -> Scene:
    """Read a scene file (TOML); angles in degrees.

    Raises
    ------
    FileFormatError
        If it is no TOML.
    ParameterError
        If it cannot be opened, or a key is unknown, missing or out of range.
    """
    return parse(read_toml(path), os.fspath(path), Path(path).parent)
