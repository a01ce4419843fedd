"""Swapping light and view changes nothing but the square of the refractive index, of models that say so."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.models.resolve import Setup
from brdftab.typing import Array
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = (
    "difference to the swapped pair, relative, f/n_o^2 through interfaces; of estimators in standard errors over 6"
)
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


def between(setup: Setup, theta_i: Array, theta_o: Array) -> Array:
    """Return n_o^2/n_i^2 (N, C) or (N, 1): radiance is denser where light moves slower (Veach 1997, Eq. 5.13)."""
    ones = np.ones((theta_i.size, 1))
    if not setup.transmits or setup.fresnel is None:
        return ones
    n = [np.where(np.cos(theta)[:, None] < 0.0, setup.fresnel.a, 1.0) for theta in (theta_i, theta_o)]
    return (n[1] / n[0]) ** 2


def rounding(setup: Setup) -> float:
    """Return what the rounding of a slope costs where it is divided by the smaller roughness, relative."""
    alpha = min(setup.alpha_x, setup.alpha_y)
    return float(np.finfo(float).eps) / alpha if alpha > 0.0 else 0.0


def findings(subject: Subject) -> Iterator[Finding]:
    """Compare every pair of directions with its swapped one."""
    for probe in subject.probes:
        theta_i, theta_o, phi, phi_i = probe.angles
        swapped = (theta_o, theta_i, -phi, phi_i + phi)
        denser = between(probe.setup, theta_i, theta_o)
        there, back = probe.estimate, tuple(denser * a for a in probe.evaluated(swapped))
        apart = np.abs(there[0] - back[0])
        scale = np.maximum(np.maximum(np.abs(there[0]), np.abs(back[0])).max(axis=-1, keepdims=True), DARK)
        if not probe.stochastic:
            bound = max(subject.own.reciprocity or ROUNDING, rounding(probe.setup))
            yield from probe.findings("reciprocity", (apart / scale).max(axis=-1), bound)
            continue
        # few walks leave along the surface, and their own standard error is not to be trusted
        apart[np.minimum(np.abs(np.cos(theta_i)), np.abs(np.cos(theta_o))) < GRAZING] = 0.0
        noise = ERRORS * np.hypot(there[1], back[1]) + ROUNDING * scale
        yield from probe.findings("reciprocity", (apart / noise).max(axis=-1), 1.0, "standard errors over 6")
