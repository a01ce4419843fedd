"""Tables as NPZ: plain numpy arrays plus the same JSON, readable with ``allow_pickle=False``.

Stored, not compressed: on 90x90x180 RGB tables deflate saves 5 to 20 % of the space and takes at least twenty times as
long to write and six times as long to read. Reading holds the zip directory and every array's header against the
metadata before memory is taken, which ``numpy.load`` does not.
"""

from __future__ import annotations

import math
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from brdftab.errors import FileFormatError
from brdftab.io import text
from brdftab.io.planned import layout_of
from brdftab.tables.table import Table

_METADATA = "metadata"
_COMPONENT = "component_"
_MAX_MEMBERS = 10000
_CHUNK = 2**24


def write(table: Table, path: Path) -> None:
    """Write a table to a path that may be overwritten.

    Parameters
    ----------
    table : Table
    path : Path
        A temporary file; `brdftab.io.write` moves it into place.
    """
    layout, names = layout_of(table), table.channels
    arrays: dict[str, NDArray[Any]] = {"values": layout.packed(table.values, names)}
    arrays |= table.grid.axes
    arrays |= {f"{name}_edges": edges for name, edges in table.grid.edges.items()}
    arrays |= {_COMPONENT + name: layout.packed(array, names) for name, array in table.components.items()}
    if table.mask is not None:
        arrays["mask"] = layout.packed(table.mask, names)
    arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    arrays[_METADATA] = np.array(text.dump(table.metadata() | layout.to_json()))
    with open(path, "wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def read(path: Path) -> Table:
    """Read a table.

    Parameters
    ----------
    path : Path
        A file that starts as a zip archive.

    Returns
    -------
    Table

    Raises
    ------
    FileFormatError
        Where the file is damaged or is not a brdftab table.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            return _read(archive)
    except FileFormatError:
        raise
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise FileFormatError("the NPZ is damaged or truncated") from error
    except (ValueError, RuntimeError, NotImplementedError, KeyError) as error:
        # zipfile raises these for encrypted members, unknown methods and impossible offsets
        raise FileFormatError("the NPZ has a member that cannot be read") from error


def _read(archive: zipfile.ZipFile) -> Table:
    """Check the directory, then the metadata, then read the arrays that it calls for."""
    members: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist()[:_MAX_MEMBERS]:
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or info.filename in members:
            raise FileFormatError("the NPZ has a member twice or in a compression that numpy does not write")
        members[info.filename] = info
    if f"{_METADATA}.npy" not in members:
        raise FileFormatError("the zip archive holds no metadata array, so it is not a brdftab table")
    head, metadata = text.load(_text(archive, members[f"{_METADATA}.npy"]))
    names = ["values", *(_COMPONENT + name for name in head.components)]
    wanted = {name: (head.dtype, head.stored_shape) for name in names}
    if head.mask:
        wanted["mask"] = ("bool", head.stored_shape)
    for name, axis in head.grid.axes.items():
        wanted |= {name: ("float64", axis.shape), f"{name}_edges": ("float64", (axis.size + 1,))}
    for name, (dtype, shape) in wanted.items():
        if f"{name}.npy" not in members:
            raise FileFormatError(f"the NPZ lacks the array {name}")
        _check(archive, members[f"{name}.npy"], name, np.dtype(dtype), shape)
    arrays = {name: _array(archive, members[f"{name}.npy"], shape) for name, (_, shape) in wanted.items()}
    for name, axis in (*head.grid.axes.items(), *((f"{n}_edges", e) for n, e in head.grid.edges.items())):
        if arrays[name].tobytes() != axis.tobytes():
            raise FileFormatError(f"the NPZ's array {name} disagrees with its metadata")
    held = (*names, *(["mask"] if head.mask else []))
    whole = {name: head.layout.unpacked(arrays[name], head.shape, head.channels) for name in held}
    components = {name: whole[_COMPONENT + name] for name in head.components}
    return Table.from_parts(whole["values"], components, whole.get("mask"), metadata)


def _head(stream: IO[bytes], name: str) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Read the header of an array: shape, Fortran order, dtype, bytes read."""
    try:
        version = npy.read_magic(stream)
        if version == (1, 0):
            shape, fortran, dtype = npy.read_array_header_1_0(stream)
        elif version == (2, 0):
            shape, fortran, dtype = npy.read_array_header_2_0(stream)
        else:
            raise ValueError(version)
    except Exception as error:
        # numpy lets through whatever Python's tokenizer and parser raise on a crafted header
        raise FileFormatError(f"the NPZ's array {name} has a damaged header") from error
    return shape, fortran, dtype, stream.tell()


def _check(
    archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str, dtype: np.dtype[Any], shape: tuple[int, ...]
) -> None:
    """Check an array's declared type, shape and size in the directory, reading only its header."""
    with archive.open(info) as stream:
        found, fortran, kind, start = _head(stream, name)
    if kind != dtype:
        raise FileFormatError(f"the NPZ's array {name} has the type {kind}, its metadata says {dtype}")
    if found != shape or (fortran and len(shape) > 1):
        raise FileFormatError(f"the NPZ's array {name} has the shape {found}, its metadata says {shape}")
    if info.file_size != start + math.prod(shape) * dtype.itemsize:
        raise FileFormatError(f"the NPZ's array {name} has {info.file_size} bytes, its shape needs another number")


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, shape: tuple[int, ...]) -> NDArray[Any]:
    """Read an array that `_check` has passed; the archive's checksum is verified at its end."""
    with archive.open(info) as stream:
        _, _, dtype, _ = _head(stream, info.filename)
        array = np.empty(shape, dtype)
        _fill(stream, array)
    if dtype.kind == "b" and (array.view(np.uint8) > 1).any():
        raise FileFormatError("the NPZ's mask holds bytes other than 0 and 1")
    return array


def _fill(stream: IO[bytes], array: NDArray[Any]) -> None:
    """Read bytes into an array, piece by piece, so that no second copy of it is held."""
    view = array.reshape(-1).view(np.uint8).data
    position = 0
    while position < len(view):
        piece = stream.read(min(_CHUNK, len(view) - position))
        if not piece:
            raise FileFormatError("the NPZ is truncated")
        view[position : position + len(piece)] = piece
        position += len(piece)
    # the checksum is compared when the end is reached
    stream.read(1)


def _text(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> str:
    """Read the metadata: a 0-d array of unicode."""
    with archive.open(info) as stream:
        shape, _, dtype, start = _head(stream, _METADATA)
        if shape != () or dtype.kind != "U" or not dtype.isnative:
            raise FileFormatError(f"the NPZ's metadata has the type {dtype} and shape {shape}, not one unicode text")
        if info.file_size != start + dtype.itemsize or dtype.itemsize > 4 * text.MAX_TEXT:
            raise FileFormatError("the NPZ's metadata has another size than it declares")
        buffer = np.zeros(dtype.itemsize, np.uint8)
        _fill(stream, buffer)
    try:
        return str(buffer.view(dtype)[0])
    except (ValueError, IndexError) as error:
        raise FileFormatError("the NPZ's metadata is not text") from error
