"""How stiff a fit of the model would be over its parameter box, and which residual is best there."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator

import numpy as np

from brdftab.models.resolve import Setup, resolve
from brdftab.validate import condition, sweep
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject
from brdftab.validate.properties.twin import quick_compilation, tolerance_of

MEANING = "condition number of the scaled Jacobian with the log residual"
# where the squared condition number reaches the rounding of float64, no solver tells the parameters apart
LOST = 1e7
TELL = True
# what measured materials have, by name; the roughness is called by its role. Other numbers: their bounds, less 2 %
TYPICAL = {"roughness": (0.05, 1.0), "f0": (0.02, 0.95), "ior": (1.05, 3.0), "kd": (0.02, 0.98)}


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if subject.has_twin else "the model has no twin, and is not fitted"


def range_of(subject: Subject, name: str) -> tuple[float, float]:
    """Return between which values a number is drawn."""
    spec = subject.spec
    param = spec.param(name)
    key = "roughness" if param.role == "roughness" else name if param.role else ""
    bounds = param.bounds
    assert bounds is not None
    low, high = TYPICAL.get(
        key, (bounds[0] + 0.02 * (bounds[1] - bounds[0]), bounds[1] - 0.02 * (bounds[1] - bounds[0]))
    )
    return max(low, bounds[0]), min(high, bounds[1])


def box(subject: Subject) -> list[Setup]:
    """Return settings inside the box that a fit has: default choices, roughness, albedo, and f0 or else an index."""
    spec = subject.spec
    names = [p.name for p in spec.params if p.kind in ("float", "channels") and not sweep.is_special(spec, p.name)]
    if spec.ndfs:
        names.append(spec.roughness)
        names += ["f0" if spec.shares("material") else "ior"] if spec.of_role("optics") else []
    rng = np.random.default_rng(zlib.crc32(subject.model.encode()))
    count = subject.count(subject.own.box, 6, 40)
    found = []
    for _ in range(count):
        drawn = {}
        for name in dict.fromkeys(names):
            low, high = range_of(subject, name)
            even = low <= 0.0 or high < 10.0 * low
            drawn[name] = float(
                rng.uniform(low, high) if even else math.exp(rng.uniform(math.log(low), math.log(high)))
            )
        found.append(resolve(subject.model, **drawn))
    return found


def findings(subject: Subject) -> Iterator[Finding]:
    """Compute condition numbers at seeded points of the box; the worst one tells of all."""
    with quick_compilation():
        points = [(setup, condition.conditioning(setup, tolerance_of(subject))) for setup in box(subject)]
    points = [(setup, c) for setup, c in points if len(c.names) > 1]
    if not points:
        setup = box(subject)[0]
        yield Finding("stiffness", subject.model, 1.0, LOST, setup.parameters, (0.5, 0.5, 0.0, 0.0), "one parameter")
        return
    words = condition.told([c for _, c in points])
    setup, worst = max(points, key=lambda p: np.nan_to_num(p[1].scaled["log"], nan=np.inf))
    bound = LOST
    where = (0.5, 0.5, 0.0, 0.0)
    yield Finding("stiffness", subject.model, worst.scaled["log"], bound, setup.parameters, where, words)
