"""Every entry of the table of known limits still occurs, as large as it says."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from brdftab.models.resolve import resolve
from brdftab.validate import limits, properties
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "size that the table states of a limit, over the one measured at its example"
# an example shows at least a third of the stated size, else the entry is stale
STALE = 3.0


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if any(known.model == subject.model for known in limits.limits()) else "no known limit"


def occurring(known: limits.Limit, fast: bool = True) -> Finding | None:
    """Return the largest failure at an entry's example, or None where all holds there."""
    setup = resolve(known.model, **known.example["parameters"])
    directions = np.radians(np.array(known.example.get("directions", [[45.0, 45.0, 90.0, 0.0]]), dtype=float).T)
    subject = Subject(known.model, fast, (setup, (directions[0], directions[1], directions[2], directions[3])))
    failing = [f for f in properties.module(known.prop).findings(subject) if not f.holds and known.covers(f)]
    return max(failing, key=lambda f: f.value, default=None)


def findings(subject: Subject) -> Iterator[Finding]:
    """Measure every entry of the model again at its example."""
    for known in limits.limits():
        if known.model != subject.model:
            continue
        found = occurring(known)
        share = math.inf if found is None else known.size / found.value
        where = (0.0, 0.0, 0.0, 0.0) if found is None else found.angles
        parameters = resolve(known.model, **known.example["parameters"]).parameters
        yield Finding("limits", subject.model, share, STALE, parameters, where, known.name)
