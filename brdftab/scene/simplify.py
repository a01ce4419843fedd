"""Setups that a scene cannot tell from the given one: fewer channels, wavelengths, bounces, lobes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brdftab.errors import ParameterError
from brdftab.evaluation.points import ORDERS, is_stochastic
from brdftab.materials.fresnel import metal
from brdftab.models.resolve import Setup, resolve
from brdftab.scene.plan import SHARES, Item
from brdftab.scene.scene import Material
from brdftab.scene.test_pairs import EXACT, Probes
from brdftab.tables.storage import equal_channels as equal_in_bits
from brdftab.typing import Array

# a stated error is this many times the largest that was measured on the probes
SAFETY = 3.0


Found = tuple[Setup, Item] | None
Step = Callable[[Setup, Material, Probes, float], Found]


def equal_channels(setup: Setup, material: Material, probes: Probes | None, tolerance: float) -> Found:
    """Give one number for three equal ones."""
    if len(setup.channels) < 2 or material.quantity == "wavelengths":
        return None
    given = dict(setup.parameters)
    for param in setup.model.params:
        value = given.get(param.name)
        if param.kind == "channels" and isinstance(value, list) and len(set(value)) == 1:
            given[param.name] = value[0]
    single = resolve(setup.model.name, **given)
    if len(single.channels) != 1:
        return None
    told = f"{', '.join(setup.channels)} are equal: one channel stands for all"
    return single, Item("channels", told, "exact", size=1.0 - 1.0 / len(setup.channels), time=0.0)


def some_channels(setup: Setup, material: Material, probes: Probes, tolerance: float) -> Found:
    """Store channels once that are equal to others."""
    lists = [
        value
        for param in setup.model.params
        if param.kind == "channels" and isinstance(value := setup.parameters.get(param.name), list)
    ]
    pairs = list(zip(*lists, strict=True)) if len(setup.channels) > 1 else []
    if material.quantity == "luminance" or len(set(pairs)) == len(pairs):
        return None
    values, _ = probes.values(setup, EXACT * tolerance)
    same = equal_in_bits([values], setup.channels)
    if not same:
        return None
    told = ", ".join(f"{name} is equal to {other}" for name, other in same.items())
    return setup, Item("channels", f"{told}: stored once", "exact", size=len(same) / len(setup.channels))


def fewer_wavelengths(setup: Setup, material: Material, probes: Probes | None, tolerance: float) -> Found:
    """Take as few wavelengths behind RGB as the tolerance allows."""
    if setup.fresnel is None or setup.fresnel.spectral_error == 0.0 or material.wavelengths:
        return None
    if not setup.model.shares("material") or "spectral_samples" in setup.parameters:
        return None
    count, allowed = len(setup.fresnel.wavelengths), SHARES["wavelengths"] * tolerance
    for samples in range(3, count):
        error = SAFETY * float(metal(setup.parameters["material"], samples=samples).spectral_error)
        if error <= allowed:
            fewer = resolve(setup.model.name, **{**setup.parameters, "spectral_samples": samples})
            told = f"{samples} wavelengths stand behind the colour instead of {count}"
            return fewer, Item("wavelengths", told, "measured", error, 1.1 * error, time=0.5 * (1.0 - samples / count))
    return None


def fewer_bounces(setup: Setup, material: Material, probes: Probes, tolerance: float) -> Found:
    """Stop after the first bounce order beyond which nothing shows at any angle of the scene."""
    model = setup.model
    if model.components != ("order",) or not model.shares("max_bounces") or setup.max_bounces is not None:
        return None
    parts, _ = probes.values(setup, EXACT * tolerance, ORDERS)
    allowed = SHARES["bounces"] * tolerance

    def left_out(cap: int) -> float:
        return SAFETY * probes.error(parts[:, :cap].sum(axis=1), parts.sum(axis=1))

    if left_out(ORDERS) > allowed:
        return None
    averages = probes.averages(setup, EXACT * tolerance, ORDERS)
    if len(averages):
        parts = np.concatenate([parts, averages])
    for cap in range(1, ORDERS + 1):
        error = left_out(cap)
        if error <= allowed:
            capped = resolve(model.name, **{**setup.parameters, "max_bounces": cap})
            seconds, quick = (probes.cost(s, tolerance) for s in (setup, capped))
            told = f"bounces beyond {cap} do not show between these lights and views"
            saved = max(0.0, 1.0 - quick / max(seconds, 1e-9))
            return capped, Item("bounces", told, "measured", error, 1.1 * error, time=saved)
    return None


def fewer_lobes(setup: Setup, material: Material, probes: Probes, tolerance: float) -> Found:
    """Leave out a lobe whose weight is too small to show."""
    model = setup.model
    if model.components == ("order",) or len(model.components) < 2:
        return None
    reference: Array | None = None
    for name, nothing in ((p.name, p.neutral) for p in model.params):
        value = setup.parameters.get(name)
        if nothing is None or value is None or np.all(np.asarray(value) == nothing):
            continue
        try:
            reduced = resolve(model.name, **{**setup.parameters, name: nothing})
        except ParameterError:
            continue
        if reference is None:
            reference, seconds = probes.values(setup, EXACT * tolerance)
        found, quick = probes.values(reduced, EXACT * tolerance)
        error = SAFETY * probes.error(np.broadcast_to(found[:, 0], reference[:, 0].shape), reference[:, 0])
        if error <= SHARES["lobe"] * tolerance:
            channels = 1.0 - len(reduced.channels) / len(setup.channels)
            told = f"the lobe of {name} = {_short(value)} does not show beside the other"
            saved = max(0.0, 1.0 - quick / max(seconds, 1e-9))
            return reduced, Item("lobe", told, "measured", error, 1.1 * error, time=saved, size=channels)
    return None


def _short(value: Any) -> str:
    return ",".join(f"{v:g}" for v in np.atleast_1d(np.asarray(value, dtype=float)))


STEPS: tuple[Step, ...] = (equal_channels, fewer_wavelengths, fewer_lobes, fewer_bounces, some_channels)


def reduced(setup: Setup, material: Material, probes: Probes, tolerance: float) -> tuple[Setup, list[Item], bool]:
    """Apply all steps.

    Returns
    -------
    Setup
        The reduced one, with its channels as they were.
    list of Item
    bool
        Whether R, G and B are to be added up.
    """
    items: list[Item] = []
    steps = (equal_channels, fewer_wavelengths) if is_stochastic(setup) else STEPS
    for step in steps:
        found = step(setup, material, probes, tolerance)
        if found is not None:
            setup, item = found
            items.append(item)
    summed = material.quantity == "luminance" and setup.channels == ("R", "G", "B")
    if summed:
        items.append(Item("channels", "R, G, B are added up to the luminance Y", "exact", size=2.0 / 3.0))
    return setup, items, summed
