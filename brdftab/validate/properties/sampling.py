"""Samples follow the density that is stated of them, and their weights average to the albedo."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from brdftab import models
from brdftab.evaluation.albedo import NODES, directional, half_vector_nodes
from brdftab.evaluation.engine import Engine
from brdftab.evaluation.importance_sampling import Samples, pdf, sample
from brdftab.models.protocols import DrawsWalks
from brdftab.models.resolve import Setup
from brdftab.typing import Array
from brdftab.validate.finding import Finding
from brdftab.validate.probe import Subject

MEANING = "distance between samples and quadrature, in standard errors over 5"
LIGHTS = (0.1, 0.9, 1.4)
AZIMUTH = 0.4
ERRORS = 5.0
# relative error of the quadratures beside which the samples' noise is counted
# the rules of V-grooves at 1e-4 leave 1.6e-3 at alpha_y = 10
QUADRATURE = 2e-3
# steps of either angle around a grain
CONES = 512


def reason(subject: Subject) -> str:
    """Say why the property does not apply, if so."""
    return "" if subject.has_sampler else "the model has no sampler"


def features(theta_o: Array, phi: Array, theta_i: float) -> Array:
    """Return smooth test functions (K, n) of the view: moments, and how near it is to the normal and to the mirror.

    All are even in the azimuth, of which quadratures of isotropic surfaces cover one half.
    """
    c, s = np.cos(theta_o), np.sin(theta_o)
    x, y = s * np.cos(phi), s * np.sin(phi)
    near = np.exp(-np.square((theta_o - theta_i) / 0.3))
    return np.stack([np.ones_like(c), c, c * c, x, x * x, y * y, x * c, c**8, near, near * x])


def nodes(setup: Setup, theta_i: float, width: float = math.pi) -> tuple[Array, Array, Array]:
    """Return views, their azimuths relative to the light, and solid angles: half vectors, or cones around the grain.

    Cones are looked at within so much (radians) of the light's own.
    """
    if not setup.model.grain or setup.alpha_x != 1.0:
        theta_o, phi, weight = half_vector_nodes(setup, theta_i, AZIMUTH, NODES)
        return theta_o, phi, weight / np.cos(theta_o)
    # angle along the grain and around it
    mirrored = -math.asin(math.sin(theta_i) * math.cos(AZIMUTH))
    low, high = max(mirrored - width, -0.5 * math.pi), min(mirrored + width, 0.5 * math.pi)
    share = (np.arange(CONES) + 0.5) / CONES
    t, p = (a.reshape(-1) for a in np.meshgrid(low + (high - low) * share, math.pi * (share - 0.5), indexing="ij"))
    azimuth = np.arctan2(np.cos(t) * np.sin(p), np.sin(t))
    return np.arccos(np.cos(t) * np.cos(p)), azimuth - AZIMUTH, np.cos(t) * (high - low) * math.pi / CONES**2


def distances(setup: Setup, theta_i: float, drawn: Samples, width: float = math.pi) -> Iterator[tuple[str, float]]:
    """Give (what, distance in standard errors over 5) of one set of samples."""
    count = drawn.valid.size
    walks = isinstance(models.sampler(setup.model.name), DrawsWalks)
    # wavelengths projected to RGB may leave the gamut
    projected = setup.fresnel is not None and bool((setup.fresnel.weights < 0.0).any())
    if not (np.isfinite(drawn.weight).all() and (projected or (drawn.weight >= 0.0).all())):
        yield "a weight is negative or not finite", math.inf
        return
    expected = directional(Engine(setup, 1e-4), theta_i, AZIMUTH)[0]
    mean, spread = drawn.weight.mean(axis=0), drawn.weight.std(axis=0) / math.sqrt(count)
    room = ERRORS * spread + QUADRATURE * np.maximum(expected, 1e-3)
    yield "mean weight against albedo", float((np.abs(mean - expected) / room).max())
    if walks:
        # the density of whole walks is approximate by declaration
        return
    theta_o, phi, measure = nodes(setup, theta_i, width)
    density = pdf(setup.model.name, theta_i, theta_o, phi, phi_i=AZIMUTH, **setup.parameters)
    integral = features(theta_o, phi, theta_i) @ (density * measure)
    seen = features(drawn.theta_o, drawn.phi_o - AZIMUTH, theta_i) * (drawn.valid & ~drawn.delta)
    noise = ERRORS * seen.std(axis=1) / math.sqrt(count) + QUADRATURE
    yield "moments against the density", float((np.abs(seen.mean(axis=1) - integral) / noise).max())


def findings(subject: Subject) -> Iterator[Finding]:
    """Draw samples at three lights for a choice of the settings."""
    count = 1 << (12 if subject.fast else 14)
    for probe in subject.some(3 if subject.fast else 16):
        for theta in LIGHTS[1:2] if subject.fast else LIGHTS:
            # the seed of estimators has the name of the sampler's own
            given = {k: v for k, v in probe.setup.parameters.items() if k != "seed"}
            drawn = sample(subject.model, theta, count, phi_i=AZIMUTH, seed=1, **given)
            width = probe.setup.values.get(subject.own.cone, math.pi)
            for what, off in distances(probe.setup, theta, drawn, width):
                where = (theta, theta, math.pi, AZIMUTH)
                bound = 1.0
                yield Finding("sampling", subject.model, off, bound, probe.setup.parameters, where, what)
