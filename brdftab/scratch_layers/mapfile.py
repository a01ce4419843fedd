"""Maps of covered area as OpenEXR: a part a mip level, a channel a layer, 32-bit floats, what made them as JSON.

Shares of 1e-6 count, so that nothing less than floats will do. The parts have data windows of their own and the display
window of the finest level.
"""

from __future__ import annotations

import json
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from brdftab._version import __version__
from brdftab.errors import BrdftabError, FileFormatError, ParameterError
from brdftab.io.atomic import atomic, check_target, show
from brdftab.io.exr import ATTRIBUTE
from brdftab.io.names import utf8
from brdftab.io.quiet import quiet
from brdftab.scratch_layers.layers import MOST_LAYERS, Layered
from brdftab.scratch_layers.maps import LARGEST, AlphaMaps, halved

KIND = "scratch maps"


def check_map_output(path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Refuse early what `write` would refuse at the end."""
    if Path(path).suffix.lower() != ".exr":
        raise BrdftabError(f"out = {show(path)} has no known ending; end it in .exr")
    check_target(path, overwrite=overwrite)


def _box(size: int) -> tuple[Any, Any]:
    return np.zeros(2, dtype=np.int32), np.full(2, size - 1, dtype=np.int32)


def channel(n: int) -> str:
    """Return the name of a layer's channel."""
    return f"layer{n:03d}"


def write(maps: AlphaMaps, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write maps; the file appears whole or not at all.

    Parameters
    ----------
    maps : AlphaMaps
    path : str or path-like
        Ends in ``.exr``.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    BrdftabError
        If the ending is unknown, the file exists, or it cannot be written.
    """
    check_map_output(path, overwrite=overwrite)
    text = json.dumps({"kind": KIND, "version": __version__, **maps.facts}, allow_nan=False)
    parts = []
    for n, level in enumerate(maps.levels):
        header = {
            "type": OpenEXR.scanlineimage,
            "compression": OpenEXR.NO_COMPRESSION,
            "displayWindow": _box(maps.size),
            "dataWindow": _box(level.shape[1]),
        }
        if n == 0:
            header[ATTRIBUTE] = text
        channels = {channel(k): OpenEXR.Channel(channel(k), np.ascontiguousarray(a)) for k, a in enumerate(level)}
        parts.append(OpenEXR.Part(header, channels, f"level{n:02d}"))
    with atomic(path, overwrite=overwrite) as temporary:
        try:
            OpenEXR.File(parts).write(utf8(temporary))
        except (RuntimeError, ValueError) as error:
            # the library turns a full disk into these; OSError is what the caller explains
            raise OSError(f"OpenEXR: {str(error).splitlines()[0]}") from error


def read(path: str | os.PathLike[str]) -> AlphaMaps:
    """Read maps that `write` wrote.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    AlphaMaps

    Raises
    ------
    FileFormatError
        If the file is damaged or holds something else.
    BrdftabError
        If it cannot be opened.
    """
    name = os.fspath(path)
    try:
        with open(name, "rb") as file:
            magic, bytes_there = file.read(4), file.seek(0, 2)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise BrdftabError(f"{show(name)}: cannot be opened ({reason}); check the path") from error
    remedy = "give a file that brdftab scratch maps wrote, or write it again"
    if magic != b"\x76\x2f\x31\x01":
        raise FileFormatError(f"{show(name)}: is no EXR; {remedy}")
    spelled = utf8(name)
    try:
        return _load(spelled, bytes_there)
    except MemoryError:
        raise
    except FileFormatError as error:
        raise FileFormatError(f"{show(name)}: {error}; {remedy}") from None
    except Exception as error:
        # the library raises RuntimeError, ValueError, TypeError and others on damaged files
        raise FileFormatError(f"{show(name)}: is damaged or truncated; {remedy}") from error


def _load(name: str, bytes_there: int) -> AlphaMaps:
    """Read a file that has the magic number; nothing is allocated before its sizes are held against its length."""
    with quiet(), OpenEXR.File(name, header_only=True) as file:
        headers = [dict(part.header) for part in file.parts]
    facts = json.loads(headers[0].get(ATTRIBUTE, "{}"))
    if not isinstance(facts, dict) or facts.pop("kind", None) != KIND:
        raise FileFormatError("the EXR holds no scratch maps")
    size, count = facts.get("size"), len(facts.get("layers", []))
    if (
        not isinstance(size, int)
        or size not in [2**n for n in range(LARGEST.bit_length())]
        or not 1 <= count <= MOST_LAYERS
    ):
        raise FileFormatError("the EXR's sizes are damaged")
    if len(headers) != size.bit_length() or 4 * count * size * size > bytes_there:
        raise FileFormatError("the EXR is truncated")
    levels = []
    with quiet(), OpenEXR.File(name, separate_channels=True) as file:
        for n, part in enumerate(file.parts):
            level = np.stack([np.asarray(part.channels[channel(k)].pixels) for k in range(count)])
            if level.shape[1:] != (size >> n, size >> n) or level.dtype != np.float32:
                raise FileFormatError(f"the EXR's level {n} is damaged")
            if not ((level >= 0.0) & (level <= 1.0)).all():
                raise FileFormatError(f"the EXR's level {n} holds numbers outside [0, 1]")
            levels.append(level)
    slack = 2.0 * float(facts.get("cull", 0.0)) + 1e-6
    for finer, level in pairwise(levels):
        # culling drops less than its threshold from each; anything more is damage that the library let pass
        if np.abs(halved(finer) - level).max() > slack:
            raise FileFormatError("the EXR's levels contradict each other")
    facts.pop("version", None)
    return AlphaMaps(levels, facts)


def check_maps_of(maps: AlphaMaps, layered: Layered, path: str) -> None:
    """Refuse maps of other layers.

    Raises
    ------
    ParameterError
        If a layer's place, angle, width, length or area is not the one that was drawn.
    """
    drawn = maps.facts["layers"]
    wanted = [layer.to_json() for layer in layered.layers]
    keys = ("name", "area", "width", "length", "angle_degrees")
    if len(drawn) != len(wanted) or any(a.get(k) != b[k] for a, b in zip(drawn, wanted, strict=True) for k in keys):
        raise ParameterError(
            f"maps = {show(path)} were drawn for other layers than {show(layered.source)}; draw them again"
        )
