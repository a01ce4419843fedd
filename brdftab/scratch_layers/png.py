"""Pictures as PNG, 8 bits a channel, with nothing but zlib."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import BrdftabError
from brdftab.io.atomic import atomic, check_target, show


def check_picture_output(path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Refuse early what `write` would refuse at the end."""
    if Path(path).suffix.lower() != ".png":
        raise BrdftabError(f"out = {show(path)} has no known ending; end it in .png")
    check_target(path, overwrite=overwrite)


def _chunk(kind: bytes, data: bytes) -> bytes:
    body = kind + data
    return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))


def write(pixels: NDArray[np.uint8], path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write pixels (rows, columns, 3), sRGB; the file appears whole or not at all.

    Raises
    ------
    BrdftabError
        If the ending is not .png, the file exists, or it cannot be written.
    """
    check_picture_output(path, overwrite=overwrite)
    rows, columns = pixels.shape[:2]
    # each row begins with its filter: none
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), pixels.reshape(rows, -1)], axis=1)
    head = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", head) + _chunk(b"sRGB", b"\0")
    data += _chunk(b"IDAT", zlib.compress(lines.tobytes(), 9)) + _chunk(b"IEND", b"")
    with atomic(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data)
