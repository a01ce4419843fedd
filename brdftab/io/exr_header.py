"""The head of an EXR file, read without the library: nothing is allocated for sizes that a hostile file declares.

Layout after "OpenEXR File Layout" (Academy Software Foundation): magic, version with flags, then attributes
(name, type, size, value) up to an empty name.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from brdftab.errors import FileFormatError
from brdftab.io.text import MAX_TEXT

UINT, HALF, FLOAT = 0, 1, 2
_BYTES = {UINT: 4, HALF: 2, FLOAT: 4}
# lossless codes and their lines per chunk; the lossy ones (PXR24, B44, DWA) return other numbers than were written
_LINES = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32}
_LONG_NAMES = 0x400
_TRUNCATED = "the file is truncated"
# deflate expands at most 1032-fold; RLE and PIZ stay below on real tables
_MAX_RATIO = 1100
_MAX_ATTRIBUTES = 1000


@dataclass(frozen=True)
class ExrHeader:
    """What the head of a scan-line EXR declares."""

    width: int
    height: int
    types: dict[str, int]
    text: str


def read_header(path: Path, attribute: str) -> ExrHeader:
    """Read and check the head of an EXR file against the file's size.

    Parameters
    ----------
    path : Path
        The file, known to start with the EXR magic number.
    attribute : str
        Name of the string attribute to return as `text`.

    Returns
    -------
    ExrHeader

    Raises
    ------
    FileFormatError
        Where the head is damaged, is not of one scan-line part, lacks the attribute, or declares more pixels than the
        file can hold.
    """
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        file.seek(4)
        version = struct.unpack("<I", _take(file, 4))[0]
        if version & 0xFF != 2 or version & ~(0xFF | _LONG_NAMES):
            raise FileFormatError(
                "the EXR is tiled, deep, has several parts or an unknown version; one scan-line part is read"
            )
        found = _attributes(file, size)
        start = file.tell()
    missing = [name for name in ("channels", "compression", "dataWindow") if name not in found]
    if missing:
        raise FileFormatError(f"the EXR header lacks {missing[0]}")
    if attribute not in found or found[attribute][0] != "string":
        raise FileFormatError(f"the EXR has no string attribute {attribute!r}, so its axes and convention are unknown")
    try:
        text = found[attribute][1].decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"the EXR attribute {attribute!r} is not UTF-8 text") from error
    width, height = _window(*found["dataWindow"])
    types = _channels(*found["channels"])
    _check_size(size - start, width, height, types, found["compression"][1])
    return ExrHeader(width, height, types, text)


def _take(file: BinaryIO, count: int) -> bytes:
    """Read exactly `count` bytes."""
    data = file.read(count)
    if len(data) != count:
        raise FileFormatError(_TRUNCATED)
    return data


def _word(file: BinaryIO) -> str:
    """Read a zero-terminated name of at most 255 bytes."""
    raw = bytearray()
    while (byte := _take(file, 1)) != b"\0":
        raw += byte
        if len(raw) > 255:
            raise FileFormatError("the EXR header is damaged: a name is longer than 255 bytes")
    return raw.decode("latin-1")


def _attributes(file: BinaryIO, size: int) -> dict[str, tuple[str, bytes]]:
    """Read all attributes as name -> (type, bytes)."""
    found: dict[str, tuple[str, bytes]] = {}
    while name := _word(file):
        kind = _word(file)
        count = struct.unpack("<i", _take(file, 4))[0]
        if not 0 <= count <= min(size, MAX_TEXT) or len(found) >= _MAX_ATTRIBUTES:
            raise FileFormatError(f"the EXR header is damaged or truncated at attribute {name[:40]!r}")
        found[name] = (kind, _take(file, count))
    return found


def _window(kind: str, data: bytes) -> tuple[int, int]:
    """Return width and height of the data window."""
    if kind != "box2i" or len(data) != 16:
        raise FileFormatError("the EXR header is damaged: dataWindow is not a box2i")
    x0, y0, x1, y1 = struct.unpack("<4i", data)
    if x1 < x0 or y1 < y0:
        raise FileFormatError("the EXR declares an empty data window")
    return x1 - x0 + 1, y1 - y0 + 1


def _channels(kind: str, data: bytes) -> dict[str, int]:
    """Return name -> pixel type of the channel list."""
    types: dict[str, int] = {}
    position = 0
    while kind == "chlist" and (end := data.find(b"\0", position)) > position and end + 17 <= len(data):
        pixel, _, x_step, y_step = struct.unpack("<iIii", data[end + 1 : end + 17])
        if pixel not in _BYTES or (x_step, y_step) != (1, 1):
            raise FileFormatError("the EXR has a channel of an unknown pixel type or with subsampling")
        types[data[position:end].decode("latin-1")] = pixel
        position = end + 17
    if not types or data[position:] != b"\0":
        raise FileFormatError("the EXR header is damaged: the channel list is malformed")
    return types


def _check_size(rest: int, width: int, height: int, types: dict[str, int], compression: bytes) -> None:
    """Hold the declared pixels against the bytes that follow the header."""
    code = compression[0] if len(compression) == 1 else -1
    if code not in _LINES:
        raise FileFormatError("the EXR's compression is lossy or unknown, so its values are not exact")
    row = width * sum(_BYTES[pixel] for pixel in types.values())
    chunks = -(-height // _LINES[code])
    # each chunk has an 8-byte offset in the table, and 8 bytes of line number and size
    least = 16 * chunks + (row * height if code == 0 else 0)
    if rest < least or row * height > _MAX_RATIO * rest:
        raise FileFormatError(f"the EXR declares {width} x {height} pixels, more than it holds: truncated or damaged")
