"""The twin's derivatives are finite everywhere and those of the kernel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.materials.fresnel import CONDUCTOR
from brdftab.models import twins
from brdftab.models._shared.twin.static import WEIGHTS
from brdftab.models.resolve import Setup
from brdftab.typing import Array
from brdftab.validate import differences, sweep
from brdftab.validate.angles import directions
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Probe, Subject
from brdftab.validate.properties.twin import COUNT, FLOOR, chosen, quick_compilation, thinned, tolerance_of

MEANING = "difference to extrapolated differences of the kernel, over ten times their own error"
# multiples of the differences' own error, and of (|f'| + |f|/x)
SPREADS, GRADIENT = 10.0, 1e-9
# nodes that cross a kink with the roughness bend the sum: so many directions may be off there
KINKED = 0.02


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if subject.has_twin else "the model has no twin"


def numbers(setup: Setup) -> dict[str, int]:
    """Return the names that a twin can be differentiated by and how many entries each has."""
    _, params = twins.split(setup)
    return {k: v.size for k, v in params.items() if k != WEIGHTS and not (k == "alpha_y" and setup.isotropic)}


def resolved(subject: Subject, setup: Setup) -> bool:
    """Tell whether values meet the tolerance here: a model may name a range of conductors in which they do not."""
    ranges, fresnel = subject.own.unresolved, setup.fresnel
    if ranges is None or fresnel is None or fresnel.kind != CONDUCTOR:
        return True
    inside = [(low <= getattr(fresnel, n)) & (getattr(fresnel, n) <= high) for n, (low, high) in ranges.items()]
    return not bool(np.logical_and.reduce(inside).any())


def wrong(setup: Setup, name: str, channel: int, probe: Probe, slope: Array, kinked: bool) -> Array | None:
    """Return how far derivatives are off (N,), in multiples of what the differences can tell; None at a bound."""
    reach = 1e-3 if kinked else 0.02
    found = differences.differences(setup, name, channel, probe.angles, probe.tolerance, reach)
    if found is None:
        return None
    expected, spread, _ = found
    value = np.abs(differences.kernel_values(setup, probe.angles, probe.tolerance))
    scale = np.abs(expected) + value / abs(differences.entry(setup, name, channel)) + FLOOR
    off = (np.abs(slope - expected) / (SPREADS * spread + GRADIENT * scale)).max(axis=-1)
    if kinked:
        off[np.argsort(-off)[: int(KINKED * off.size)]] = 0.0
    return off


def findings(subject: Subject) -> Iterator[Finding]:
    """Differentiate by every number over a sweep; at its bounds derivatives need only be finite."""
    tolerance, kinked = tolerance_of(subject), differences.has_nodes(subject.model)
    with quick_compilation():
        for variant in chosen(subject):
            rng = sweep.seeded(variant)
            listed = sweep.setups(variant, interior=1 if subject.fast else 3)
            for setup, is_corner in listed[:: subject.own.twin_thin]:
                probe = Probe(setup, thinned(subject, directions(setup, rng, COUNT)), tolerance)
                sure = resolved(subject, setup)
                for name, size in numbers(setup).items():
                    channel = int(rng.integers(size))
                    slope = twins.derivative(setup, name, *probe.angles, tolerance, channel=channel)
                    lost = np.where(np.isfinite(slope).all(axis=-1), 0.0, np.inf)
                    off = None if is_corner or not sure else wrong(setup, name, channel, probe, slope, kinked)
                    total = lost if off is None else np.maximum(lost, off)
                    yield from probe.findings("gradient", total, 1.0, f"d f/d {name}")
