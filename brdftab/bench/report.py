"""Results as text: a table of methods, the Pareto front marked."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from brdftab import models
from brdftab.bench.measures import NAMES


def seconds(value: float) -> str:
    """Return a time in a unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e9:.3g} ns"


def settings(result: dict[str, Any]) -> list[str]:
    """Return the parameters of a result as words, angles in degrees."""
    units = {p.name: p.unit for p in models.spec(result["model"]).params}
    found = []
    for name, value in result["parameters"].items():
        if units.get(name) == "rad":
            value, name = round(math.degrees(value), 9), f"{name} [degrees]"
        found.append(f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}")
    return found


def _error(row: dict[str, Any], name: str) -> str:
    """Return an error; in parentheses where the reference does not resolve it."""
    shown = f"{row['error'][name]:.1e}"
    return shown if row["resolved"][name] else f"({shown})"


def table(result: dict[str, Any], error: str = "l1", time: str = "kernel") -> Iterator[str]:
    """Yield the lines of one setup's results; * marks methods that no other one beats in time and error at once."""
    yield f"{result['model']}  {', '.join(settings(result))}"
    known = result["reference"]
    rule = f"{known['samples']} samples" if "samples" in known else f"direct rule at {known['tolerance']:g}"
    shown = "  ".join(f"{name} {known['uncertainty'][name]:.1e}" for name in NAMES)
    yield f"{result['grid']} = {result['pairs']:,} pairs; reference {rule}, its uncertainty {shown}"
    wide = max([len("method"), *(len(row["name"]) for row in result["methods"])])
    heads = "".join(f"{name:>11}" for name in NAMES)
    yield f"  {'method':<{wide}}{heads}{'kernel':>11}{'min':>10}{'max':>10}{'end to end':>12}{'first':>10}"
    for row in result["methods"]:
        star = "*" if f"{time} {error}" in row["pareto"] else " "
        errors = "".join(f"{_error(row, name):>11}" for name in NAMES)
        took, whole = row["kernel_s"], row["total_s"]
        yield (
            f"{star} {row['name']:<{wide}}{errors}{seconds(took['median']):>11}{seconds(took['min']):>10}"
            f"{seconds(took['max']):>10}{seconds(whole['median']):>12}{seconds(row['first_s']):>10}"
        )
        if row["same"]:
            yield f"    the same numbers: {', '.join(row['same'])}"
    reasons: dict[str, list[str]] = {}
    for left in result["left_out"]:
        reasons.setdefault(left["reason"], []).append(left["name"])
    for reason, names in reasons.items():
        yield f"  left out: {', '.join(names)} ({reason})"
    yield f"  * nothing is at once faster ({time}) and better ({error}); (error) is below the reference's uncertainty"
