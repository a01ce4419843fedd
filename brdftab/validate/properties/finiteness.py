"""Every value is a number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "channels that are NaN or infinite"


def findings(subject: Subject) -> Iterator[Finding]:
    """Count the channels that are not finite, direction by direction."""
    for probe in subject.probes:
        wrong = (~np.isfinite(probe.values)).sum(axis=-1)
        yield from probe.findings("finiteness", wrong, 0.0)
