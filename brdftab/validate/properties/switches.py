"""Where a model says that it changes formula, both formulas give the same number."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from brdftab.models.resolve import Setup, resolve
from brdftab.validate.angles import Angles, directions
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Probe, Subject
from brdftab.validate.settings import Given

MEANING = "jump across a declared switch of formula, relative"
ROUNDING = 1e-9
# values below (1/sr) are compared absolutely
DARK = 1e-9


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if subject.own.switches else "the model declares no switch of formula"


def sides(model: str, given: Given, name: str, at: float) -> tuple[Setup, Setup, float, float]:
    """Return the setups just below and above a value, and both values: neighbours in float64."""
    below, above = float(np.nextafter(at, -np.inf)), float(np.nextafter(at, np.inf))
    return resolve(model, **{**given, name: below}), resolve(model, **{**given, name: above}), below, above


def findings(subject: Subject) -> Iterator[Finding]:
    """Compare both sides of each switch: (words, parameters, name of what crosses it, its value)."""
    for words, given, name, at in subject.own.switches:
        rng = np.random.default_rng(zlib.crc32(words.encode()))
        if name == "tolerance":
            one = other = resolve(subject.model, **given)
            low, high = float(np.nextafter(at, 0.0)), at
        else:
            one, other, low, high = sides(subject.model, given, name, at)
        count = subject.own.switch_directions
        angles = tuple(np.ascontiguousarray(a[-count:]) for a in directions(other, rng))
        where: Angles = (angles[0], angles[1], angles[2], angles[3])
        coarse, fine = (low, high) if name == "tolerance" else (subject.tolerance, subject.tolerance)
        probe = Probe(other, where, fine)
        left, right = Probe(one, where, coarse).values, probe.values
        apart = np.abs(left - right) / np.maximum(np.maximum(np.abs(left), np.abs(right)), DARK)
        # what rules of two tolerances may differ by is the tolerance
        bound = at if name == "tolerance" else ROUNDING
        for found in probe.findings("switches", apart.max(axis=-1), bound, words):
            yield replace(found, along=(name, low, high))
