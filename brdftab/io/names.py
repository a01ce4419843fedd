"""File names for libraries in C++, which take them as UTF-8 whatever the locale."""

from __future__ import annotations

import os

from brdftab.errors import BrdftabError
from brdftab.io.atomic import show


def utf8(path: str | os.PathLike[str]) -> str:
    """Return a path as text whose UTF-8 bytes are the file's name.

    Python spells names in the locale's encoding, with stand-ins for bytes that it lacks; in the C locale those are all
    letters but ASCII.

    Raises
    ------
    BrdftabError
        If the name is not UTF-8.
    """
    try:
        return os.fsencode(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise BrdftabError(
            f"{show(path)}: OpenEXR takes names in UTF-8 alone, which this is not; rename it, or take .npz"
        ) from error
    except UnicodeEncodeError:
        # the locale cannot spell it, so that it does not come from the command line
        return os.fspath(path)
