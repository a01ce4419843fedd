"""Each further bounce adds light: values rise with the cap, up to 100,000 bounces and to none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from brdftab.errors import ParameterError
from brdftab.models.resolve import Setup, resolve
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "fall of a value where the cap on the bounces is raised, relative"
CAPS = (1, 2, 3, 8, 64, 1000, 100_000, None)


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if subject.spec.shares("max_bounces") else "the model has no cap on its bounces"


def capped(setup: Setup, cap: int | None) -> Setup:
    """Return the setup with another cap."""
    given = {k: v for k, v in setup.parameters.items() if k != "max_bounces"}
    again = resolve(setup.model.name, **given, **({} if cap is None else {"max_bounces": cap}))
    return replace(again, fresnel=setup.fresnel)


def findings(subject: Subject) -> Iterator[Finding]:
    """Compare the values of one cap after the other."""
    for probe in subject.some(3 if subject.fast else 16):
        if probe.stochastic or probe.projected:
            continue
        before = np.zeros(())
        # some trace to a bounce of their own where none is given
        for cap in CAPS if subject.own.uncapped else [c for c in CAPS if c is not None]:
            try:
                setup = capped(probe.setup, cap)
            except ParameterError:
                continue
            values = probe.evaluated(probe.angles, setup)[0]
            fall = (before - values) / np.maximum(np.abs(values), 1e-12)
            bound = 10.0 * probe.tolerance
            yield from probe.findings("caps", fall.max(axis=-1), bound, f"at max_bounces = {cap}")
            before = values
