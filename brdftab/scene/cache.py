"""Tables kept by content: an identical material of two scenes is tabulated once, also by two processes at a time."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from brdftab._version import __version__
from brdftab.errors import BrdftabError, ParameterError
from brdftab.io import read, write
from brdftab.scene.scene import Material
from brdftab.system import source_hash, user_cache
from brdftab.tables.table import Table
from brdftab.tabulation.albedo_table import AlbedoTable, read_albedo, write_albedo
from brdftab.tabulation.tabulate import default_grid

FOLDER, SIZE = "BRDFTAB_CACHE_DIR", "BRDFTAB_CACHE_SIZE"
DEFAULT_SIZE = 2 * 2**30
_ENTRY = re.compile(r"[0-9a-f]{32}\.npz")
# an unfinished file that no one touched for so long was left by a process that died
ABANDONED_S = 3600.0


@dataclass(frozen=True)
class Entry:
    """One table of the cache.

    Attributes
    ----------
    path : Path
    size : int
        Bytes.
    used : float
        When it was last asked for, seconds since the epoch.
    """

    path: Path
    size: int
    used: float


def folder() -> Path:
    """Return the cache's folder: BRDFTAB_CACHE_DIR, or below the user's cache."""
    given = os.environ.get(FOLDER)
    if given:
        return Path(given)
    return user_cache() / "tables"


def limit() -> int:
    """Return the bytes that the cache may hold: BRDFTAB_CACHE_SIZE, or 2 GiB.

    Raises
    ------
    ParameterError
        If the variable is no whole number of bytes.
    """
    text = os.environ.get(SIZE, str(DEFAULT_SIZE))
    if not text.isdigit():
        raise ParameterError(f"{SIZE} = {text!r} is outside the whole numbers >= 0; give bytes, as 2000000000")
    return int(text)


def key(material: Material) -> str:
    """Return the name of a material's content: what the scene sees of it, by which version of the code.

    Its own name does not enter, nor how its parameters are written.
    """
    content = asdict(material) | {"parameters": material.setup().parameters, "name": ""}
    content["grid"] = material.grid or default_grid(material.setup())
    text = json.dumps([content, __version__, source_hash()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def entries() -> list[Entry]:
    """Return what the cache holds, the longest unused first."""
    found = []
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        for item in os.scandir(folder()):
            if _ENTRY.fullmatch(item.name):
                # another process may have taken it away
                with contextlib.suppress(FileNotFoundError):
                    stat = item.stat()
                    found.append(Entry(Path(item.path), stat.st_size, stat.st_mtime))
    return sorted(found, key=lambda entry: entry.used)


def get(material: Material) -> Table | AlbedoTable | None:
    """Return the planned table of a material if the cache holds it; a damaged one is thrown away."""
    path = folder() / f"{key(material)}.npz"
    if not path.is_file():
        return None
    for reader in (read_albedo, read) if material.quantity == "albedo" else (read,):
        with contextlib.suppress(BrdftabError, OSError):
            found = reader(path)
            os.utime(path)
            if isinstance(found, Table | AlbedoTable):
                return found
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def put(material: Material, table: Table | AlbedoTable) -> None:
    """Keep the planned table of a material; the longest unused ones make room.

    A folder that cannot be written to is no error: the table is merely not kept.
    """
    home, most = folder(), limit()
    with contextlib.suppress(OSError, BrdftabError):
        home.mkdir(parents=True, exist_ok=True)
        with _unfinished(home) as temporary:
            if isinstance(table, AlbedoTable):
                write_albedo(table, temporary, overwrite=True)
            else:
                write(table, temporary, overwrite=True)
            if temporary.stat().st_size <= most:
                os.replace(temporary, home / f"{key(material)}.npz")
        shrink(most)


@contextlib.contextmanager
def _unfinished(home: Path) -> Iterator[Path]:
    """Give a file of this process alone in the cache's folder, gone at the end."""
    handle, name = tempfile.mkstemp(prefix="unfinished-", suffix=".npz", dir=home)
    os.close(handle)
    try:
        yield Path(name)
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(name)


def shrink(most: int) -> tuple[int, int]:
    """Throw the longest unused tables away until at most so many bytes are left.

    Returns
    -------
    tuple of int
        Tables and bytes thrown away.
    """
    found = entries()
    total, gone, freed = sum(entry.size for entry in found), 0, 0
    for entry in found:
        if total <= most:
            break
        with contextlib.suppress(FileNotFoundError):
            entry.path.unlink()
            gone, freed = gone + 1, freed + entry.size
        total -= entry.size
    with contextlib.suppress(FileNotFoundError):
        for item in os.scandir(folder()):
            if item.name.startswith("unfinished-"):
                with contextlib.suppress(FileNotFoundError):
                    if most == 0 or time.time() - item.stat().st_mtime > ABANDONED_S:
                        os.unlink(item.path)
    return gone, freed
