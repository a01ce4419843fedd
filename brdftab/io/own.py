"""What files of this tool hold that are no tables: readers of tables say so, and who reads them."""

from __future__ import annotations

import os
import re
import zipfile
import zlib

# format in a file's metadata: what that is, and who reads it
KINDS = {
    "brdftab-albedo": "an albedo table; brdftab.read_albedo reads it as .npz, renderers read it as .exr",
    "brdftab-golden": "golden values; brdftab golden check reads their folder",
    "brdftab-scratch": "a traced scratch; brdftab.read_scratch reads it",
    "brdftab-scratch-triplet": "a scratch as a texture of triplets; brdftab.read_scratch reads the native form",
    "brdftab-scratch-dense": "a scratch as a dense texture; brdftab.read_scratch reads the native form",
    "brdftab-fit": "the result of a fit; fit --predict writes its table",
    "brdftab-bench": "a benchmark; brdftab bench --compare reads two of them",
    "scratch maps": "maps of scratch layers; brdftab scratch eval --maps reads them",
}
# headers and metadata are shorter
_MOST, _MEMBERS = 1 << 20, 64
_SAID = re.compile(rb'"(?:format|kind)":\s*"([a-z -]+)"')


def own_kind(path: str | os.PathLike[str]) -> str | None:
    """Return what a file of this tool holds where that is no table, and who reads it; None of any other file."""
    try:
        with open(path, "rb") as file:
            head = file.read(_MOST)
        if head.startswith(b"PK"):
            with zipfile.ZipFile(path) as archive:
                texts = [m for m in archive.infolist()[:_MEMBERS] if m.file_size <= 4 * _MOST]
                # NumPy keeps four bytes a letter
                head = b"".join(archive.read(m) for m in texts).replace(b"\0", b"")
    except (OSError, KeyError, ValueError, RuntimeError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
    found = _SAID.search(head)
    name = found.group(1).decode("ascii") if found else ""
    return KINDS.get(name)
