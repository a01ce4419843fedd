"""What a check found: rows, a table of text, JSON, and whether it is green."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from brdftab._version import __version__
from brdftab.tables.content import listed, told
from brdftab.validate.finding import Finding

# failures shown of one row
SHOWN = 3


@dataclass(frozen=True)
class Row:
    """One property of one model.

    Attributes
    ----------
    prop, model : str
        Names.
    worst : Finding or None
        The largest number over its bound, known limits apart; None where nothing was measured.
    failing : list of Finding
        All failures that no known limit covers, worst first.
    known : list of Finding
        The largest failure that each known limit covers.
    count : int
        How many numbers were compared with their bounds and kept.
    seconds : float
        Run time.
    skipped : str
        Why the property does not apply.
    note : str
        What the row says beyond its numbers.
    """

    prop: str
    model: str
    worst: Finding | None = None
    failing: list[Finding] = field(default_factory=list)
    known: list[Finding] = field(default_factory=list)
    count: int = 0
    seconds: float = 0.0
    skipped: str = ""
    note: str = ""

    @property
    def status(self) -> str:
        """Return ok, known, FAILED or skipped."""
        if self.skipped:
            return "skipped"
        return "FAILED" if self.failing else ("known" if self.known else "ok")

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return {
            "model": self.model,
            "property": self.prop,
            "status": self.status,
            "skipped": self.skipped or None,
            "worst": self.worst.to_json() if self.worst else None,
            "failures": len(self.failing),
            "failing": [f.to_json() for f in self.failing[:SHOWN]],
            "known": [f.to_json() for f in self.known],
            "note": self.note or None,
            "cases": self.count,
            "run_time_s": self.seconds,
        }


@dataclass(frozen=True, repr=False)
class Report:
    """All rows of a check, whether it was the fast one, and what it took."""

    rows: list[Row]
    fast: bool
    seconds: float

    def __repr__(self) -> str:
        counts = Counter(row.status for row in self.rows)
        told_rows = ", ".join(f"{count} {status}" for status, count in sorted(counts.items()))
        return told(self, listed(dict.fromkeys(row.model for row in self.rows)), told_rows, f"{self.seconds:.0f} s")

    @property
    def green(self) -> bool:
        """Tell whether everything holds but for known limits."""
        return not any(row.failing for row in self.rows)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return {
            "green": self.green,
            "fast": self.fast,
            "version": __version__,
            "run_time_s": self.seconds,
            "rows": [row.to_json() for row in self.rows],
        }

    def lines(self) -> list[str]:
        """Return the table and, below it, what to paste for each failure and each known limit."""
        found = [f"{'model':<18}{'property':<14}{'status':<9}{'worst':>10}{'bound':>10}{'cases':>7}{'s':>7}"]
        for row in self.rows:
            head = f"{row.model:<18}{row.prop:<14}{row.status:<9}"
            if row.skipped:
                found.append(f"{head} {row.skipped}")
                continue
            worst = row.worst
            numbers = f"{worst.value:>10.2g}{worst.bound:>10.2g}" if worst else f"{'-':>10}{'-':>10}"
            found.append(f"{head}{numbers}{row.count:>7}{row.seconds:>7.1f}")
        for row in self.rows:
            if row.note:
                found.append(f"{row.model} {row.prop}: {row.note}")
            for finding in row.failing[:SHOWN]:
                found += _told("FAILED", finding)
            for finding in row.known:
                found += _told(f"known limit: {finding.limit}", finding)
        failed = sum(bool(row.failing) for row in self.rows)
        verdict = "all hold" if self.green else f"{failed} of {len(self.rows)} rows failed"
        return [*found, f"{verdict}, run time {self.seconds:.0f} s"]


def _told(word: str, finding: Finding) -> list[str]:
    """Return the lines that tell one finding."""
    also = f", {finding.detail}" if finding.detail else ""
    if finding.along:
        also += f", between {finding.along[0]} = {finding.along[1]!r} and {finding.along[2]!r}"
    value = f"{finding.value:.3g} (bound {finding.bound:.3g})"
    return [f"{word}: {finding.model} {finding.prop} {value}{also}", f"  {finding.command()}"]
