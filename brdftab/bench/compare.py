"""Two runs held against each other: what became slower or worse, by ratio."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from brdftab.bench.measures import NAMES
from brdftab.bench.report import seconds
from brdftab.errors import ParameterError

SLOWER, WORSE = 1.5, 1.5


@dataclass(frozen=True)
class Change:
    """One method in both runs.

    Attributes
    ----------
    model, parameters, method : str
        What it is.
    status : {"same", "better", "slower", "worse", "slower, worse", "gone", "new"}
        Outcome; "gone" counts as a failure, "new" does not.
    time_ratio : float or None
        New over old time, of the least kernel times: these feel a busy machine least.
    error_ratio : float or None
        Largest ratio of the four errors; errors below either reference's uncertainty count as that.
    old_s, new_s : float or None
        The least kernel times.
    error : str
        The measure with the largest ratio.
    """

    model: str
    parameters: str
    method: str
    status: str
    time_ratio: float | None = None
    error_ratio: float | None = None
    old_s: float | None = None
    new_s: float | None = None
    error: str = ""

    @property
    def failed(self) -> bool:
        """Whether this is a reason for exit status 1."""
        return self.status not in ("same", "better", "new")

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return asdict(self) | {"failed": self.failed}


def _rows(data: dict[str, Any]) -> dict[tuple[str, str, str], tuple[dict[str, Any], dict[str, float]]]:
    """Map (model, parameters and grid, method) to a method's row and the uncertainty of its reference."""
    found = {}
    for result in data["results"]:
        given = json.dumps({**result["parameters"], "grid": result["grid"]}, sort_keys=True)
        for row in result["methods"]:
            if row.get("peer"):
                # other programs' times are no concern of ours
                continue
            # a rung that gives the same numbers as a coarser one goes by that one's times
            for name in (row["name"], *row.get("same", [])):
                found[result["model"], given, name] = (row, result["reference"]["uncertainty"])
    return found


def compare(old: dict[str, Any], new: dict[str, Any], *, slower: float = SLOWER, worse: float = WORSE) -> list[Change]:
    """Compare two documents of results, method by method.

    Parameters
    ----------
    old, new : dict
        From `lists.read_results`.
    slower, worse : float, optional
        Ratios of times and of errors above which a method fails; above 1.

    Returns
    -------
    list of Change
        In the order of `old`, new methods last.

    Raises
    ------
    ParameterError
        For a ratio that is not above 1, and where the runs share no method.
    """
    for name, value in (("slower", slower), ("worse", worse)):
        if not value > 1.0:
            raise ParameterError.out_of_range(name, value, "(1, inf)", "it is the ratio of new to old that fails")
    before, after = _rows(old), _rows(new)
    if not before.keys() & after.keys():
        raise ParameterError("the files share no model, parameters, grid and method; compare runs of the same list")
    measured = {key[:2] for key in after}
    changes = []
    for key, (row, doubt) in before.items():
        if key in after:
            changes.append(_change(key, (row, doubt), after[key], slower, worse))
        elif key[:2] in measured:
            changes.append(Change(*key, status="gone"))
    return changes + [Change(*key, status="new") for key in after if key not in before]


def _change(
    key: tuple[str, str, str],
    old: tuple[dict[str, Any], dict[str, float]],
    new: tuple[dict[str, Any], dict[str, float]],
    slower: float,
    worse: float,
) -> Change:
    """Return how one method changed."""
    times = float(old[0]["kernel_s"]["min"]), float(new[0]["kernel_s"]["min"])
    ratios = {}
    for name in NAMES:
        floor = max(old[1][name], new[1][name])
        ratios[name] = max(float(new[0]["error"][name]), floor) / max(float(old[0]["error"][name]), floor, 1e-300)
    error = max(ratios, key=lambda name: ratios[name])
    took = times[1] / max(times[0], 1e-12)
    words = [word for word, ratio, most in (("slower", took, slower), ("worse", ratios[error], worse)) if ratio > most]
    if not words:
        gained = took < 1.0 / slower or (all(r <= 1.0 for r in ratios.values()) and min(ratios.values()) < 1.0 / worse)
        words = ["better" if gained else "same"]
    return Change(*key, ", ".join(words), took, ratios[error], *times, error)


def lines(changes: list[Change]) -> Iterator[str]:
    """Yield a table of the changes, failures first, and a line that sums up."""
    wide = max([len("method"), *(len(f"{c.model} {c.method}") for c in changes)])
    yield f"{'method':<{wide}}{'old':>11}{'new':>11}{'time x':>9}{'error x':>9}  of      status"
    for change in sorted(changes, key=lambda c: not c.failed):
        name = f"{change.model} {change.method}"
        if change.time_ratio is None or change.old_s is None or change.new_s is None:
            yield f"{name:<{wide}}{'':>40}          {change.status}"
            continue
        yield (
            f"{name:<{wide}}{seconds(change.old_s):>11}{seconds(change.new_s):>11}{change.time_ratio:>9.2f}"
            f"{change.error_ratio:>9.2f}  {change.error:<7} {change.status}"
        )
    failed = sum(c.failed for c in changes)
    yield f"{len(changes)} methods: {failed} slower, worse or gone"
