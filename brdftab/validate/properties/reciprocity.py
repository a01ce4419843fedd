"""Swapping light and view changes nothing, of models that say so."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "difference to the swapped pair, relative; of estimators in standard errors over 6"
# sums of rounding errors: 5e-13 measured at ordinary settings
ROUNDING = 1e-10
# values below (1/sr) are compared absolutely: where an interface vanishes, so does all but the rounding of 1 - 1
DARK = 1e-5
# standard errors; those of few paths are themselves uncertain
ERRORS = 6.0
# cosine below which estimators are not compared
GRAZING = 0.02


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if subject.spec.reciprocal else "the model says that it is not reciprocal"


def findings(subject: Subject) -> Iterator[Finding]:
    """Compare every pair of directions with its swapped one."""
    for probe in subject.probes:
        theta_i, theta_o, phi, phi_i = probe.angles
        swapped = (theta_o, theta_i, -phi, phi_i + phi)
        there, back = probe.estimate, probe.evaluated(swapped)
        apart = np.abs(there[0] - back[0])
        scale = np.maximum(np.maximum(np.abs(there[0]), np.abs(back[0])).max(axis=-1, keepdims=True), DARK)
        bound = ROUNDING
        if not probe.stochastic:
            yield from probe.findings("reciprocity", (apart / scale).max(axis=-1), bound)
            continue
        # few walks leave along the surface, and their own standard error is not to be trusted
        apart[np.minimum(np.abs(np.cos(theta_i)), np.abs(np.cos(theta_o))) < GRAZING] = 0.0
        noise = ERRORS * np.hypot(there[1], back[1]) + bound * scale
        yield from probe.findings("reciprocity", (apart / noise).max(axis=-1), 1.0, "standard errors over 6")
