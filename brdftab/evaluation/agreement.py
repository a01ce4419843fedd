"""What the error of a value must not be stated below where rules agree: the least that others, which differ, support.

Rules that agree to the last bit, by chance or because both have the same nodes, say nothing of their common error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.typing import Array

# values are compared with tolerances that grow by this factor, up to the loosest that can be asked
COARSER, LOOSEST = 100.0, 0.5


def looser(tolerance: float) -> Iterator[float]:
    """Yield ever looser tolerances than the given one, up to the loosest that can be asked."""
    while tolerance < LOOSEST:
        tolerance = min(COARSER * tolerance, LOOSEST)
        yield tolerance


def least_errors(
    values: Array,
    tolerance: float,
    evaluate: Callable[[NDArray[np.intp], float], Array],
    doubted: NDArray[np.bool_] | None = None,
    scale: ArrayLike | None = None,
) -> Array:
    """Return the least absolute errors to state of values, from rules that are looser and looser until they differ.

    It is the lesser of the loosest tolerance with the same bits and the difference to the next. Where no rule differs
    there is none, and where a value is 0 nothing is compared: both are 0.

    Parameters
    ----------
    values : ndarray (N, P, C)
        What was found at the tolerance.
    tolerance : float
        Error asked, in [1e-14, 0.5].
    evaluate : callable
        From indices (n,) and a tolerance to the values (n, P, C) there.
    doubted : ndarray (N, P) of bool, optional
        Which values to look at; by default all.
    scale : array_like (N, P), optional
        What tolerances are relative to; by default the largest channel of each value.

    Returns
    -------
    ndarray (N, P)
        In the unit of the values.
    """
    size = np.abs(values).max(axis=-1)
    scale = size if scale is None else np.broadcast_to(scale, size.shape)
    waiting = (size > 0.0) if doubted is None else doubted & (size > 0.0)
    found = np.zeros(size.shape)
    for next_one in looser(tolerance):
        at = np.flatnonzero(waiting.any(axis=1))
        if not at.size:
            break
        gap = np.abs(evaluate(at, next_one) - values[at]).max(axis=-1)
        differs = waiting[at] & (gap > 0.0)
        found[at] = np.where(differs, np.minimum(tolerance * scale[at], gap), found[at])
        waiting[at] &= ~differs
        tolerance = next_one
    return found
