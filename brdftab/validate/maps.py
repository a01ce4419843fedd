"""A map of how stiff a fit is, and how well it can recover, over roughness and index (or reflectance)."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brdftab.errors import ParameterError
from brdftab.models import spec
from brdftab.models.declaration import Model
from brdftab.models.resolve import resolve
from brdftab.plotting.figure import figure
from brdftab.typing import Array
from brdftab.validate import condition
from brdftab.validate.probe import Subject
from brdftab.validate.properties.twin import quick_compilation, tolerance_of
from brdftab.validate.recovery import recovery_error

ROUGHNESS, STEPS = (0.05, 1.0), (10, 9)
SECOND = {"ior": (1.05, 3.0), "f0": (0.02, 0.95)}
# relative noise of the data whose effect on the parameters is drawn
NOISE = 0.01
# fits at each position, each with noise of its own
DRAWS = 3


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
    expected : ndarray (R, S)
        Largest relative standard error of a parameter for `NOISE` in the data, to first order.
    recovery : ndarray (R, S)
        Largest relative error of a parameter that fits of such data make: root mean square over `DRAWS`.
    """

    model: str
    second: str
    roughness: Array
    other: Array
    scaled: Array
    expected: Array
    recovery: Array


def _within(declared: Model, name: str, wanted: tuple[float, float]) -> tuple[float, float]:
    """Return a range, cut to the bounds of a parameter."""
    bounds = declared.param(name).bounds
    assert bounds is not None
    return max(wanted[0], bounds[0]), min(wanted[1], bounds[1])


def condition_map(
    model: str, steps: tuple[int, int] = STEPS, progress: Callable[[float], None] | None = None
) -> ConditionMap:
    """Compute the map of a model.

    Parameters
    ----------
    model : str
        Registry name.
    steps : tuple of int, optional
        Positions along roughness and index.
    progress : callable, optional
        Called with the finished share of the work.

    Raises
    ------
    ParameterError
        If the model has no twin, or no roughness with an index or a reflectance beside it.
    """
    declared = spec(model)
    second = next((name for name in ("ior", "f0") if declared.shares(name) and not declared.shares("material")), "f0")
    if not declared.ndfs or not declared.shares(second) or not Subject(model).has_twin:
        raise ParameterError(f"model = {model} has no map of its condition; take one with facets and a twin, as ilm")
    tolerance = tolerance_of(Subject(model))
    rough = np.geomspace(*_within(declared, declared.roughness, ROUGHNESS), steps[0])
    other = np.geomspace(*_within(declared, second, SECOND[second]), steps[1])
    at = condition.fit_directions()
    scaled, expected, recovery = np.empty(steps), np.empty(steps), np.empty(steps)
    with quick_compilation():
        for n, (r, s) in enumerate(np.ndindex(*steps), 1):
            setup = resolve(model, **{declared.roughness: float(rough[r]), second: float(other[s])})
            matrix = condition.scaled_jacobian(setup, "log", at, tolerance)
            singular = np.linalg.svd(matrix, compute_uv=False)
            scaled[r, s] = singular[0] / singular[-1] if singular[-1] > 0.0 else math.inf
            expected[r, s] = NOISE * math.sqrt(float(np.diag(np.linalg.pinv(matrix.T @ matrix)).max()))
            recovery[r, s] = recovery_error(setup, second, at, NOISE, DRAWS)
            if progress is not None:
                progress(n / scaled.size)
    return ConditionMap(model, second, rough, other, scaled, expected, recovery)


def draw(found: ConditionMap, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the map as a figure of three panels; both errors share their colours.

    Raises
    ------
    BrdftabError
        Where matplotlib is missing, the ending is unknown or the file cannot be written.
    """
    rough = spec(found.model).roughness
    told = np.log10([found.expected, found.recovery])
    ends = {"vmin": float(told.min()), "vmax": float(told.max())}
    noise = f"at {100.0 * NOISE:g} % noise"
    panels: tuple[tuple[Array, str, dict[str, float]], ...] = (
        (np.log10(found.scaled), "condition, scaled Jacobian, log residual", {}),
        (told[0], f"largest standard error {noise}, first order", ends),
        (told[1], f"largest error of {DRAWS} fits {noise}", ends),
    )
    with figure(path, (13.0, 3.8), "map", overwrite=overwrite) as picture:
        for axes, (values, title, limits) in zip(picture.subplots(1, 3), panels, strict=True):
            mesh = axes.pcolormesh(found.roughness, found.other, values.T, shading="nearest", **limits)
            axes.set_xscale("log")
            axes.set_xlabel(rough)
            axes.set_ylabel(found.second)
            axes.set_title(title, fontsize=9)
            bar = picture.colorbar(mesh, ax=axes)
            bar.set_label("log10")
