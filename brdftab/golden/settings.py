"""Which parameters of a model are held fast, and where its numbers are taken: all from its declaration."""

from __future__ import annotations

import math
import zlib
from typing import Any

import numpy as np

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.evaluation.points import is_stochastic
from brdftab.models.declaration import Model
from brdftab.models.resolve import Setup, resolve
from brdftab.typing import Array

# one of each kind of reflectance: none, a metal by its spectrum, own index, dielectric, Schlick's
REFLECTANCES: dict[str, dict[str, Any]] = {
    "mirror": {"material": "mirror"},
    "metal": {},
    "index": {"eta": [1.5, 0.2], "k": [1.9, 3.5], "wavelengths": [450.0, 650.0]},
    "dielectric": {"ior": 1.5},
    "schlick": {"f0": [0.8, 0.4, 0.1]},
}
INTERFACES: dict[str, dict[str, Any]] = {"dielectric": {"ior": 1.5}, "f0": {"f0": 0.1}}
BODY = [0.8, 0.5, 0.2]
PATHS, SEED = 16, 1
CAP = 2
# pairs of directions: anywhere, by facets of likely slopes, and by facets that tilt across a grain
ANYWHERE, GLOSSY, ACROSS, BELOW = 8, 8, 4, 4
GRAZING = math.radians(89.0)


def _reflectances(spec: Model) -> dict[str, dict[str, Any]]:
    """Return the kinds of reflectance that a model takes, by name."""
    if spec.shares("material"):
        return REFLECTANCES
    if spec.shares("ior"):
        return {name: given for name, given in INTERFACES.items() if spec.shares(next(iter(given)))}
    return {"": {}}


def settings(model: str) -> dict[str, dict[str, Any]]:
    """Return the parameters to hold fast, by a label of words.

    Every distribution with every kind of reflectance; then, each once beside the defaults: unequal roughness with every
    distribution that takes it, every other choice, a body of three channels, and a cap of the bounces.

    Parameters
    ----------
    model : str
        Registry name.

    Returns
    -------
    dict of str to dict
        Parameters as `brdftab.evaluate` takes them (radians), accepted by the model.
    """
    spec = models.spec(model)
    found: dict[str, dict[str, Any]] = {}
    distributions: list[dict[str, Any]] = [{"ndf": n} for n in spec.ndfs] or [{}]
    reflectances = _reflectances(spec)
    plain = next(iter(reflectances.values()))
    for shape in distributions:
        for name, given in reflectances.items():
            found[_label(shape, name)] = {**shape, **given}
        rough = spec.roughness
        if spec.shares(f"{rough}_x"):
            found[_label(shape, "anisotropic")] = {**shape, **plain, f"{rough}_x": 0.3, f"{rough}_y": 0.6}
    for param in spec.params:
        if param.kind == "choice" and param.choices and param.role not in ("roughness", "optics"):
            for word in param.choices:
                if word != param.default:
                    found[f"{param.name} {word}"] = {**plain, param.name: word}
        elif param.role == "bounces" and param.kind == "int":
            found["capped"] = {**plain, param.name: CAP}
        elif param.kind == "channels" and param.role == "albedo":
            found["body in colour"] = {param.name: BODY}
    full = {name: _completed(model, given) for name, given in found.items()}
    return {name: given for name, given in full.items() if given is not None}


def _label(shape: dict[str, Any], name: str) -> str:
    """Put a distribution and a kind of reflectance into words."""
    return " ".join([*map(str, shape.values()), name]).strip() or "default"


def _completed(model: str, given: dict[str, Any]) -> dict[str, Any] | None:
    """Return a setting with the model's cheap ones and, of estimators, few paths; None where the model refuses it."""
    full = {**dict(models.spec(model).golden), **given}
    try:
        setup = resolve(model, **full)
        return {**full, "samples": PATHS, "seed": SEED} if is_stochastic(setup) else full
    except ParameterError:
        return None


def directions(setup: Setup) -> Array:
    """Return (4, N): theta_i, theta_o, phi, phi_i in radians at which a setup's numbers are held fast.

    Corners, pairs anywhere above the surface, and pairs that facets of likely slopes mirror into each other; surfaces
    that transmit are also looked at from below. Seeded by the model's name, none at a mirror direction.
    """
    rng = np.random.default_rng(zlib.crc32(setup.model.name.encode()))
    corners = np.array(
        [
            [0.0, 0.4, 0.0, 0.0],
            [0.6, 0.6, 0.01, 1.0],
            [0.7, 0.69, math.pi, 0.3],
            [GRAZING, 0.5, 2.5, 0.2],
            [0.5, GRAZING, 3.0, 2.0],
            [1.3, 1.2, 3.1, 0.0],
        ]
    ).T
    anywhere = np.stack(
        [
            *np.arccos(rng.uniform(math.cos(GRAZING), 1.0, (2, ANYWHERE))),
            *rng.uniform(0.0, [[math.pi], [2.0 * math.pi]], (2, ANYWHERE)),
        ]
    )
    parts = [corners, anywhere, _mirrored(rng, GLOSSY, 1.0)]
    if setup.model.grain:
        parts.append(_mirrored(rng, ACROSS, 0.05))
    if setup.transmits:
        below = anywhere[:, :BELOW].copy()
        below[1] = math.pi - below[1]
        parts += [below, below[[1, 0, 2, 3]][:, :2]]
    return np.ascontiguousarray(np.concatenate(parts, axis=1))


def _mirrored(rng: np.random.Generator, count: int, along: float) -> Array:
    """Return pairs (4, count) that facets mirror into each other; `along` scales their slopes along azimuth 0."""
    theta, azimuth = rng.uniform(0.1, 1.2, count), rng.uniform(0.0, 2.0 * math.pi, count)
    slope = rng.normal(0.0, 0.25, (2, count)) * np.array([[along], [1.0]])
    half = np.stack([-slope[0], -slope[1], np.ones(count)]) / np.sqrt(1.0 + (slope**2).sum(axis=0))
    light = np.stack([np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)])
    view = 2.0 * (light * half).sum(axis=0) * half - light
    # what a steep facet sends down is looked at along the surface instead
    polar = np.minimum(np.arctan2(np.hypot(view[0], view[1]), view[2]), GRAZING)
    return np.stack([theta, polar, (np.arctan2(view[1], view[0]) - azimuth) % (2.0 * math.pi), azimuth])
