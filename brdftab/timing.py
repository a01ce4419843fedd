"""Run time without compilation: a clock that stands still while Numba or JAX compile, or load what they compiled."""

from __future__ import annotations

import functools
import gc
import sys
import threading
import time


class _Compiling(threading.local):
    """Seconds that one thread has spent compiling, and how deep it is under Numba's compiler lock now."""

    def __init__(self) -> None:
        self.depth = 0
        self.since = 0.0
        self.seconds = 0.0
        # start and length of what JAX told last, without what lies inside
        self.told: list[tuple[float, float]] = []


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
    gc.callbacks.append(_collecting)


def _collecting(phase: str, what: dict[str, int]) -> None:
    """Count full garbage collections as compiling: a compiler leaves some hundred thousand objects to look through."""
    if what["generation"] < 2 or _compiling.depth:
        return
    if phase == "start":
        _compiling.since = time.perf_counter()
    else:
        _compiling.seconds += time.perf_counter() - _compiling.since


@functools.cache
def _listen_to_jax() -> None:
    """Let JAX report its tracing, lowering and compiling."""
    from jax import monitoring

    def told(event: str, duration_secs: float, **_: str | int) -> None:
        if not event.startswith("/jax/core/compile/") or _compiling.depth:
            return
        start = time.perf_counter() - duration_secs
        # functions traced inside another one were told first
        while _compiling.told and _compiling.told[-1][0] >= start:
            _compiling.seconds -= _compiling.told.pop()[1]
        _compiling.told.append((start, duration_secs))
        _compiling.seconds += duration_secs

    monitoring.register_event_duration_secs_listener(told)


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
        if "jax" in sys.modules:
            _listen_to_jax()
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
