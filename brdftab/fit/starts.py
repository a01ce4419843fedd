"""Where solves start from: a seeded, low-discrepancy spread over plausible values, albedos guessed from the data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import ParameterError
from brdftab.fit.parameters import Sum, Variable
from brdftab.models.declaration import Model
from brdftab.typing import Array

# ranges that real surfaces fill, by role; of an albedo as a share of what the data suggest, of a tilt in radians
RANGES = {"roughness": (0.004, 1.0), "tilt": (0.05, 0.9), "albedo": (0.3, 1.2)}


def guess_albedo(values: NDArray[np.float64], valid: NDArray[np.bool_]) -> Array:
    """Return (C,) guesses of kd: pi times a low quantile of each channel, where the peak does not reach."""
    found = []
    for c in range(values.shape[1]):
        good = values[valid[:, c] & (values[:, c] > 0.0), c]
        found.append(np.pi * np.quantile(good, 0.4) if good.size else 0.1)
    return np.clip(np.array(found), 1e-4, 0.98)


def _range(variable: Variable, model: Model) -> tuple[float, float]:
    """Return the range in which a parameter starts, inside its bounds."""
    param = model.param(variable.param)
    low, high = param.start or RANGES.get(param.role, (variable.low, variable.high))
    low, high = max(low, variable.low), min(high, variable.high)
    return (low, high) if low < high else (variable.low, variable.high)


def spread(total: Sum, albedo: Array, count: int, seed: int, given: Mapping[str, Any]) -> Array:
    """Return start vectors (S, n).

    Parameters
    ----------
    total : Sum
        What is fitted.
    albedo : ndarray (C,)
        From `guess_albedo`.
    count : int
        How many starts, at least 1.
    seed : int
        Shifts the sequence.
    given : mapping
        Start values of the user by name; they hold in every start.

    Raises
    ------
    ParameterError
        If a given name is not free, or its value out of range.
    """
    channels = len(albedo)
    names = {v.name for v in total.variables}
    for name in given:
        if name not in names:
            raise ParameterError(f"start = {name} is not free; free are {', '.join(sorted(names))}")
    # Kronecker sequence with the generalised golden ratio (Roberts 2018): even in every projection
    ratio = 2.0
    for _ in range(40):
        ratio = (1.0 + ratio) ** (1.0 / (len(total.variables) + 1.0))
    shift = np.random.default_rng(seed).random(len(total.variables)) if seed else np.full(len(total.variables), 0.5)
    starts = []
    for n in range(count):
        unit = (shift + (n + 1.0) * ratio ** -(1.0 + np.arange(len(total.variables)))) % 1.0
        values: dict[str, Any] = {}
        for variable, u in zip(total.variables, unit, strict=True):
            if variable.name in given:
                values[variable.name] = _checked(variable, given[variable.name])
                continue
            model = total.terms[variable.term].model
            low, high = _range(variable, model)
            if model.param(variable.param).role == "albedo":
                values[variable.name] = np.clip(
                    albedo * (low + u * (high - low)), variable.low + 1e-6, variable.high - 1e-3
                )
            elif variable.log or low > 0.0:
                values[variable.name] = low * (high / low) ** u
            else:
                values[variable.name] = low + u * (high - low)
        starts.append(total.pack(values, channels))
    return np.array(starts)


def _checked(variable: Variable, value: Any) -> Any:
    """Return a start value of the user inside the bounds."""
    number = np.asarray(value, dtype=np.float64)
    if not np.isfinite(number).all() or (number < variable.low).any() or (number > variable.high).any():
        raise ParameterError.out_of_range(
            f"start {variable.name}", value, f"[{variable.low:g}, {variable.high:g}]", "give a value inside the bounds"
        )
    return number if variable.channels else float(number)
