"""Tables of directional and average albedo over cosine and roughness, which renderers take for energy compensation."""

from __future__ import annotations

import json
import math
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brdftab import models
from brdftab._version import __version__
from brdftab.errors import BrdftabError, FileFormatError, ParameterError
from brdftab.evaluation.agreement import least_errors
from brdftab.evaluation.albedo import check_fixed, finer_tolerance, many, nodes_for, split
from brdftab.evaluation.engine import Engine, Progress
from brdftab.evaluation.points import check_tolerance, is_stochastic
from brdftab.models.protocols import HasAlbedo
from brdftab.models.resolve import Setup, resolve
from brdftab.quadrature import gauss
from brdftab.system import machine
from brdftab.tables.content import SeveralArrays, listed, same_fields, told
from brdftab.timing import Clock
from brdftab.typing import Array

FORMAT = "brdftab-albedo"
COSINES = 32
# angles a row at which the quadrature is checked against a finer one, a looser one against a fourth of its tolerance
CHECKS, FINER, FINER_LOOSE = 3, 0.1, 0.25
MEANINGS = {
    "light": "share of the light from one direction theta_i that leaves the surface: int f |cos(theta_o)| domega_o",
    "view": (
        "radiance towards one view theta_o of a surface lit by 1 from all sides: int f |cos(theta_i)| domega_i; layers "
        "below: of a view below"
    ),
}
# nodes of the average over the light's angles, fewer of which leave at most 1e-5
AVERAGE_NODES, FEW_NODES, LOOSE = 20, 8, 3e-4


@dataclass(frozen=True, repr=False, eq=False)
class AlbedoTable(SeveralArrays):
    """Albedo of a model over roughness and cosine.

    Equal (``==``) where all but the provenance is, as a `Table`; without a hash.

    Attributes
    ----------
    cosines : ndarray (M,)
        Cosine of theta_i at the cells' centres, (j + 1/2)/M.
    roughness : ndarray (A,)
        Values of the model's roughness parameter.
    channels : tuple of str
        Names of the channels.
    directional : dict of str to ndarray (A, M, C)
        ``reflected``; surfaces that transmit also ``transmitted``, and ``reflected_below``, ``transmitted_below`` for
        light from below.
    average : dict of str to ndarray (A, C)
        2 int E(mu) mu dmu under the same names, by its own quadrature, not from the cells.
    provenance : dict
        Model, parameters, error, run time.
    fixed : {"light", "view"}
        Which direction theta_i is of; the other is integrated over. See `brdftab.albedo`.
    """

    cosines: Array
    roughness: Array
    channels: tuple[str, ...]
    directional: dict[str, Array]
    average: dict[str, Array]
    provenance: dict[str, Any]
    fixed: str = "light"

    _arrays = "directional['reflected'], average['reflected'] and so on"

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other, ("cosines", "roughness", "channels", "directional", "average", "fixed"))

    __hash__ = None  # type: ignore[assignment]  # its arrays can change

    def __repr__(self) -> str:
        made = self.provenance
        return told(
            self,
            str(made.get("model", "")),
            f"{made.get('roughness_parameter', 'roughness')} {self.roughness.size} x cosine of the {self.fixed} "
            f"{self.cosines.size}",
            f"layers {listed(self.directional)}",
            f"channels {listed(self.channels)}",
        )

    def metadata(self) -> dict[str, Any]:
        """Return everything but the arrays of albedos as a JSON-able dict."""
        return {
            "format": FORMAT,
            "format_version": 1,
            "version": __version__,
            "cosines": self.cosines.tolist(),
            "roughness": self.roughness.tolist(),
            "channels": list(self.channels),
            "layers": list(self.directional),
            "fixed": self.fixed,
            "meaning": (
                f"{MEANINGS[self.fixed]}; rows are roughness, columns its cosine at (j + 1/2)/M; average = 2 int E(mu) "
                "mu dmu"
            ),
            "provenance": self.provenance,
        }


def _names(setup: Setup) -> tuple[str, ...]:
    """Return the layers of a setup."""
    return ("reflected", "transmitted", "reflected_below", "transmitted_below") if setup.transmits else ("reflected",)


def albedos(setup: Setup, angles: Array, tolerance: float, engine: Engine | None = None, fixed: str = "light") -> Array:
    """Return the albedos (L, N, C) of all layers at polar angles (N,) above the surface, radians.

    An engine of the same setup and tolerance is taken where directions are evaluated.
    """
    if setup.transmits:
        both = [split(setup, t, 0.0, tolerance, fixed) for t in (angles, math.pi - angles)]
        return np.array([part for pair in both for part in pair])
    module = models.kernel(setup.model.name)
    if isinstance(module, HasAlbedo) and (fixed == "light" or setup.model.reciprocal):
        own = module.albedo(setup, angles, 0.0, tolerance)
        if own is not None:
            return np.asarray(own)[None]
    return many(engine or Engine(setup, tolerance), angles, nodes_for(tolerance), fixed)[None]


@dataclass(frozen=True)
class Row:
    """Albedos of one setup: `cells` (L, M, C) by cosine, `mean` (L, C), and the estimated error of both."""

    setup: Setup
    cells: Array
    mean: Array
    error: float


def row(
    setup: Setup,
    cosines: Array,
    tolerance: float,
    cells: Array | None = None,
    engine: Engine | None = None,
    fixed: str = "light",
) -> Row:
    """Integrate the albedos of one isotropic setup; `cells` are those at the cosines, `engine` its own, if known."""
    angles = np.arccos(cosines)
    x, w = gauss(FEW_NODES if tolerance >= LOOSE else AVERAGE_NODES)
    # squared nodes gather at grazing, where albedos turn
    mu, weight = (0.5 * (1.0 + x)) ** 2, 0.5 * w * (1.0 + x)
    if cells is None:
        found = albedos(setup, np.concatenate([angles, np.arccos(mu)]), tolerance, engine, fixed)
        cells, rest = found[:, : angles.size], found[:, angles.size :]
    else:
        rest = albedos(setup, np.arccos(mu), tolerance, engine, fixed)
    picked = np.unique(np.linspace(0, angles.size - 1, CHECKS).round().astype(int))
    share = FINER_LOOSE if tolerance >= LOOSE else FINER
    finer = albedos(setup, angles[picked], max(finer_tolerance(tolerance, share), 1e-10), None, fixed)
    few = cells[:, picked]
    error = float(np.abs(finer - few).max())
    # below the least tolerance rules have the same nodes
    same = (finer == few).all(axis=-1).T
    least = least_errors(
        few.transpose(1, 0, 2),
        tolerance,
        lambda at, wanted: albedos(setup, angles[picked[at]], wanted, None, fixed).transpose(1, 0, 2),
        doubted=same,
        scale=1.0,
    )
    error = max(error, float(least.max()))
    return Row(setup, cells, 2.0 * np.einsum("n,lnc->lc", weight * mu, rest), error)


def tabulate_albedo(
    model: str,
    *,
    cosines: int = COSINES,
    roughness: Sequence[float] | None = None,
    tolerance: float = 1e-4,
    fixed: str = "light",
    progress: Progress | None = None,
    **parameters: Any,
) -> AlbedoTable:
    """Tabulate directional and average albedo.

    Parameters
    ----------
    model : str
        Registry name.
    cosines : int, optional
        Cells in the cosine of the fixed direction, at least 2.
    roughness : sequence of float, optional
        Values of the model's roughness parameter (alpha or sigma), a row each; by default the one in `parameters`.
    tolerance : float, optional
        Absolute error asked, in [1e-14, 0.5].
    fixed : {"light", "view"}, optional
        Whether the cosine is the light's and views are integrated over, or the view's and lights are: renderers
        compensate for the energy of a fixed view. Both are the same for reciprocal models that do not transmit; see
        `brdftab.albedo`.
    progress : callable, optional
        Called with the finished share of the work.
    **parameters
        Parameters of the model by name; isotropic surfaces only.

    Returns
    -------
    AlbedoTable

    Raises
    ------
    ParameterError
        If a parameter is malformed, the surface is anisotropic, or the model's values carry noise.
    """
    clock = Clock()
    asked, end = check_tolerance(tolerance), check_fixed(fixed)
    if not (isinstance(cosines, int) and 2 <= cosines <= 4096):
        raise ParameterError.out_of_range("cosines", cosines, "[2, 4096]", "cells between grazing and normal light")
    first = resolve(model, **parameters)
    name = first.model.roughness
    if roughness is not None and not first.model.has(name):
        raise ParameterError(f"roughness needs a model with {name}, which {model} has not; leave it out")
    if roughness is not None and len(roughness) == 0:
        raise ParameterError(f"roughness is empty; give values of {name}, as 0.05:1:20 or 0.1,0.5")
    rows = [first] if roughness is None else [resolve(model, **{**parameters, name: float(r)}) for r in roughness]
    for setup in rows:
        if not setup.isotropic:
            raise ParameterError(f"{name}_x and {name}_y differ; albedo tables are of isotropic surfaces, give {name}")
        if is_stochastic(setup):
            raise ParameterError(
                f"model = {model} with these options is an estimate with noise; take smith-multi with its solver"
            )
    mu = (np.arange(cosines) + 0.5) / cosines
    made = []
    for number, setup in enumerate(rows):
        made.append(row(setup, mu, asked, fixed=end))
        if progress is not None:
            progress((number + 1.0) / len(rows))
    table = assembled(mu, made, asked, clock.seconds, end)
    if roughness is not None:
        del table.provenance["parameters"][name]
    return table


def assembled(
    cosines: Array, rows: Sequence[Row], tolerance: float, seconds: float, fixed: str = "light"
) -> AlbedoTable:
    """Return the table of rows of one model that differ in roughness."""
    first = rows[0].setup
    error = max(row.error for row in rows)
    provenance = {
        "model": first.model.name,
        "parameters": dict(first.parameters),
        "roughness_parameter": first.model.roughness,
        "error": {"tolerance": tolerance, "estimate": error, "met": error <= tolerance, "cells": CHECKS * len(rows)},
        "run_time_s": seconds,
        "machine": machine(),
        "citation": first.model.citation,
        "doi": first.model.doi,
    }
    cells, means = np.array([row.cells for row in rows]), np.array([row.mean for row in rows])
    names = _names(first)
    return AlbedoTable(
        cosines,
        np.array([row.setup.alpha_x for row in rows]),
        first.channels,
        {n: cells[:, k] for k, n in enumerate(names)},
        {n: means[:, k] for k, n in enumerate(names)},
        provenance,
        fixed,
    )


def write_albedo(table: AlbedoTable, path: str | Path, *, overwrite: bool = False) -> None:
    """Write an albedo table as .npz (float64) or .exr (float32: part albedo, and part average of one column).

    Raises
    ------
    OutputExistsError, BrdftabError
        As `brdftab.write`.
    """
    from brdftab.io import check_output
    from brdftab.io.atomic import atomic

    check_output(path, overwrite=overwrite)
    text = json.dumps(table.metadata(), allow_nan=False)
    with atomic(path, overwrite=overwrite) as temporary:
        if Path(path).suffix.lower() == ".npz":
            arrays: dict[str, Any] = {
                "cosines": table.cosines,
                "roughness": table.roughness,
                "metadata": np.array(text),
            }
            arrays |= table.directional | {f"average_{n}": a for n, a in table.average.items()}
            with open(temporary, "wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
        else:
            _write_exr(table, text, temporary)


def _write_exr(table: AlbedoTable, text: str, path: Path) -> None:
    """Write the two parts of an EXR; the first layer is the one that viewers show."""
    import OpenEXR

    from brdftab.io.names import utf8

    rows, columns = len(table.roughness), len(table.cosines)
    parts = []
    for part, layers in (("albedo", table.directional), ("average", {n: a[:, None] for n, a in table.average.items()})):
        channels = {}
        for number, (layer, values) in enumerate(layers.items()):
            for c, channel in enumerate(table.channels):
                name = channel if number == 0 else f"{layer}.{channel}"
                channels[name] = OpenEXR.Channel(name, np.ascontiguousarray(values[..., c], dtype=np.float32))
        header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "brdftab": text}
        header["displayWindow"] = (np.array([0, 0], np.int32), np.array([columns - 1, rows - 1], np.int32))
        parts.append(OpenEXR.Part(header, channels, part))
    OpenEXR.File(parts).write(utf8(path))


def read_albedo(path: str | Path) -> AlbedoTable:
    """Read what `write_albedo` wrote as .npz; .exr files are for renderers.

    Raises
    ------
    FileFormatError
        If the file is not such a table.
    BrdftabError
        If it cannot be opened.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            head = json.loads(str(file["metadata"]))
            if head.get("format") != FORMAT:
                raise FileFormatError(f"{path}: is a file of another kind; brdftab albedo writes these")
            directional_albedo = {n: file[n] for n in head["layers"]}
            average = {n: file[f"average_{n}"] for n in head["layers"]}
            return AlbedoTable(
                file["cosines"],
                file["roughness"],
                tuple(head["channels"]),
                directional_albedo,
                average,
                head["provenance"],
                # files of before hold albedos of lights
                head.get("fixed", "light"),
            )
    except OSError as error:
        raise BrdftabError(f"{path}: cannot be opened ({error.strerror or error}); check the path") from error
    except (KeyError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise FileFormatError(f"{path}: is not an albedo table of brdftab, or damaged; write it again") from error
