"""Where nothing absorbs, all light comes back."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brdftab.errors import ParameterError
from brdftab.models.resolve import resolve
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject
from brdftab.validate.properties.energy import QUADRATURE, albedos
from brdftab.validate.settings import Given, thrifty

MEANING = "distance of the albedo from 1 where F = 1 or nothing absorbs"
ROUGHNESSES = (0.1, 0.5, 1.0)


def furnaces(subject: Subject) -> list[Given]:
    """Return the settings that must return all light: the model's own, else mirrors where all bounces count.

    Those that name no distribution or roughness are taken with several.
    """
    own = subject.own.furnace
    spec = subject.spec
    if own is None:
        own = ({"material": "mirror"},) if spec.multibounce and spec.shares("material") else ()
    if not spec.ndfs:
        return list(own)
    rough = ROUGHNESSES[1:2] if subject.fast else ROUGHNESSES
    found = []
    for given in own:
        ndfs = [given["ndf"]] if "ndf" in given else spec.ndfs
        roughnesses = [given[spec.roughness]] if spec.roughness in given else rough
        found += [{**given, "ndf": ndf, spec.roughness: r} for ndf in ndfs for r in roughnesses]
    return found


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if furnaces(subject) else "the model loses light by design: one bounce, or a fit"


def findings(subject: Subject) -> Iterator[Finding]:
    """Integrate the albedo where it must be 1."""
    for given in furnaces(subject):
        try:
            setup = resolve(subject.model, **thrifty(subject.model, given))
        except ParameterError:
            # a distribution that the choice refuses
            continue
        for theta, azimuth, albedo in albedos(setup, subject.tolerance):
            off = float(np.abs(albedo - 1.0).max())
            where = (theta, theta, np.pi, azimuth)
            bound = QUADRATURE
            yield Finding("furnace", subject.model, off, bound, setup.parameters, where, "albedo at theta_i")
