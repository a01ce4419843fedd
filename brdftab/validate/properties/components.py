"""Components add up to the value."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab import models
from brdftab.evaluation.points import ORDERS
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "difference between the sum of the components and the value, relative"
ROUNDING = 1e-9
# values below (1/sr) are not looked at
DARK = 1e-14


def findings(subject: Subject) -> Iterator[Finding]:
    """Compare the sum of all components with the value."""
    for probe in subject.some(12):
        module = models.kernel(probe.model)
        parts = module.points(probe.setup, *probe.angles, orders=ORDERS, tolerance=probe.tolerance).sum(axis=1)
        whole = module.points(probe.setup, *probe.angles, orders=0, tolerance=probe.tolerance)[:, 0]
        scale = np.maximum(np.abs(whole).max(axis=-1), DARK / ROUNDING)
        bound = ROUNDING
        yield from probe.findings("components", np.abs(parts - whole).max(axis=-1) / scale, bound)
