"""Files of point values: what a model gives at listed directions, in every setting, with how it was made."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brdftab._version import __version__
from brdftab.errors import BrdftabError, FileFormatError
from brdftab.evaluation.points import ORDERS
from brdftab.golden.quantities import QUANTITIES, tolerance_of
from brdftab.golden.settings import directions, settings
from brdftab.io.atomic import atomic, check_target, show
from brdftab.models.resolve import component_names, resolve
from brdftab.system import machine
from brdftab.timing import Clock
from brdftab.typing import Array

FORMAT = "brdftab-golden"
SUFFIX = ".points.npz"
# rounding differs from processor to processor and grows in quadratures; a change of a formula is far larger
RTOL = 1e-7
# of the largest value of a quantity: cancelled sums leave this
ATOL_PART = 1e-10
# what stands along the axes of each quantity
AXES = {
    "values": "pair, channel",
    "components": "pair, component, channel",
    "albedo": "angle, channel",
    "pdf": "pair",
    "samples": "draw, (theta_o, phi_o, pdf, weight of each channel)",
}


@dataclass(frozen=True)
class Held:
    """One setting of a model and its numbers.

    Attributes
    ----------
    label : str
        The setting in words.
    parameters : dict
        Canonical parameters.
    channels, components : tuple of str
        Names along the last axis, and of the components.
    tolerance : float
        Relative error asked of the rules.
    directions : ndarray (4, N)
        theta_i, theta_o, phi, phi_i in radians.
    quantities : dict of str to ndarray
        By name, as in `brdftab.golden.quantities`.
    """

    label: str
    parameters: dict[str, Any]
    channels: tuple[str, ...]
    components: tuple[str, ...]
    tolerance: float
    directions: Array
    quantities: dict[str, Array]


def measure(
    label: str, model: str, parameters: dict[str, Any], at: Array | None = None, tolerance: float | None = None
) -> Held:
    """Compute all quantities of one setting, at its own directions or given ones (4, N)."""
    setup = resolve(model, **parameters)
    at = directions(setup) if at is None else at
    asked = tolerance_of(setup) if tolerance is None else tolerance
    found = {name: function(setup, at, asked) for name, function in QUANTITIES.items()}
    held = {name: np.asarray(value, dtype=np.float64) for name, value in found.items() if value is not None}
    names = component_names(setup, ORDERS)
    return Held(label, setup.parameters, setup.channels, names, asked, at, held)


def measured(model: str) -> Iterator[Held]:
    """Compute every setting of a model, one after the other."""
    for label, given in settings(model).items():
        yield measure(label, model, given)


def write_points(model: str, path: Path, *, overwrite: bool = False) -> float:
    """Compute and write a model's file; return the seconds it took.

    Raises
    ------
    OutputExistsError, BrdftabError
        As `brdftab.io.atomic.atomic`.
    """
    check_target(path, overwrite=overwrite)
    clock = Clock()
    held = list(measured(model))
    seconds = clock.seconds
    arrays = {"metadata": np.array(json.dumps(_head(model, held), allow_nan=False))}
    for number, h in enumerate(held):
        arrays[f"{number}.directions"] = h.directions
        arrays |= {f"{number}.{name}": value for name, value in h.quantities.items()}
    with atomic(path, overwrite=overwrite) as temporary, open(temporary, "wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    return seconds


def _head(model: str, held: list[Held]) -> dict[str, Any]:
    """Return what a file says of itself beside its arrays."""
    return {
        "format": FORMAT,
        "format_version": 1,
        "version": __version__,
        "model": model,
        "rtol": RTOL,
        "atol_part": ATOL_PART,
        "units": "directions theta_i, theta_o, phi = phi_o - phi_i, phi_i in radians; values and densities in 1/sr",
        "axes": AXES,
        "machine": machine(),
        "settings": [
            {
                "label": h.label,
                "parameters": h.parameters,
                "channels": h.channels,
                "components": h.components,
                "tolerance": h.tolerance,
                "quantities": list(h.quantities),
            }
            for h in held
        ],
    }


def read_points(path: Path) -> tuple[dict[str, Any], list[Held]]:
    """Read a file of point values: its head, and its settings.

    Raises
    ------
    FileFormatError
        If the file is not one of point values, or damaged.
    BrdftabError
        If it cannot be opened.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            head = json.loads(str(file["metadata"]))
            if head["format"] != FORMAT:
                raise FileFormatError(f"{show(path)}: is a file of another kind; brdftab golden record writes these")
            held = [
                Held(
                    str(s["label"]),
                    dict(s["parameters"]),
                    tuple(s["channels"]),
                    tuple(s["components"]),
                    float(s["tolerance"]),
                    file[f"{number}.directions"],
                    {name: file[f"{number}.{name}"] for name in s["quantities"]},
                )
                for number, s in enumerate(head["settings"])
            ]
            return {"rtol": float(head["rtol"]), "atol_part": float(head["atol_part"]), **head}, held
    except OSError as error:
        raise BrdftabError(f"{show(path)}: cannot be opened ({error.strerror or error}); check the path") from error
    except (KeyError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise FileFormatError(
            f"{show(path)}: is no file of golden point values, or damaged; write it again with brdftab golden record"
        ) from error
