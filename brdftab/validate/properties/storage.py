"""A table in float32 holds the numbers of the table in float64."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.evaluation.engine import Engine
from brdftab.typing import Array
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Probe, Subject

MEANING = "difference between float32 and float64, relative"
# one rounding to float32, and one of a sum
ROUNDING = 1.2e-7
# smallest normal number of float32
SMALLEST = 1.2e-38
THETA = np.radians([0.5, 20.0, 50.0, 89.0])
OTHER = np.radians([1.0, 35.0, 70.0, 89.5])
AZIMUTHS = np.radians([0.5, 75.0, 160.0, 179.5])


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "estimates: each run of a table draws its own paths" if subject.probes[0].stochastic else ""


def filled(probe: Probe, dtype: type) -> Array:
    """Return the values (I, O, P, C) of a small grid in one type."""
    engine = Engine(probe.setup, max(probe.tolerance, 1e-6))
    if probe.setup.isotropic:
        out: Array = np.empty((engine.layers, 4, 4, 4, len(probe.setup.channels)), dtype)
        engine.fill(THETA, OTHER, AZIMUTHS, out)
        return out[0]
    listed = [np.stack(np.meshgrid(t, AZIMUTHS[:2], indexing="ij"), -1).reshape(-1, 2) for t in (THETA, OTHER)]
    out = np.empty((engine.layers, 8, 8, len(probe.setup.channels)), dtype)
    engine.fill_azimuths(listed[0], listed[1], out)
    return out[0]


def positions(probe: Probe) -> tuple[Array, Array, Array, Array]:
    """Return the angles of the grid's cells, flat."""
    if probe.setup.isotropic:
        ti, to, phi = (a.reshape(-1) for a in np.meshgrid(THETA, OTHER, AZIMUTHS, indexing="ij"))
        return ti, to, phi, np.zeros_like(ti)
    ti, pi, to, po = (a.reshape(-1) for a in np.meshgrid(THETA, AZIMUTHS[:2], OTHER, AZIMUTHS[:2], indexing="ij"))
    return ti, to, po - pi, pi


def findings(subject: Subject) -> Iterator[Finding]:
    """Fill a small table in both types and compare them."""
    for probe in subject.some(3 if subject.fast else 12):
        if probe.stochastic:
            continue
        long, short = filled(probe, np.float64), filled(probe, np.float32).astype(np.float64)
        apart = np.abs(short - long) / np.maximum(np.abs(long), SMALLEST / ROUNDING)
        worst = apart.reshape(-1, apart.shape[-1]).max(axis=-1)
        yield from probe.findings("storage", worst, ROUNDING, angles=positions(probe))
