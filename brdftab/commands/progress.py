"""The progress bar that long commands share, and a line that says so where one takes long."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

import click

# seconds from which on a run counts as long, and those after which its first estimate is trusted
LONG, FIRST = 30.0, 1.0
SHORTER = "a coarser grid, a looser tolerance or fewer bounces make it shorter"


@contextlib.contextmanager
def progress_bar(what: str, shorter: str = SHORTER) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on stderr where that is a terminal; say once how long a long run will take.

    Parameters
    ----------
    what : str
        What is done, as "tabulating".
    shorter : str
        What makes it shorter.
    """
    from brdftab.timing import Clock

    clock, told, before = Clock(), False, 0.0

    def tell(share: float, echo: Callable[[str], None]) -> None:
        """Say how long it takes, from the share that is done; a share that falls is a finer rule's, from its start."""
        nonlocal told, clock, before
        if share < before:
            clock = Clock()
        before = share
        if told or not 0.0 < share < 1.0 or clock.seconds < FIRST:
            return
        remaining = clock.seconds * (1.0 - share) / share
        if remaining > LONG:
            told = True
            echo(f"brdftab: {what} takes about {_duration(remaining)} more; {shorter}; Ctrl-C ends it")

    if not sys.stderr.isatty():
        yield lambda share: tell(share, lambda line: click.echo(line, err=True))
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TextColumn("so far,"),
        TimeRemainingColumn(), TextColumn("left"),
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)

        def report(share: float) -> None:
            bar.update(task, completed=share)
            tell(share, lambda line: bar.console.print(line, highlight=False, markup=False))

        yield report


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
