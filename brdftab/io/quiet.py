"""Silence for libraries that write to the terminal on their own."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Drop what C code writes to standard error, and bindings print to ``sys.stdout``, inside the block.

    OpenEXR reports every damaged chunk on both before it raises; the caller turns that into one line of its own. The
    whole process shares the streams, so keep the block short.
    """
    try:
        saved = os.dup(2)
    except OSError:
        # no standard error stream, nothing to silence there
        with contextlib.redirect_stdout(io.StringIO()):
            yield
        return
    try:
        sink = os.open(os.devnull, os.O_WRONLY)
        os.dup2(sink, 2)
        os.close(sink)
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
