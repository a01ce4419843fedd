"""Ctrl-C that is answered while a kernel runs, too."""

from __future__ import annotations

import contextlib
import functools
import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

ABORTED = 130
# seconds that a command has to end by itself
GRACE = 0.7


@contextlib.contextmanager
def answered() -> Iterator[None]:
    """End the process soon after Ctrl-C, even if compiled code keeps Python from noticing it.

    Python raises KeyboardInterrupt between two of its own steps. A kernel, a solver or a compiler may run for long
    inside one; a second thread then removes unfinished files and ends the process.
    """
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    done = threading.Event()
    told = sys.unraisablehook
    sys.unraisablehook = functools.partial(_unraised, told)
    watcher = threading.Thread(target=_watch, args=(reader, done), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        sys.unraisablehook = told
        signal.set_wakeup_fd(before)
        os.close(writer)
        watcher.join(1.0)
        os.close(reader)


def _unraised(otherwise: Callable[[Any], object], what: Any) -> None:
    """Be silent on an interruption inside a callback of the compiler, which cannot pass it on: the watcher answers."""
    if not issubclass(what.exc_type, KeyboardInterrupt):
        otherwise(what)


def _watch(reader: int, done: threading.Event) -> None:
    """Wait for the number of an interruption, or for the end of the command."""
    while number := os.read(reader, 1) if select.select([reader], [], []) else b"":
        if number[0] == signal.SIGINT and not done.wait(GRACE):
            from brdftab.io.atomic import discard

            discard()
            # a progress bar hides the cursor of a terminal
            show = "\x1b[?25h\n" if sys.stderr.isatty() else ""
            with contextlib.suppress(OSError):
                os.write(2, f"{show}Aborted\n".encode())
            os._exit(ABORTED)
