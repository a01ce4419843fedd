"""Writing golden tables, and where each is from."""

from __future__ import annotations

import datetime
import fnmatch
import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numba
import numpy as np

from brdftab import models
from brdftab._version import __version__
from brdftab.errors import BrdftabError, ParameterError
from brdftab.evaluation.engine import Progress
from brdftab.golden import points
from brdftab.golden.tables import special_tables, write_special
from brdftab.io.atomic import show, write_text
from brdftab.tables.comparison import RTOL as TABLE_RTOL

SOURCES = "SOURCES.json"
GENERATOR = "brdftab golden record"


def files_of(folder: Path, only: Sequence[str] = ()) -> dict[str, Any]:
    """Return what a folder of golden tables must hold: file name -> model name, or the entry of tables.toml.

    Raises
    ------
    ParameterError
        If a pattern of `only` fits no file.
    """
    found: dict[str, Any] = {f"{name}{points.SUFFIX}": name for name in models.names()}
    found |= {entry.file: entry for entry in special_tables(folder)}
    for pattern in only:
        if not fnmatch.filter(found, pattern):
            raise ParameterError(
                f"only = {pattern} fits none of the golden files; give a name or a pattern, as smith{points.SUFFIX} or "
                "'smith*'"
            )
    return {name: what for name, what in found.items() if not only or any(fnmatch.fnmatch(name, p) for p in only)}


def existing_folder(folder: str | os.PathLike[str]) -> Path:
    """Return the folder's path, or raise `BrdftabError`."""
    path = Path(folder)
    if not path.is_dir():
        raise BrdftabError(f"{show(path)} is no folder; create it first")
    return path


def record_golden(
    folder: str | os.PathLike[str],
    *,
    only: Sequence[str] = (),
    overwrite: bool = False,
    progress: Progress | None = None,
) -> list[str]:
    """Write the golden tables that a folder lacks, and its SOURCES.json.

    A file of point values for every model of the registry, and the tables that the folder's tables.toml lists.

    Parameters
    ----------
    folder : str or path-like
        Made where its parent exists.
    only : sequence of str, optional
        File names or patterns to confine it to.
    overwrite : bool, optional
        Write also those that exist; else they are kept as they are.
    progress : callable, optional
        Called with the finished share of the work.

    Returns
    -------
    list of str
        Names of the written files.

    Raises
    ------
    BrdftabError
        If the folder cannot be made, or a file cannot be written.
    FileFormatError, ParameterError
        If tables.toml is malformed, or a pattern fits no file.
    """
    try:
        Path(folder).mkdir(exist_ok=True)
    except OSError as error:
        raise BrdftabError(
            f"cannot make the folder {show(folder)} ({error.strerror or error}); choose another path"
        ) from error
    home = existing_folder(folder)
    wanted = {name: what for name, what in files_of(home, only).items() if overwrite or not (home / name).exists()}
    for number, (name, what) in enumerate(wanted.items()):
        entry = {
            "command": f"brdftab golden record . --only {name} --overwrite",
            "generator": GENERATOR,
            "tool": f"brdftab {__version__}",
            "with": f"Python {platform.python_version()}, numba {numba.__version__}, numpy {np.__version__}, "
            f"{platform.machine()}",
            "date": datetime.date.today().isoformat(),
        }
        if isinstance(what, str):
            points.write_points(what, home / name, overwrite=overwrite)
            entry["tolerance"] = f"rtol {points.RTOL:g}, atol {points.ATOL_PART:g} of the largest value"
        else:
            write_special(what, home, overwrite=overwrite)
            entry["tolerance"] = f"rtol {TABLE_RTOL[what.dtype]:g}"
        _note(home, name, entry)
        if progress is not None:
            progress((number + 1.0) / len(wanted))
    return list(wanted)


def _note(home: Path, name: str, entry: dict[str, str]) -> None:
    """Write one file's entry into SOURCES.json, at once, so that an interrupted run leaves none behind."""
    path = home / SOURCES
    sources = read_sources(home)
    sources[name] = entry
    write_text(path, json.dumps(dict(sorted(sources.items())), indent=2) + "\n", overwrite=True)


def read_sources(home: Path) -> dict[str, Any]:
    """Return the entries of SOURCES.json, empty where there is none; raises `BrdftabError` where it is no JSON."""
    path = home / SOURCES
    if not path.exists():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise BrdftabError(f"{show(path)}: is no JSON ({error}); remove it and record again") from error
    if not isinstance(found, dict):
        raise BrdftabError(f"{show(path)}: holds no entries by file name; remove it and record again")
    return found
