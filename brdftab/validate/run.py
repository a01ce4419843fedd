"""All properties of one model or of all, with the worst case of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.timing import Clock
from brdftab.validate import properties
from brdftab.validate.finding import Finding
from brdftab.validate.limits import marked
from brdftab.validate.probe import Subject
from brdftab.validate.report import Report, Row

Progress = Callable[[float], None]


def _row(name: str, subject: Subject) -> Row:
    """Measure one property of one model."""
    module = properties.module(name)
    reason = subject.own.skip.get(name, "")
    if not reason and subject.fast:
        reason = subject.own.skip_fast.get(name, "")
    if not reason and hasattr(module, "reason"):
        reason = module.reason(subject)
    if reason:
        return Row(name, subject.model, skipped=reason)
    clock = Clock()
    worst: Finding | None = None
    failing: list[Finding] = []
    known: dict[str, Finding] = {}
    count = 0
    for raw in module.findings(subject):
        found = marked(raw)
        count += 1
        if found.limit:
            before = known.get(found.limit)
            known[found.limit] = found if before is None or found.value > before.value else before
            continue
        if not found.holds:
            failing.append(found)
        if worst is None or found.ratio > worst.ratio:
            worst = found
    failing.sort(key=lambda f: -f.ratio)
    elapsed = clock.seconds
    note = worst.detail if worst is not None and getattr(module, "TELL", False) else ""
    return Row(name, subject.model, worst, failing, list(known.values()), count, elapsed, note=note)


def check(
    model: str | None = None,
    *,
    fast: bool = False,
    only: Sequence[str] = (),
    progress: Progress | None = None,
) -> Report:
    """Measure what must hold of a model, or of every model of the registry, at ordinary and extreme settings.

    Parameters
    ----------
    model : str, optional
        Registry name; all models by default.
    fast : bool, optional
        Take an even choice of the settings and directions: seconds a model.
    only : sequence of str, optional
        Names of the properties to measure; all by default.
    progress : callable, optional
        Called with the finished share of the work.

    Returns
    -------
    Report
        A row a model and property with its worst case; ``report.green`` tells whether all hold but for known limits.

    Raises
    ------
    ParameterError
        If the model or a property is unknown.
    """
    known = properties.names()
    for name in only:
        if name not in known:
            raise ParameterError.not_known("property", name, known)
    chosen = [models.spec(model).name] if model is not None else models.names()
    wanted = list(only) or known
    clock = Clock()
    rows = []
    for k, one in enumerate(chosen):
        subject = Subject(one, fast)
        for n, name in enumerate(wanted):
            rows.append(_row(name, subject))
            if progress is not None:
                progress((k + (n + 1) / len(wanted)) / len(chosen))
    return Report(rows, fast, clock.seconds)
