"""Layers of scratches over a base material, described in a TOML file."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.io.atomic import show
from brdftab.io.toml import Entry, read_toml
from brdftab.models.resolve import Setup, resolve
from brdftab.scratch_layers.areas import covered, density_of
from brdftab.scratch_layers.combine import COMBINATIONS

MOST_LAYERS = 256
_TOP = ("seed", "psi", "combination", "base", "layer")
_MATERIAL = ("material", "eta", "k", "ior", "f0")
_LAYER = (
    "profile", *_MATERIAL, "density", "area", "width", "length", "orientation", "spread", "count", "seed"
)  # fmt: skip


@dataclass(frozen=True)
class Layer:
    """One set of parallel scratches.

    Attributes
    ----------
    name : str
        Number of the entry in the file, and of the member of a group: ``2`` or ``2.07``.
    profile : str
        Cross-section, as the model ``scratch`` takes it.
    material : dict
        Its reflectance, as in the registry.
    density : float
        Threshold of the noise, in [0, 2]: half axes of a scratch are density times length and width.
    area : float
        Share of the surface that it covers, in [0, 1].
    width, length : float
        Mean spacing of the scratches across and along, in tiles.
    angle : float
        Direction against u, radians.
    seed : tuple of int
        Of its own random numbers.
    """

    name: str
    profile: str
    material: dict[str, Any]
    density: float
    area: float
    width: float
    length: float
    angle: float
    seed: tuple[int, ...]

    def setup(self, psi: float) -> Setup:
        """Return the model ``scratch`` with this layer's profile and material, its cone blurred to psi (radians)."""
        return resolve("scratch", profile=self.profile, psi=psi, **self.material)

    def to_json(self) -> dict[str, Any]:
        """Return what a file says of it; angles in degrees."""
        return {
            "name": self.name, "profile": self.profile, **self.material, "density": self.density, "area": self.area,
            "width": self.width, "length": self.length, "angle_degrees": math.degrees(self.angle),
        }  # fmt: skip


@dataclass(frozen=True)
class Layered:
    """A base material and the scratches in it.

    Attributes
    ----------
    base_model : str
        Registry name.
    base_parameters : dict
        As the API takes them, radians.
    layers : tuple of Layer
    psi : float
        Half width to which cones of reflection are blurred, radians.
    combination : {"normalised", "union"}
        What happens where areas overlap; see `brdftab.scratch_layers.combine`.
    source : str
        File that it was read from, or another name.
    """

    base_model: str
    base_parameters: dict[str, Any]
    layers: tuple[Layer, ...]
    psi: float
    combination: str
    source: str

    @cached_property
    def base(self) -> Setup:
        """The base, checked."""
        return resolve(self.base_model, **self.base_parameters)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Channels of the sum; one channel (Y) beside three counts in each.

        Raises
        ------
        ParameterError
            If the base and a layer have channels that do not go together.
        """
        found = self.base.channels
        for layer in self.layers:
            other = layer.setup(self.psi).channels
            if len(found) == 1:
                found = other
            elif len(other) > 1 and other != found:
                raise ParameterError(
                    f"{show(self.source)}: layer {layer.name} has the channels {','.join(other)} where others have "
                    f"{','.join(found)}; give materials with equal channels"
                )
        return found

    def to_json(self) -> dict[str, Any]:
        """Return what it holds; angles in degrees."""
        return {
            "base": {"model": self.base_model, **self.base.parameters},
            "layers": [layer.to_json() for layer in self.layers],
            "psi_degrees": math.degrees(self.psi),
            "combination": self.combination,
        }


def _base(source: str, table: Any) -> tuple[str, dict[str, Any]]:
    """Return the base's model and parameters; angles in radians."""
    entry = Entry(source, "base", table, None)
    name = entry.table.pop("model", None)
    if name not in models.names() or name == "scratch":
        known = [n for n in models.names() if n != "scratch"]
        if name is None:
            raise ParameterError(f"{entry.head}: model is missing; choose one of {', '.join(known)}")
        raise ParameterError.not_known(f"{entry.head}: model", repr(name), known)
    units = {p.name: p.unit for p in models.spec(name).params}
    parameters = {
        key: math.radians(value) if units.get(key) == "rad" and isinstance(value, int | float) else value
        for key, value in entry.table.items()
    }
    with entry.named():
        resolve(name, **parameters)
    return name, parameters


def _profile(entry: Entry, folder: Path) -> str:
    """Return the profile's name; a file's path counts from the folder of the layers."""
    text = entry.table.get("profile")
    if not isinstance(text, str):
        told = "is missing" if text is None else f"= {text!r} is no text"
        raise ParameterError(f'{entry.head}: profile {told}; give one as "quartic:1" or "v:45"')
    form, _, path = text.partition(":")
    return f"file:{folder / path}" if form == "file" and path else text


def _area(entry: Entry) -> tuple[float, float]:
    """Return density and area from the one of them that is given."""
    given = [key for key in ("density", "area") if key in entry.table]
    if len(given) != 1:
        told = "density and area exclude each other" if given else "density is missing"
        raise ParameterError(f"{entry.head}: {told}; give density (threshold of the noise) or area (share covered)")
    if given == ["density"]:
        density = entry.number("density", None, 0.0, 2.0, "the threshold of the noise")
        return density, covered(density)
    area = entry.number("area", None, 0.0, 1.0, "the share of the surface that is covered")
    return density_of(area), area


def _group(entry: Entry, number: int, folder: Path, seed: int, psi: float) -> list[Layer]:
    """Return the layers of one entry: one, or as many as count says."""
    profile = _profile(entry, folder)
    material = {key: entry.table[key] for key in _MATERIAL if key in entry.table}
    with entry.named():
        resolve("scratch", profile=profile, psi=psi, **material)
    density, area = _area(entry)
    width = entry.number("width", None, 0.0, 1.0, "mean spacing across the scratches, in tiles", open_low=True)
    length = entry.number("length", None, 0.0, 1.0, "mean spacing along the scratches, in tiles", open_low=True)
    middle = entry.number("orientation", 0.0, -360.0, 360.0, "degrees against u")
    spread = entry.number("spread", 0.0, 0.0, 360.0, "degrees, about the orientation")
    count = entry.whole("count", 1, 1, MOST_LAYERS, "layers of the group")
    own = entry.whole("seed", seed, 0, 2**63 - 1, "of this entry's random numbers")
    rng = np.random.Generator(np.random.PCG64([own, number]))
    # one angle in each equal part of the spread, so that a small group has no gaps
    places = (np.arange(count) + rng.random(count)) / count - 0.5
    angles = np.radians(middle + spread * places)
    return [
        Layer(
            f"{number}.{n + 1:02d}" if count > 1 else f"{number}",
            profile, material, density, area, width, length, float(angles[n]), (own, number, n),
        )
        for n in range(count)
    ]  # fmt: skip


def parse(table: dict[str, Any], source: str = "layers", folder: str | os.PathLike[str] = ".") -> Layered:
    """Return the layers that a parsed file describes; see `read`.

    Parameters
    ----------
    table : dict
        The file's keys: seed, psi, combination, base, layer.
    source : str
        Name in errors.
    folder : path-like
        Where paths of profiles count from.

    Raises
    ------
    ParameterError
        If a key is unknown, missing or out of range.
    FileFormatError
        If a table is none, or a profile's file holds no heights.
    """
    top = Entry(source, "", table, _TOP)
    seed = top.whole("seed", 0, 0, 2**63 - 1, "of the random numbers")
    psi = math.radians(top.number("psi", 1.0, 0.01, 20.0, "half width of the blurred cone, degrees"))
    combination = top.table.get("combination", COMBINATIONS[0])
    if combination not in COMBINATIONS:
        raise ParameterError.not_known(f"{top.head}: combination", repr(combination), COMBINATIONS)
    if "base" not in top.table:
        raise ParameterError(f'{top.head}: base is missing; give [base] with model = "smith" or another')
    base, parameters = _base(source, top.table["base"])
    entries = top.table.get("layer", [])
    if not isinstance(entries, list) or not entries:
        raise ParameterError(f"{top.head}: layer is missing; give at least one [[layer]] with a profile")
    found: list[Layer] = []
    for number, given in enumerate(entries, start=1):
        entry = Entry(source, f"layer {number}", given, _LAYER)
        found += _group(entry, number, Path(folder), seed, psi)
    if len(found) > MOST_LAYERS:
        raise ParameterError.out_of_range(f"{top.head}: layers", len(found), f"[1, {MOST_LAYERS}]", "lower a count")
    layered = Layered(base, parameters, tuple(found), psi, combination, source)
    assert layered.channels
    return layered


def read(path: str | os.PathLike[str]) -> Layered:
    """Read a TOML file of layers.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    Layered

    Raises
    ------
    FileFormatError
        If it is no TOML.
    ParameterError
        If it cannot be opened, or a key is unknown, missing or out of range.
    """
    name = os.fspath(path)
    table = read_toml(name)
    return parse(table, name, Path(name).parent)
