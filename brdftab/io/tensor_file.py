r"""The container of RGL files: named arrays, read without trusting what their header says.

Layout: ``tensor_file\0``, version (two bytes, 1 and 0), number of fields (u32); for each field its name (u16 length,
text), number of dimensions (u16), type (u8), offset (u64) and shape (u64 each). Numbers are little-endian.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import FileFormatError

MAGIC = b"tensor_file\0"
_TYPES = {
    1: "<u1", 2: "<i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f2", 10: "<f4", 11: "<f8",
}  # fmt: skip
_MAX_FIELDS, _MAX_NAME, _MAX_DIMENSIONS = 1000, 255, 16


@dataclass(frozen=True)
class Field:
    """Where an array lies in the file; its bytes are known to be there."""

    dtype: str
    offset: int
    shape: tuple[int, ...]


def read_fields(path: Path) -> dict[str, Field]:
    """Read the directory of a tensor file and hold it against the file's size.

    Parameters
    ----------
    path : Path
        A file that starts with `MAGIC`.

    Returns
    -------
    dict of str to Field

    Raises
    ------
    FileFormatError
        Where the directory is truncated or damaged, or declares more than the file holds.
    """
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        file.seek(len(MAGIC))
        major, minor, count = struct.unpack("<BBI", _take(file, 6))
        if (major, minor) != (1, 0):
            raise FileFormatError(f"the RGL file has the version {major}.{minor}; version 1.0 is read")
        if not 0 < count <= _MAX_FIELDS:
            raise FileFormatError(f"the RGL file is damaged: it declares {count:,} fields")
        fields: dict[str, Field] = {}
        for _ in range(count):
            name, field = _field(file, size)
            if name in fields:
                raise FileFormatError(f"the RGL file is damaged: it has the field {name} twice")
            fields[name] = field
    return fields


def read_array(path: Path, field: Field) -> NDArray[Any]:
    """Read one array that `read_fields` has checked.

    Raises
    ------
    FileFormatError
        Where the file has become shorter meanwhile.
    """
    with open(path, "rb") as file:
        file.seek(field.offset)
        array: NDArray[Any] = np.fromfile(file, dtype=field.dtype, count=math.prod(field.shape))
    if array.size != math.prod(field.shape):
        raise FileFormatError("the RGL file is truncated")
    return array.reshape(field.shape)


def _field(file: BinaryIO, size: int) -> tuple[str, Field]:
    """Read and check one entry of the directory."""
    (length,) = struct.unpack("<H", _take(file, 2))
    if not 0 < length <= _MAX_NAME:
        raise FileFormatError(f"the RGL file is damaged: the name of a field has {length} bytes")
    raw = _take(file, length)
    name = raw.decode("ascii", errors="replace")
    if not name.isprintable() or not raw.isascii():
        raise FileFormatError("the RGL file is damaged: the name of a field is not plain text")
    dimensions, code, offset = struct.unpack("<HBQ", _take(file, 11))
    if dimensions > _MAX_DIMENSIONS or code not in _TYPES:
        raise FileFormatError(f"the RGL file is damaged: the field {name} has an unknown type or too many dimensions")
    shape = struct.unpack(f"<{dimensions}Q", _take(file, 8 * dimensions))
    dtype = _TYPES[code]
    if offset + math.prod(shape) * np.dtype(dtype).itemsize > size:
        raise FileFormatError(f"the RGL file is truncated or damaged: the field {name} reaches beyond its end")
    return name, Field(dtype, offset, shape)


def _take(file: BinaryIO, count: int) -> bytes:
    """Read exactly `count` bytes."""
    data = file.read(count)
    if len(data) != count:
        raise FileFormatError("the RGL file is truncated")
    return data
