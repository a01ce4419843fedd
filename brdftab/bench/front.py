"""Which methods nothing beats: no other one is at once as fast and as good."""

from __future__ import annotations

from typing import Any

ERRORS = ("l1", "l2", "max", "albedo")
TIMES = ("kernel", "total")


def point(row: dict[str, Any], uncertainty: dict[str, float], error: str, time: str) -> tuple[float, float]:
    """Return seconds and error of a row; errors below the reference's own uncertainty count as that."""
    return float(row[f"{time}_s"]["median"]), max(float(row["error"][error]), uncertainty[error])


def front(
    rows: list[dict[str, Any]], uncertainty: dict[str, float], error: str = "l1", time: str = "kernel"
) -> list[str]:
    """Return the names of the methods on the Pareto front, fastest first."""
    at = {row["name"]: point(row, uncertainty, error, time) for row in rows}
    best: list[str] = []
    for name in sorted(at, key=lambda n: at[n]):
        if not best or at[name][1] < at[best[-1]][1]:
            best.append(name)
    return best


def mark(rows: list[dict[str, Any]], uncertainty: dict[str, float]) -> None:
    """Note in each row on which fronts it lies, as ``"kernel l1"``."""
    for row in rows:
        row["pareto"] = []
    for time in TIMES:
        for error in ERRORS:
            names = set(front(rows, uncertainty, error, time))
            for row in rows:
                if row["name"] in names:
                    row["pareto"].append(f"{time} {error}")
