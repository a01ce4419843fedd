"""Files of figures: matplotlib loaded when one is asked for, and whole files or none."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import Any

from brdftab.errors import BrdftabError
from brdftab.io.atomic import atomic, check_target, show

ENDINGS = (".png", ".pdf", ".svg")


def check_ending(path: str | os.PathLike[str], name: str) -> None:
    """Raise `BrdftabError` where a figure's path has no known ending; `name` is what the user calls the path."""
    if not os.fspath(path).lower().endswith(ENDINGS):
        raise BrdftabError(f"{name} = {show(path)} has no known ending; end it in .png, .pdf or .svg")


@contextlib.contextmanager
def figure(
    path: str | os.PathLike[str], size: tuple[float, float], name: str, *, overwrite: bool = False
) -> Iterator[Any]:
    """Give an empty matplotlib figure of a size in inches and write it at the end.

    Raises
    ------
    BrdftabError
        Where matplotlib is missing, the ending is unknown or the file cannot be written; `name` is what the user calls
        the path.
    """
    check_ending(path, name)
    check_target(path, overwrite=overwrite)
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise BrdftabError(f"{name} needs matplotlib; install it with: pip install 'brdftab[report]'") from error
    picture = Figure(figsize=size, layout="constrained")
    yield picture
    with atomic(path, overwrite=overwrite) as temporary:
        picture.savefig(temporary, dpi=150)
