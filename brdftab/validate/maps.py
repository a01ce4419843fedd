"""A map of how stiff a fit is, and how well it can recover, over roughness and index (or reflectance)."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.drawing import figure
from brdftab.errors import ParameterError
from brdftab.models import Model, spec
from brdftab.models.setup import resolve
from brdftab.validate import condition
from brdftab.validate.probe import Subject
from brdftab.validate.properties.twin import quick_compilation, tolerance_of

Array = NDArray[np.float64]
ROUGHNESS, STEPS = (0.05, 1.0), (10, 9)
SECOND = {"ior": (1.05, 3.0), "f0": (0.02, 0.95)}
# relative noise of the data whose effect on the parameters is drawn
NOISE = 0.01


@dataclass(frozen=True)
class ConditionMap:
    """Condition and recovery over a grid.

    Attributes
    ----------
    model, second : str
        Registry name, and the parameter beside the roughness.
    roughness, other : ndarray (R,), (S,)
        Positions of the grid.
    scaled : ndarray (R, S)
        Condition number of the scaled Jacobian with the log residual.
    recovery : ndarray (R, S)
        Largest relative standard error of a parameter for `NOISE` in the data, to first order.
    """

    model: str
    second: str
    roughness: Array
    other: Array
    scaled: Array
    recovery: Array


def _within(declared: Model, name: str, wanted: tuple[float, float]) -> tuple[float, float]:
    """Return a range, cut to the bounds of a parameter."""
    bounds = declared.param(name).bounds
    assert bounds is not None
    return max(wanted[0], bounds[0]), min(wanted[1], bounds[1])


def condition_map(model: str, steps: tuple[int, int] = STEPS) -> ConditionMap:
    """Compute the map of a model.

    Raises
    ------
    ParameterError
        If the model has no twin, or no roughness with an index or a reflectance beside it.
    """
    declared = spec(model)
    second = next((name for name in ("ior", "f0") if declared.has(name) and not declared.has("material")), "f0")
    if not declared.ndfs or not declared.has(second) or not Subject(model).has_twin:
        raise ParameterError(f"model = {model} has no map of its condition; take one with facets and a twin, as ilm")
    tolerance = tolerance_of(Subject(model))
    rough = np.geomspace(*_within(declared, declared.roughness, ROUGHNESS), steps[0])
    other = np.geomspace(*_within(declared, second, SECOND[second]), steps[1])
    at = condition.fit_directions()
    scaled, recovery = np.empty(steps), np.empty(steps)
    with quick_compilation():
        for r, s in np.ndindex(*steps):
            setup = resolve(model, **{declared.roughness: float(rough[r]), second: float(other[s])})
            matrix = condition.scaled_jacobian(setup, "log", at, tolerance)
            singular = np.linalg.svd(matrix, compute_uv=False)
            scaled[r, s] = singular[0] / singular[-1] if singular[-1] > 0.0 else math.inf
            recovery[r, s] = NOISE * math.sqrt(float(np.diag(np.linalg.pinv(matrix.T @ matrix)).max()))
    return ConditionMap(model, second, rough, other, scaled, recovery)


def draw(found: ConditionMap, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the map as a figure of two panels.

    Raises
    ------
    BrdftabError
        Where matplotlib is missing, the ending is unknown or the file cannot be written.
    """
    rough = spec(found.model).roughness
    panels = (
        (found.scaled, "condition number of the scaled Jacobian, log residual"),
        (100.0 * found.recovery, f"largest standard error at {100.0 * NOISE:g} % noise [%]"),
    )
    with figure(path, (9.0, 3.8), "map", overwrite=overwrite) as picture:
        for axes, (values, title) in zip(picture.subplots(1, 2), panels, strict=True):
            mesh = axes.pcolormesh(found.roughness, found.other, np.log10(values.T), shading="nearest")
            axes.set_xscale("log")
            axes.set_xlabel(rough)
            axes.set_ylabel(found.second)
            axes.set_title(title, fontsize=9)
            bar = picture.colorbar(mesh, ax=axes)
            bar.set_label("log10")
