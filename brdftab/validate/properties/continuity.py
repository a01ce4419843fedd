"""Values change without jumps along every direction and parameter, across every switch of formula."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from brdftab.errors import ParameterError
from brdftab.models.resolve import Setup, resolve
from brdftab.typing import Array
from brdftab.validate.finding import ANGLES, Finding
from brdftab.validate.jumps import Jump, jumps
from brdftab.validate.probe import Probe, Subject

MEANING = "jump between neighbouring numbers, relative"
ROUNDING = 1e-9
# lines a coordinate or parameter, and positions along a line
LINES = 3
POSITIONS, STEPS = {True: 257, False: 513}, {True: 49, False: 97}
NEAR_EDGE = 1e-3
FAR = math.radians(88.0)


def base(setup: Setup, count: int) -> list[Array]:
    """Return directions (4, count), seeded: half of them anywhere, half within the highlight."""
    rng = np.random.default_rng(zlib.crc32(str(setup.parameters).encode()))
    ti, to = np.arccos(rng.uniform(math.cos(FAR), 1.0, (2, count)))
    phi, az = rng.uniform(0.0, 2.0 * math.pi, (2, count))
    near = slice(0, count // 2)
    width = min(max(setup.alpha_x, setup.alpha_y), 1.0)
    to[near] = np.clip(ti[near] + 0.5 * width * rng.uniform(-1.0, 1.0, count // 2), 0.02, FAR)
    phi[near] = math.pi + 0.5 * width * rng.uniform(0.1, 1.0, count // 2)
    return [ti, to, phi, az]


def along_direction(probe: Probe, name: str, fast: bool) -> Iterator[tuple[Jump, list[Array]]]:
    """Give the jumps along one angle, with the directions of the lines."""
    at = base(probe.setup, LINES)
    which = ANGLES.index(name)
    span = (NEAR_EDGE, FAR) if name.startswith("theta") else (NEAR_EDGE, 2.0 * math.pi)
    t = np.linspace(*span, POSITIONS[fast])

    def f(positions: Array, line: Any) -> Array:
        angles = [np.ascontiguousarray(a[line]) for a in at]
        angles[which] = np.ascontiguousarray(positions)
        return probe.evaluated((angles[0], angles[1], angles[2], angles[3]))[0].sum(axis=-1)

    lines = np.tile(np.arange(LINES), t.size)
    values = f(np.repeat(t, LINES), lines).reshape(t.size, LINES)
    for jump in jumps(f, t, values):
        yield jump, at


def parameters(setup: Setup) -> list[str]:
    """Return the numbers that a setup was given."""
    spec = setup.model
    return [n for n in setup.parameters if spec.param(n).kind in ("float", "channels") and n != "wavelengths"]


def spaced(setup: Setup, name: str, count: int) -> Array:
    """Return positions across a parameter's bounds, even in the logarithm where they span decades."""
    param = setup.model.param(name)
    assert param.bounds is not None
    low, high = param.bounds
    if low >= 1.0:
        return low + np.geomspace(1e-9, high - low, count)
    if high >= 10.0 or low > 0.0:
        return np.geomspace(max(low, 1e-6), high, count)
    return np.linspace(low, high, count)


def along_parameter(probe: Probe, name: str, fast: bool) -> Iterator[tuple[Jump, list[Array]]]:
    """Give the jumps along one parameter, with the directions of the lines."""
    setup = probe.setup
    at = base(setup, LINES)

    def one(x: float) -> Array:
        given = {**setup.parameters, name: x}
        angles = (at[0], at[1], at[2], at[3])
        return probe.evaluated(angles, resolve(setup.model.name, **given))[0].sum(axis=-1)

    def f(positions: Array, line: Any) -> Array:
        distinct, where = np.unique(positions, return_inverse=True)
        table = np.stack([one(float(x)) for x in distinct])
        return table[where, line]

    found: list[Array] = []
    t: list[float] = []
    for x in spaced(setup, name, STEPS[fast]):
        try:
            found.append(one(float(x)))
        except ParameterError:
            if len(t) > 20:
                break
            found, t = [], []
            continue
        t.append(x)
    if len(t) > 20:
        for jump in jumps(f, np.array(t), np.stack(found)):
            yield jump, at


def _finding(subject: Subject, probe: Probe, name: str, jump: Jump, at: list[Array]) -> Finding:
    """Return a jump as a finding at its upper side."""
    angles = [float(a[jump.line]) for a in at]
    given = dict(probe.setup.parameters)
    if name in ANGLES:
        angles[ANGLES.index(name)] = jump.above
    else:
        given[name] = jump.above
    where = (angles[0], angles[1], angles[2], angles[3])
    # rules of two node counts may differ by the tolerance that was asked
    bound = max(ROUNDING, subject.own.tolerance or 0.0)
    along = (name, jump.below, jump.above)
    return Finding("continuity", subject.model, jump.size, bound, given, where, "", along)


def scans(subject: Subject, probe: Probe) -> Iterator[tuple[str, Callable[..., Iterator[tuple[Jump, list[Array]]]]]]:
    """Give what is varied and how."""
    for name in ANGLES[: 3 if probe.setup.isotropic else 4]:
        yield name, along_direction
    idle = subject.own.no_scan
    for name in parameters(probe.setup):
        if name not in idle:
            yield name, along_parameter


def findings(subject: Subject) -> Iterator[Finding]:
    """Scan lines along each angle and each number of a choice of the settings."""
    count = subject.count(subject.own.scans, 1, 4)
    # wavelengths behind RGB say nothing more, and are expensive to set up
    plain = [probe for probe in subject.probes if not (probe.stochastic or probe.projected)]
    for probe in plain[:: max(1, -(-len(plain) // count))]:
        for name, scan in scans(subject, probe):
            worst: Finding | None = None
            for jump, at in scan(probe, name, subject.fast):
                found = _finding(subject, probe, name, jump, at)
                if not found.holds:
                    yield found
                elif worst is None or found.value > worst.value:
                    worst = found
            if worst is not None:
                yield worst
