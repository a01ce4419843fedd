"""Files of benchmarks: what to measure (TOML), and what was measured (JSON)."""

from __future__ import annotations

import json
import math
import os
import tomllib
from pathlib import Path
from typing import Any

from brdftab import models
from brdftab.bench.run import FORMAT, recorded
from brdftab.errors import FileFormatError
from brdftab.io.atomic import atomic, show

VERSION = 1


def read_list(path: str | os.PathLike[str]) -> list[tuple[str, dict[str, Any]]]:
    """Read a TOML list of models: tables ``[[bench]]`` with ``model`` and its parameters, angles in degrees.

    Parameters
    ----------
    path : str or path-like
        The file.

    Returns
    -------
    list of (str, dict)
        Model and parameters as the API takes them, angles in radians.

    Raises
    ------
    FileFormatError
        If the file is missing, no TOML, or holds anything else.
    ParameterError
        If a model or a parameter is unknown.
    """
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise FileFormatError(f"list = {show(path)} cannot be read ({reason}); give a TOML file") from None
    entries = data.get("bench")
    tables = isinstance(entries, list) and all(isinstance(e, dict) for e in entries)
    if not entries or not tables or len(data) != 1:
        raise FileFormatError(f"list = {show(path)} must hold tables [[bench]] and nothing else; see the docs of bench")
    found = []
    for number, entry in enumerate(entries, 1):
        name = entry.get("model")
        if not isinstance(name, str):
            raise FileFormatError(f'list = {show(path)}: [[bench]] number {number} has no model; write model = "smith"')
        declared = models.spec(name)
        given = {}
        for key, value in entry.items():
            if key == "model":
                continue
            if declared.param(key).unit == "rad" and isinstance(value, int | float):
                value = math.radians(value)
            given[key] = value
        found.append((name, given))
    return found


def document(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Return results with machine and versions, as the JSON file holds them."""
    return {"format": FORMAT, "format_version": VERSION, "machine": recorded(), "results": results}


def write_results(data: dict[str, Any], path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a document of results as JSON, whole or not at all.

    Raises
    ------
    BrdftabError
        If the file exists and may not be replaced, or cannot be written.
    """
    with atomic(path, overwrite=overwrite) as temporary:
        temporary.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_results(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read what `write_results` wrote.

    Raises
    ------
    FileFormatError
        If the file is missing, no JSON, or not of this format.
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise FileFormatError(f"{show(path)} cannot be read ({reason}); give a JSON file of brdftab bench") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("format_version") != VERSION:
        raise FileFormatError(f"{show(path)} is not a JSON file of brdftab bench (format {FORMAT}, version {VERSION})")
    try:
        for result in data["results"]:
            _checked(result)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise FileFormatError(f"{show(path)} lacks what a result must have; write it anew with brdftab bench") from None
    return data


def _checked(result: dict[str, Any]) -> None:
    """Touch everything that a comparison needs; raises what Python raises where it is missing."""
    str(result["model"]), dict(result["parameters"]), str(result["grid"])
    float(result["reference"]["uncertainty"]["l1"])
    for row in result["methods"]:
        str(row["name"]), float(row["kernel_s"]["min"]), float(row["total_s"]["min"])
        for name in ("l1", "l2", "max", "albedo"):
            float(row["error"][name]), float(result["reference"]["uncertainty"][name])
