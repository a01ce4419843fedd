"""Run time without compilation: a clock that stands still while Numba compiles, or loads what it compiled before."""

from __future__ import annotations

import functools
import threading
import time


class _Compiling(threading.local):
    """Seconds that one thread has spent under Numba's compiler lock, and how deep it is in there now."""

    def __init__(self) -> None:
        self.depth = 0
        self.since = 0.0
        self.seconds = 0.0


_compiling = _Compiling()


@functools.cache
def _listen() -> None:
    """Let Numba report whenever it takes its compiler lock: on compiling, and on reading and writing its disk cache."""
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, _: event.Event) -> None:
            if _compiling.depth == 0:
                _compiling.since = time.perf_counter()
            _compiling.depth += 1

        def on_end(self, _: event.Event) -> None:
            # a lock that was taken before anyone listened is none of ours
            if _compiling.depth == 0:
                return
            _compiling.depth -= 1
            if _compiling.depth == 0:
                _compiling.seconds += time.perf_counter() - _compiling.since

    event.register("numba:compiler_lock", Listener())


def _compile_seconds() -> float:
    running = time.perf_counter() - _compiling.since if _compiling.depth else 0.0
    return _compiling.seconds + running


class Clock:
    """Seconds since its start, those that this thread spent compiling apart.

    A first run in a fresh installation compiles its kernels for seconds to minutes, and each later process loads them;
    neither tells what a table costs, so run times are taken with this clock.
    """

    def __init__(self) -> None:
        _listen()
        self._started = time.perf_counter()
        self._before = _compile_seconds()

    @property
    def compiling(self) -> float:
        """Seconds since the start that went into compiling kernels or loading compiled ones."""
        return _compile_seconds() - self._before

    @property
    def wall(self) -> float:
        """Seconds since the start, all counted."""
        return time.perf_counter() - self._started

    @property
    def seconds(self) -> float:
        """Seconds since the start without compilation."""
        return max(0.0, self.wall - self.compiling)
