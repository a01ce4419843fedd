"""Named arrays of one shape and a JSON header, as EXR (float32) or NPZ (as they are)."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import BrdftabError, FileFormatError
from brdftab.io import check_output
from brdftab.io.atomic import atomic, show
from brdftab.io.names import utf8
from brdftab.io.quiet import quiet

ATTRIBUTE = "brdftab"
METADATA = "metadata"
Images = dict[str, NDArray[Any]]


def write(images: Images, head: dict[str, Any], path: str | Path, *, overwrite: bool = False) -> None:
    """Write 2-D arrays of one shape and their header.

    Raises
    ------
    OutputExistsError, BrdftabError
        As `brdftab.write`.
    """
    check_output(path, overwrite=overwrite)
    text = json.dumps(head, allow_nan=False)
    with atomic(path, overwrite=overwrite) as temporary:
        if Path(path).suffix.lower() == ".npz":
            with open(temporary, "wb") as file:
                np.savez_compressed(file, allow_pickle=False, **{METADATA: np.array(text)}, **images)
            return
        import OpenEXR

        pixels = {n: np.ascontiguousarray(a, dtype=np.float32) for n, a in images.items()}
        header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, ATTRIBUTE: text}
        channels = {n: OpenEXR.Channel(n, a) for n, a in pixels.items()}
        try:
            OpenEXR.File([OpenEXR.Part(header, channels, "scratch")]).write(utf8(temporary))
        except (RuntimeError, ValueError) as error:
            raise BrdftabError(f"cannot write {show(path)} ({str(error).splitlines()[0]}); check the disk") from error


def read(path: str | Path, kind: str) -> tuple[Images, dict[str, Any]]:
    """Read what `write` wrote, of the header's format `kind`.

    Raises
    ------
    FileFormatError
        If the file is of another kind, or damaged.
    BrdftabError
        If it cannot be opened.
    """
    try:
        with open(path, "rb") as file:
            start = file.read(4)
        images, text = _read_npz(path) if start[:2] == b"PK" else _read_exr(path)
        head = json.loads(text)
    except OSError as error:
        raise BrdftabError(f"{show(path)}: cannot be opened ({error.strerror or error}); check the path") from error
    except (LookupError, ValueError, TypeError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise FileFormatError(f"{show(path)}: is not a {kind} of brdftab, or damaged; write it again") from error
    if not isinstance(head, dict) or head.get("format") != kind:
        raise FileFormatError(f"{show(path)}: is a file of another kind, not a {kind}; write one with brdftab tabulate")
    return images, head


def _read_npz(path: str | Path) -> tuple[Images, str]:
    with np.load(path, allow_pickle=False) as file:
        return {n: file[n] for n in file.files if n != METADATA}, str(file[METADATA])


def _read_exr(path: str | Path) -> tuple[Images, str]:
    import OpenEXR

    with quiet(), OpenEXR.File(utf8(path), separate_channels=True) as file:
        part = file.parts[0]
        return {n: np.array(c.pixels) for n, c in part.channels.items()}, str(part.header[ATTRIBUTE])
