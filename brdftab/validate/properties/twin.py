"""The JAX twin gives the kernel's values."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from brdftab.models import twins
from brdftab.validate import differences, sweep
from brdftab.validate.angles import Angles, directions
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Probe, Subject

MEANING = "difference between twin and kernel, relative"
# Beckmann's exp(-e) with e up to 700 carries e times the rounding of e: 4e-12 measured
PARITY = 1e-11
# below this (1/sr) exp underflows
FLOOR = 1e-250
COUNT = 120
TOLERANCE, NODES_TOLERANCE = 1e-9, 1e-2


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if subject.has_twin else "the model has no twin"


@contextlib.contextmanager
def quick_compilation() -> Iterator[None]:
    """Compile JAX programs without most optimisations: many variants, few values."""
    import jax

    jax.config.update("jax_disable_most_optimizations", True)
    try:
        yield
    finally:
        jax.config.update("jax_disable_most_optimizations", False)


def chosen(subject: Subject) -> list[sweep.Variant]:
    """Return the variants to compile: all choices once, or one of them."""
    found = sweep.variants(subject.model, pairs=False)
    most = subject.count(subject.own.variants, 1, len(found))
    return found[:most]


def tolerance_of(subject: Subject) -> float:
    """Return the tolerance at which twin and kernel are compared: few nodes are the same sum as many."""
    coarse = differences.has_nodes(subject.model)
    own = subject.own.twin_tolerance
    return (NODES_TOLERANCE if coarse else TOLERANCE) if own is None else own


def thinned(subject: Subject, angles: Angles) -> Angles:
    """Return the directions, or as many of them as the model's folder says."""
    step = COUNT // (subject.own.twin_directions or COUNT)
    ti, to, phi, az = (np.ascontiguousarray(a[::step]) for a in angles)
    return ti, to, phi, az


def findings(subject: Subject) -> Iterator[Finding]:
    """Compare both over a sweep of the declared parameters."""
    tolerance = tolerance_of(subject)
    with quick_compilation():
        for variant in chosen(subject):
            rng = sweep.seeded(variant)
            listed = sweep.setups(variant, interior=2 if subject.fast else 6)
            for setup, _ in listed[:: subject.own.twin_thin]:
                angles = thinned(subject, directions(setup, rng, COUNT))
                mine = twins.evaluate(setup, *angles, tolerance)
                theirs = differences.kernel_values(setup, angles, tolerance)
                worst = (np.abs(mine - theirs) / (np.abs(theirs) + FLOOR)).max(axis=-1)
                probe = Probe(setup, angles, tolerance)
                yield from probe.findings("twin", worst, PARITY)
