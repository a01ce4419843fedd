"""The narrowest lobe that data can see: a spike that no direction lies in costs nothing and means nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brdftab.fit.data import Dataset
from brdftab.fit.parameters import Sum, is_roughness
from brdftab.typing import Array

# directions that a lobe is seen by, with facets of half to twice its roughness as slope
FEWEST, SPAN = 8, 2.0
# steps of the roughness, each by 2 %
STEP = 1.02


def slopes(points: Dataset) -> Array:
    """Return the slope (N,) of the facets that mirror the light into the view, tan(theta_h)."""
    si, so = np.sin(points.theta_i), np.sin(points.theta_o)
    across = np.hypot(si + so * np.cos(points.phi), so * np.sin(points.phi))
    slope: Array = across / (np.cos(points.theta_i) + np.cos(points.theta_o))
    return slope


def narrowest(slope: Array, low: float, high: float, fewest: int = FEWEST) -> float:
    """Return the least roughness from `low` to `high` that enough directions see; `low` where none does.

    Parameters
    ----------
    slope : ndarray (N,)
        From `slopes`.
    low, high : float
        Bounds of the roughness, above 0.
    fewest : int, optional
        How many directions are enough.
    """
    tried = low * STEP ** np.arange(max(int(np.log(high / low) / np.log(STEP)), 0) + 1)
    ordered = np.sort(slope)
    seen = np.searchsorted(ordered, SPAN * tried, "right") - np.searchsorted(ordered, tried / SPAN, "left")
    enough = np.flatnonzero(seen >= fewest)
    return float(tried[enough[0]]) if enough.size else low


def least_roughness(total: Sum) -> dict[str, float]:
    """Return the lower bounds of the roughnesses that are fitted, by name."""
    return {v.name: v.low for v in total.variables if is_roughness(total.terms[v.term].model, v.param)}


def resolved(total: Sum, points: Dataset) -> Sum:
    """Return the sum with roughnesses that reach no further down than the points see."""
    least = least_roughness(total)
    slope = slopes(points) if least else np.zeros(0)
    found = [replace(v, low=narrowest(slope, v.low, v.high)) if v.name in least else v for v in total.variables]
    return replace(total, variables=tuple(found))
