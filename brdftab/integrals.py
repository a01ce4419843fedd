"""Directional albedo by quadrature over half vectors, where the mirror singularity cancels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab import models
from brdftab.cells import gauss
from brdftab.engine import Engine
from brdftab.errors import ParameterError
from brdftab.evaluation import check_tolerance
from brdftab.models.microfacet.half_vectors import CUTS, reflecting_half_vectors
from brdftab.models.setup import Setup, resolve

Array = NDArray[np.float64]
# in-plane incoming angles (degrees) at which the azimuth of the half vector is split
_TURNS = np.tan(np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 78.0, 84.0, 87.0, 88.5]))
NODES = 10
# nodes a panel by the error asked; the largest error over NDFs, roughnesses .01 to 1 and angles to 89.94 degrees of
# 3, 4, 6 nodes is 2.6e-3, 9e-4, 2.3e-4
FEWER = ((4e-3, 3), (1.5e-3, 4), (4e-4, 6), (1e-5, NODES))
# pairs of directions that are evaluated at once
_AT_ONCE = 1 << 17


def _panels(edges: Array, nodes: int) -> tuple[Array, Array]:
    """Return Gauss nodes and weights of all panels between edges sorted along the last axis."""
    x, w = gauss(nodes)
    width = np.diff(edges)[..., None]
    shape = (*edges.shape[:-1], -1)
    return (edges[..., :-1, None] + width * x).reshape(shape), (width * w).reshape(shape)


def _azimuths(setup: Setup, theta_i: float, phi_i: float, nodes: int) -> tuple[Array, Array]:
    """Return azimuths of the half vector relative to the light, and weights over the full circle."""
    edges = [0.0, 0.5 * math.pi, math.pi]
    ratio = _TURNS / max(math.tan(theta_i), 1e-9)
    for x in ratio[(ratio < 1.0) & (ratio > 0.0)]:
        edges += [math.acos(x), math.acos(-x)]
    if setup.isotropic:
        angle, weight = _panels(np.unique(edges), nodes)
        return angle, 2.0 * weight
    edges += [2.0 * math.pi - e for e in edges]
    small = min(setup.alpha_x, setup.alpha_y) / max(setup.alpha_x, setup.alpha_y)
    # the lobe's share of an azimuth falls like 1/(small^2 + turn^2)
    turns = [0.0, *(0.5 * small * 2.0 ** np.arange(max(4, math.ceil(math.log2(2.0 / small)))))]
    for quarter in range(4):
        axis = quarter * 0.5 * math.pi - phi_i
        for turn in turns:
            edges += [(axis + math.atan(turn)) % (2.0 * math.pi), (axis - math.atan(turn)) % (2.0 * math.pi)]
    return _panels(np.unique(np.round(edges, 12)), nodes)


def half_vector_nodes(setup: Setup, theta_i: float, phi_i: float, nodes: int) -> tuple[Array, Array, Array]:
    """Return theta_o, phi and weights with sum(f weights) = the albedo: d omega_o = 4 (i.h) d omega_h."""
    azimuth, weight_a = _azimuths(setup, theta_i, phi_i, nodes)
    # flat facets leave no peak to resolve, and diffusers have the width 1
    rough = setup.alpha_x > 0.0
    alpha = max(setup.alpha_x, setup.alpha_y) if rough else 1.0
    least = min(setup.alpha_x, setup.alpha_y) if rough else 1.0
    scales = np.arctan(least * 2.0 ** np.arange(-2.0, 2.0 + math.ceil(math.log2(8.0 * max(alpha, 1.0) / least))))
    x, w = gauss(nodes)
    found = np.empty((3, azimuth.size * (scales.size + CUTS.size + 1) * nodes))
    count = reflecting_half_vectors(theta_i, azimuth, weight_a, scales, x, w, found)
    return found[0, :count], found[1, :count], found[2, :count]


def nodes_for(tolerance: float) -> int:
    """Return the nodes a panel that an error asked of an albedo takes."""
    return next((nodes for least, nodes in FEWER if tolerance > least), 2 * NODES)


def many(engine: Engine, theta_i: Array, nodes: int) -> Array:
    """Return the directional albedos (N, C) of an isotropic setup at polar angles (N,), many of them at once."""
    module = models.kernel(engine.setup.model.name)
    if engine.layers > 1 or hasattr(module, "albedo") or hasattr(module, "smooth_albedo"):
        return np.array([directional(engine, float(t), 0.0, nodes)[0] for t in theta_i])
    found = np.empty((theta_i.size, len(engine.setup.channels)))
    waiting: list[tuple[int, Array, Array, Array]] = []
    for number, angle in enumerate(theta_i):
        waiting.append((number, *half_vector_nodes(engine.setup, float(angle), 0.0, nodes)))
        if number == theta_i.size - 1 or sum(w[1].size for w in waiting) > _AT_ONCE:
            lights = np.concatenate([np.full_like(to, theta_i[n]) for n, to, _, _ in waiting])
            to, phi, weight = (np.concatenate([w[k] for w in waiting]) for k in (1, 2, 3))
            parts = weight[:, None] * engine.points(lights, to, phi, np.zeros_like(to))[:, 0]
            start = 0
            for n, own, _, _ in waiting:
                found[n] = parts[start : start + own.size].sum(axis=0)
                start += own.size
            waiting = []
    return found


def directional(engine: Engine, theta_i: float, phi_i: float = 0.0, nodes: int = NODES) -> Array:
    """Return the directional albedo (P, C) of an engine's setup at one incoming direction, radians.

    Where a model integrates itself, that is taken; where it does so with its smooth part, only the highlights are left
    to half vectors.
    """
    module = models.kernel(engine.setup.model.name)
    if hasattr(module, "albedo"):
        own = module.albedo(engine.setup, np.array([theta_i]), phi_i, engine.tolerance)
        if own is not None:
            return own
    theta_o, phi, weight = half_vector_nodes(engine.setup, theta_i, phi_i, nodes)
    if engine.layers == 1 and hasattr(module, "smooth_albedo"):
        smooth = module.smooth_albedo(engine.setup, theta_i, phi_i, engine.tolerance)
        if smooth is not None:
            pairs = (np.full_like(theta_o, theta_i), theta_o, phi, np.full_like(theta_o, phi_i))
            return (weight @ module.specular_points(engine.setup, *pairs, engine.tolerance) + smooth)[None]
    values = engine.points(np.full_like(theta_o, theta_i), theta_o, phi, np.full_like(theta_o, phi_i))
    return np.einsum("n,npc->pc", weight, values)


def albedo(model: str, theta_i: ArrayLike, *, phi_i: float = 0.0, tolerance: float = 1e-4, **parameters: Any) -> Array:
    """Integrate f cos(theta_o) over all outgoing directions.

    Parameters
    ----------
    model : str
        Registry name.
    theta_i : array_like
        Polar angles of the light, radians in [0, pi/2).
    phi_i : float, optional
        Azimuth of the light, radians; matters for anisotropic surfaces only.
    tolerance : float, optional
        Relative error asked; 1e-5 and below doubles the nodes.
    **parameters
        Parameters of the model by name.

    Returns
    -------
    ndarray (..., C)
        Directional albedo, a channel each; by reciprocity also the reflectance for uniform illumination.

    Raises
    ------
    ParameterError
        If a parameter is unknown or out of range, or theta_i lies at or below the horizon.
    """
    setup = resolve(model, **parameters)
    asked = check_tolerance(tolerance)
    angles = np.asarray(theta_i, dtype=np.float64)
    bad = ~((angles >= 0.0) & (angles < 0.5 * math.pi))
    if bad.any():
        shown = f"{math.degrees(angles[bad].flat[0]):g} degrees"
        raise ParameterError.out_of_range("theta_i", shown, "[0, 90) degrees", "the light stands above the horizon")
    engine = Engine(setup, asked)
    nodes = NODES if asked > 1e-5 else 2 * NODES
    values = [directional(engine, float(t), phi_i, nodes)[0] for t in angles.reshape(-1)]
    return np.reshape(values, (*angles.shape, len(setup.channels)))
