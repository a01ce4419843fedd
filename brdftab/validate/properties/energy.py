"""No surface returns more light than it gets."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.evaluation.albedo import NODES, directional
from brdftab.evaluation.engine import Engine
from brdftab.models.resolve import Setup, resolve
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Probe, Subject

MEANING = "directional albedo above 1"
# what the quadrature of the albedo promises
QUADRATURE = 3e-4
TOLERANCE = 1e-4
LIGHTS = (0.0, 45.0, 80.0, 89.0)
AZIMUTH = 0.4


def brightest(setup: Setup) -> Setup:
    """Return the setup with a white body, where it has one: at other albedos less comes back."""
    if not setup.model.shares("kd"):
        return setup
    bounds = setup.model.param("kd").bounds
    assert bounds is not None
    return resolve(setup.model.name, **{**setup.parameters, "kd": bounds[1]})


def albedos(setup: Setup, tolerance: float, few: bool = False) -> list[tuple[float, float, np.ndarray]]:
    """Return (theta_i, phi_i, albedo (C,)) for the fixed lights, radians.

    With a grain there are lights along it, too, and where the surface transmits also from below; with `few` there is
    one alone on each side.
    """
    engine = Engine(setup, max(tolerance, TOLERANCE))
    azimuths = (AZIMUTH, 0.0) if setup.model.grain else (AZIMUTH,)
    lights = LIGHTS[2:3] if few else LIGHTS
    if setup.transmits:
        lights = (*lights, *(180.0 - angle for angle in lights))
    return [(float(t), a, directional(engine, float(t), a)[0]) for t in np.radians(lights) for a in azimuths]


def _chosen(subject: Subject) -> list[Probe]:
    """Return a choice of the probes, and those at a bound of a parameter whose meaning the model alone knows."""
    own = {p.name: p.bounds for p in subject.spec.params if not p.role and p.kind in ("float", "channels") and p.bounds}
    some = subject.some(5 if subject.fast else 40)
    at_bound = [
        probe
        for probe in subject.probes
        if any(np.isin(probe.setup.parameters.get(name) or 0.0, ends).any() for name, ends in own.items())
    ]
    return some + [probe for probe in at_bound if probe not in some]


def findings(subject: Subject) -> Iterator[Finding]:
    """Integrate the albedo at four lights for a choice of the settings."""
    for probe in _chosen(subject):
        if probe.projected:
            continue
        setup = brightest(probe.setup)
        for theta, azimuth, albedo in albedos(setup, probe.tolerance, subject.is_expensive(setup)):
            over = float(albedo.max()) - 1.0
            where = (theta, theta, np.pi, azimuth)
            bound = QUADRATURE
            if over > bound:
                # a quadrature of few nodes may exceed, too: 1.2e-3 in V-grooves of roughness 10
                engine = Engine(setup, max(probe.tolerance, TOLERANCE))
                over = float(directional(engine, theta, azimuth, 2 * NODES)[0].max()) - 1.0
            yield Finding("energy", probe.model, over, bound, setup.parameters, where, "albedo at theta_i")
