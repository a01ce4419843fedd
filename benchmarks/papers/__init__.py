"""What the papers state beside what we measure, as one page."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from typing import Any

from benchmarks.papers.section import Scale
from brdftab.errors import ParameterError

PARTS = ("lee", "wang", "meneveaux", "raymond", "programs")
COMMAND = "python -m benchmarks.papers --out docs/results/papers.md --overwrite"


def suite(
    *,
    quick: bool = False,
    repeats: int | None = None,
    threads: int | None = None,
    peer: bool = True,
    parts: tuple[str, ...] = PARTS,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Any]:
    """Measure what the papers state.

    Parameters
    ----------
    quick : bool, optional
        A hundredth of the samples and small tables, whose numbers mean nothing: for tests.
    repeats : int, optional
        Most timed calls, at least 1.
    threads : int, optional
        Numba threads.
    peer : bool, optional
        Mitsuba 3 and SciPy too, where installed.
    parts : tuple of str, optional
        Which of `PARTS`.
    progress : callable, optional
        Called with the finished share of the work.

    Returns
    -------
    dict
        machine, quick, threads, seconds and sections; JSON-able.
    """
    from brdftab.bench.run import recorded
    from brdftab.tabulation.tabulate import thread_count

    if repeats is not None and repeats < 1:
        raise ParameterError.out_of_range("repeats", repeats, "[1, inf)", "give at least one timed call")
    scale = Scale(quick, repeats or (2 if quick else 9), peer)
    machine, sections, started = recorded(), [], time.perf_counter()
    with thread_count(threads) as used:
        for number, name in enumerate(parts):
            at = time.perf_counter()
            found = importlib.import_module(f"benchmarks.papers.{name}").section(scale).to_json()
            sections.append({**found, "seconds": time.perf_counter() - at})
            if progress is not None:
                progress((number + 1) / len(parts))
    took = time.perf_counter() - started
    return {"machine": machine, "quick": quick, "threads": used, "seconds": took, "sections": sections}


def page(found: dict[str, Any]) -> str:
    """Return the Markdown page of a suite's results."""
    machine = found["machine"]
    versions = ", ".join(f"{name} {number}" for name, number in machine["versions"].items())
    load = "" if machine["load_average"] is None else f", load average {machine['load_average']:.1f} at the start"
    lines = [
        "# The papers' numbers beside ours",
        "",
        f"Made by `{COMMAND}`; do not edit.",
        "",
        f"{machine['processor'] or machine['architecture']}, {machine['cpus']} cores, {found['threads']} threads"
        f"{load}; "
        f"Python {machine['python']}, {versions}. The whole suite took {found['seconds']:.0f} s. Times are of compiled "
        "kernels, the least of the repeats where no more is said; the papers' are of their own machines.",
    ]
    if found["quick"]:
        lines += ["", "A quick run: the numbers mean nothing."]
    for section in found["sections"]:
        lines += ["", f"## {section['title']}", "", f"{section['paper']}. Took {section['seconds']:.0f} s."]
        for sheet in section["sheets"]:
            lines += ["", f"### {sheet['title']}", "", *_rows(sheet["columns"], sheet["rows"])]
            for note in sheet["notes"]:
                lines += ["", note]
        lines += ["", *(f"Not measured: {line}." for line in section["missing"])] if section["missing"] else []
    return "\n".join(lines) + "\n"


def _rows(columns: tuple[str, ...], rows: list[tuple[Any, ...]]) -> list[str]:
    """Return a Markdown table."""
    found = ["| " + " | ".join(columns) + " |", "| " + " | ".join("---" for _ in columns) + " |"]
    return found + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
