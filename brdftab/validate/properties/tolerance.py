"""A value meets the tolerance that it was asked with, on either side of every change of rule."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab import models
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "distance to the value at a hundredth of the tolerance, relative, over the tolerance"
LADDER = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
# values below (1/sr) are not resolved by a relative rule
DARK = 1e-9


def findings(subject: Subject) -> Iterator[Finding]:
    """Compare values at one tolerance after the other with those at a hundredth of it."""
    ladder = [t for t in LADDER if t >= subject.tolerance]
    for probe in subject.some(2 if subject.fast else 10):
        if probe.stochastic:
            continue
        module = models.kernel(probe.model)
        kept: dict[float, np.ndarray] = {}
        for asked in ladder:
            for one in (asked, 0.01 * asked):
                if one not in kept:
                    kept[one] = module.points(probe.setup, *probe.angles, orders=0, tolerance=one)[:, 0]
            fine = kept[0.01 * asked]
            scale = np.maximum(np.abs(fine).max(axis=-1), DARK)
            off = np.abs(kept[asked] - fine).max(axis=-1) / scale / asked
            yield from probe.findings("tolerance", off, 1.0, f"at tolerance {asked:g}")
