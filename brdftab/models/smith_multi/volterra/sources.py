"""Modes solved for the sources of light that points and tables ask for."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from brdftab.directions import HORIZON
from brdftab.models._shared.codes import BECKMANN, GGX
from brdftab.models._shared.fresnel.project import thinned
from brdftab.models.resolve import Setup
from brdftab.models.smith_multi.volterra import beckmann, ggx
from brdftab.models.smith_multi.volterra.orders import Orders, orders
from brdftab.models.smith_multi.volterra.panels import mesh
from brdftab.models.smith_multi.volterra.settings import TAIL_DEPTH, Settings
from brdftab.models.smith_multi.volterra.solve import Coefficients, solve

# azimuth modes of a table end here at the latest
MOST_MODES = 2.0**18

# lower elevations are taken as this one for the bounces from two on, radians
LOWEST = 1e-6


def distribution(setup: Setup) -> Any:
    """Return the module of a setup's normal distribution."""
    return ggx if setup.ndf == GGX else beckmann


def elevations(*thetas: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the distinct elevations above the horizon, increasing, and each angle's place among them (-1 below)."""
    every = np.concatenate(thetas)
    above = np.cos(every) > HORIZON
    distinct, inverse = np.unique(0.5 * math.pi - every[above], return_inverse=True)
    place = np.full(every.size, -1, np.int64)
    place[above] = inverse
    return distinct, np.split(place, np.cumsum([t.size for t in thetas])[:-1])


def reached(setup: Setup, setting: Settings, source: np.ndarray) -> np.ndarray:
    """Return the azimuth order that each pair of elevations needs, (T, T)."""
    alpha, raised = setup.alpha_x, np.maximum(source, LOWEST)
    decay = setting.decay(setup.ndf, alpha, float(raised[0]))
    needed = distribution(setup).reach(alpha, raised[:, None], raised[None], decay)
    return np.ascontiguousarray(np.broadcast_to(needed, (source.size, source.size)))


def solved_sources(
    setup: Setup, setting: Settings, source: np.ndarray, layers: int, needed: np.ndarray, largest: float, fitted: Any
) -> tuple[Coefficients, Orders]:
    """Return the modes up to `largest` of all pairs of elevations, and the orders they belong to.

    `needed` is from `reached`; `layers` as in `solve`.
    """
    ndf, alpha = distribution(setup), setup.alpha_x
    raised = np.maximum(source, LOWEST)
    chosen = orders(largest, MOST_MODES, setting.dense, setting.chebyshev(setup.ndf, alpha, float(raised[0])))
    if setup.max_bounces == 1:
        none = np.zeros(chosen.nodes.size, np.int64)
        return Coefficients(np.empty((0, fitted.constant.size, 0)), none, none), chosen
    nodes = mesh(raised, setup.ndf, alpha, setting, lambda beta: ndf.weight(beta, alpha))
    return solve(ndf, nodes, alpha, fitted, chosen, needed, layers, setup.max_bounces), chosen


def fitted_fresnel(setup: Setup, setting: Settings) -> tuple[Any, np.ndarray]:
    """Return the reflectance of the bounces from two on, as the module of the distribution fits it, and its weights."""
    fresnel = thinned(setup, 0.3 * setting.tolerance)
    fitted = distribution(setup).fit(fresnel.kind, fresnel.a, fresnel.b, setting.poles)
    if setup.ndf == BECKMANN:
        fitted = replace(fitted, depth=TAIL_DEPTH)
    return fitted, np.ascontiguousarray(fresnel.weights)
