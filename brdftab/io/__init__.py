"""Reading tables and measurements, writing tables: content decides on reading, the ending on writing."""

from __future__ import annotations

import os
import stat
import struct
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from brdftab.errors import BrdftabError, FileFormatError, ParameterError
from brdftab.io.atomic import atomic, check_target, show
from brdftab.io.own import own_kind

if TYPE_CHECKING:
    from brdftab.tables.measurement import Measurement
    from brdftab.tables.table import Table

ENDINGS = (".exr", ".npz")

_EXR, _ZIP, _RGL = b"\x76\x2f\x31\x01", b"PK\x03\x04", b"tensor_file\0"
# sizes at the start of a MERL file; its length is checked on reading
_MERL = (struct.pack("<3i", 90, 90, 180), struct.pack("<3i", 90, 90, 360))
# what people hand over by mistake, so that the message can say what it is
_FOREIGN = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"\x93NUMPY": "a single numpy array (.npy)",
    b"\x89HDF": "an HDF5 file",
    b"#?RADIANCE": "a Radiance HDR image",
    b"PK\x05\x06": "an empty zip archive",
    b"\x1f\x8b": "a gzip file",
}
_REMEDY = "give a file that brdftab tabulate wrote, or write it again"
_REMEDY_MEASURED = "fetch or copy the measured file again"

__all__ = ["ENDINGS", "check_output", "read", "write"]


def read(path: str | os.PathLike[str]) -> Table | Measurement:
    """Read a table from an EXR or NPZ file that brdftab wrote, or a measurement from a MERL or RGL file.

    Parameters
    ----------
    path : str or path-like
        The file; its content decides on the format, not its ending.

    Returns
    -------
    Table or Measurement
        A table bit for bit as it was written; a measurement with what was not measured masked out.

    Raises
    ------
    FileFormatError
        Where the file is truncated, foreign, or its content contradicts itself. Declared sizes are held against the
        file's size before any memory is taken for them.
    BrdftabError
        Where the file cannot be opened.
    """
    path = Path(path)
    reader, remedy = _reader(path)
    try:
        return reader(path)
    except FileFormatError as error:
        raise FileFormatError(f"{show(path)}: {_own(path) or f'{error}; {remedy}'}") from error
    except MemoryError as error:
        raise BrdftabError(f"{show(path)}: the file does not fit into memory; use a machine with more") from error
    except OSError as error:
        raise BrdftabError(f"{show(path)}: cannot be read ({error.strerror or error}); check the file") from error


def write(table: Table, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a table as EXR or NPZ; the file appears whole or not at all.

    Parameters
    ----------
    table : Table
    path : str or path-like
        Ends in ``.exr`` or ``.npz``.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OutputExistsError
        Where the file exists and `overwrite` is False.
    BrdftabError
        For an unknown ending, a missing folder, or one that cannot be written to.
    ParameterError
        Where it is no table, such as a measurement.
    """
    from brdftab.tables.table import Table

    if not isinstance(table, Table):
        raise ParameterError(f"a {type(table).__name__} cannot be written as a table; give a Table")
    path = Path(path)
    check_output(path, overwrite=overwrite)
    with atomic(path, overwrite=overwrite) as temporary:
        if path.suffix.lower() == ".exr":
            from brdftab.io import exr

            exr.write(table, temporary)
        else:
            from brdftab.io import npz

            npz.write(table, temporary)


def check_output(path: str | os.PathLike[str], *, overwrite: bool = False, name: str = "out") -> None:
    """Refuse early, before any work, what `write` would refuse at the end; `name` is what the user calls the path.

    Raises
    ------
    OutputExistsError, BrdftabError
        As `write`.
    """
    path = Path(path)
    if path.suffix.lower() not in ENDINGS:
        raise BrdftabError(f"{name} = {show(path)} has no known ending; end it in .exr or .npz")
    check_target(path, overwrite=overwrite)


def _reader(path: Path) -> tuple[Callable[[Path], Table | Measurement], str]:
    """Pick the reader, and the remedy for what it refuses, by the file's first bytes."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise BrdftabError(f"{show(path)}: is not a regular file; {_REMEDY}")
        with open(path, "rb") as file:
            magic = file.read(16)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise BrdftabError(f"{show(path)}: cannot be opened ({reason}); check the path") from error
    if not magic:
        raise FileFormatError(f"{show(path)}: the file is empty; {_REMEDY}")
    if magic.startswith(_EXR):
        from brdftab.io import exr

        return exr.read, _REMEDY
    if magic.startswith(_ZIP):
        from brdftab.io import npz

        return npz.read, _REMEDY
    if magic.startswith(_RGL):
        from brdftab.io import rgl

        return rgl.read, _REMEDY_MEASURED
    if magic.startswith(_MERL):
        from brdftab.io import merl

        return merl.read, _REMEDY_MEASURED
    unknown = "neither EXR nor NPZ, and no MERL or RGL measurement"
    known = next((name for start, name in _FOREIGN.items() if magic.startswith(start)), unknown)
    said = _own(path) or f"not a brdftab table, it is {known}; {_REMEDY}"
    raise FileFormatError(f"{show(path)}: {said}")


def _own(path: Path) -> str:
    """Say what another file of this tool holds, or nothing."""
    held = own_kind(path)
    return f"holds no table of values but {held}" if held else ""
