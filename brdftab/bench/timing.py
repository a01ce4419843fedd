"""Run times: repeats after a warm-up, with their spread, and nothing kept from before but compiled code."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

# a run that takes longer than the whole allowance is not repeated
LEAST = 3


@dataclass(frozen=True)
class Timing:
    """Wall times of some repeats in seconds.

    Attributes
    ----------
    median, min, max : float
        Over the repeats.
    cpu_min : float
        Least processor time of all threads: what a busy machine changes least.
    repeats : int
        How many there were.
    """

    median: float
    min: float
    max: float
    cpu_min: float
    repeats: int

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return asdict(self)


def timed(work: Callable[[], Any], repeats: int, seconds: float, before: Callable[[], Any] | None = None) -> Timing:
    """Time some calls; what compiles has to have run before.

    Parameters
    ----------
    work : callable
        What is timed.
    repeats : int
        Most calls.
    seconds : float
        No further call once so much time is spent, but three calls unless one takes longer than this.
    before : callable, optional
        Called ahead of each call, not timed.
    """
    wall: list[float] = []
    cpu: list[float] = []
    while len(wall) < repeats:
        if before is not None:
            before()
        started, spent = time.perf_counter(), time.process_time()
        work()
        wall.append(time.perf_counter() - started)
        cpu.append(time.process_time() - spent)
        if wall[-1] > seconds or (len(wall) >= LEAST and sum(wall) > seconds):
            break
    return Timing(float(np.median(wall)), min(wall), max(wall), min(cpu), len(wall))


def forget() -> None:
    """Drop what brdftab's modules keep from earlier calls: rules, solutions, traced scratches; not compiled code."""
    for name, module in list(sys.modules.items()):
        if module is None or not name.startswith("brdftab."):
            continue
        for kept in list(vars(module).values()):
            clear = getattr(kept, "cache_clear", None)
            if callable(clear) and hasattr(kept, "cache_info"):
                clear()
