"""No value is negative; spectra projected to RGB may leave the gamut and are not looked at."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "how far a value lies below 0 [1/sr]"


def findings(subject: Subject) -> Iterator[Finding]:
    """Measure the most negative channel, direction by direction."""
    for probe in subject.probes:
        if probe.projected:
            continue
        below = np.maximum(-np.nan_to_num(probe.values).min(axis=-1), 0.0)
        yield from probe.findings("positivity", below, 0.0)
