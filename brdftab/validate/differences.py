"""Derivatives of a model's compiled kernel by differences, extrapolated to step 0, with their own error."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from brdftab import models
from brdftab.models.protocols import HasRuleNodes, HasTwinNodes
from brdftab.models.resolve import Setup
from brdftab.typing import Array
from brdftab.validate.angles import Angles

LEVELS = 6


def has_nodes(model: str) -> bool:
    """Tell whether a model's twin sums fixed nodes that follow from the tolerance."""
    return isinstance(models.twin(model), HasRuleNodes)


def kernel_values(setup: Setup, angles: Angles, tolerance: float) -> Array:
    """Return the compiled kernel's values (N, C); a model that integrates does so at the twin's nodes."""
    module = models.kernel(setup.model.name)
    if isinstance(module, HasTwinNodes):
        return module.at_twin_nodes(setup, *angles, tolerance)
    return module.points(setup, *angles, orders=0, tolerance=tolerance)[:, 0]


def _is_roughness(setup: Setup, name: str) -> bool:
    """Tell whether a canonical name is the width of a distribution of facets."""
    return setup.ndf >= 0 and name in ("alpha_x", "alpha_y")


def _is_optical(setup: Setup, name: str) -> bool:
    """Tell whether a canonical name is a number of the reflectance of facets."""
    return setup.fresnel is not None and name in ("a", "b")


def entry(setup: Setup, name: str, channel: int) -> float:
    """Return a number of a setup by its canonical name."""
    if _is_roughness(setup, name):
        return float(getattr(setup, name))
    return float(
        np.atleast_1d(getattr(setup.fresnel, name) if _is_optical(setup, name) else setup.values[name])[channel]
    )


def moved(setup: Setup, name: str, channel: int, value: float) -> Setup:
    """Return the setup with one number replaced, unchecked."""
    if _is_roughness(setup, name):
        both: dict[str, Any] = {"alpha_x": value, "alpha_y": value}
        return replace(setup, **(both if setup.isotropic else {name: both[name]}))
    old = getattr(setup.fresnel, name) if _is_optical(setup, name) else setup.values[name]
    new = np.array(old, dtype=np.float64)
    new[channel if new.ndim else ()] = value
    if _is_optical(setup, name):
        assert setup.fresnel is not None
        changed: dict[str, Any] = {name: new}
        return replace(setup, fresnel=replace(setup.fresnel, **changed))
    return replace(setup, values={**setup.values, name: new if np.ndim(old) else value})


def bounds_of(setup: Setup, name: str) -> tuple[float, float]:
    """Return the declared bounds of a canonical number; an index from f0 is bounded as an index."""
    spec = setup.model
    if _is_roughness(setup, name):
        param = spec.param(spec.roughness)
    elif name == "b" and _is_optical(setup, name):
        param = spec.param("k")
    elif _is_optical(setup, name):
        assert setup.fresnel is not None
        param = spec.param({1: "eta", 2: "ior", 3: "f0"}[setup.fresnel.kind])
    else:
        param = spec.param(name)
    assert param.bounds is not None
    return param.bounds


def differences(
    setup: Setup, name: str, channel: int, angles: Angles, tolerance: float, reach: float = 0.02
) -> tuple[Array, Array, float] | None:
    """Return the kernel's derivative by central differences, extrapolated to step 0, and its estimated error.

    Of the extrapolation table each entry takes the one whose neighbours agree best.

    Returns
    -------
    tuple
        (N, C), (N, C) and the first step; None where the number stands at its bound.
    """
    x = entry(setup, name, channel)
    low, high = bounds_of(setup, name)
    step = min(reach * abs(x), 0.5 * (x - low), 0.5 * (high - x))
    if step <= 1e-6 * abs(x):
        return None
    best = error = np.empty(0)
    previous: list[Array] = []
    for level in range(LEVELS):
        # the step as it is after rounding
        up, down = x + step / 2**level, x - step / 2**level
        values = [kernel_values(moved(setup, name, channel, v), angles, tolerance) for v in (up, down)]
        row = [(values[0] - values[1]) / (up - down)]
        for j, older in enumerate(previous):
            row.append(row[j] + (row[j] - older) / (4.0 ** (j + 1) - 1.0))
            spread = np.maximum(np.abs(row[-1] - row[j]), np.abs(row[-1] - older))
            if not best.size:
                best, error = row[-1], spread
            else:
                best, error = np.where(spread < error, row[-1], best), np.minimum(spread, error)
        previous = row
    return best, error, step
