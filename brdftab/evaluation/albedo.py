"""Directional albedo of a light or a view, by quadrature over half vectors, where the mirror singularity cancels."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.evaluation import delta
from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import check_tolerance
from brdftab.models._shared.facets.half_vectors import CUTS, reflecting_half_vectors
from brdftab.models.protocols import HasAlbedo, HasSmoothAlbedo, HasSplitAlbedo
from brdftab.models.resolve import Setup, resolve
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array

# in-plane incoming angles (degrees) at which the azimuth of the half vector is split
_TURNS = np.tan(np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 78.0, 84.0, 87.0, 88.5]))
NODES = 10
# nodes a panel by the error asked; the largest error over NDFs, roughnesses .01 to 1 and angles to 89.94 degrees of
# 3, 4, 6 nodes is 2.6e-3, 9e-4, 2.3e-4
FEWER = ((4e-3, 3), (1.5e-3, 4), (4e-4, 6), (1e-5, NODES))
# pairs of directions that are evaluated at once
_AT_ONCE = 1 << 17
FIXED = ("light", "view")
PARTS = ("total", "reflected", "transmitted")


def _panels(edges: Array, nodes: int) -> tuple[Array, Array]:
    """Return Gauss nodes and weights of all panels between edges sorted along the last axis."""
    x, w = unit_gauss(nodes)
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
    x, w = unit_gauss(nodes)
    found = np.empty((3, azimuth.size * (scales.size + CUTS.size + 1) * nodes))
    count = reflecting_half_vectors(theta_i, azimuth, weight_a, scales, x, w, found)
    return found[0, :count], found[1, :count], found[2, :count]


def nodes_for(tolerance: float) -> int:
    """Return the nodes a panel that an error asked of an albedo takes."""
    return next((nodes for least, nodes in FEWER if tolerance > least), 2 * NODES)


def finer_tolerance(tolerance: float, share: float) -> float:
    """Return a share of a tolerance, or less where that would take the same nodes and see nothing of their error."""
    asked = share * tolerance
    return min(asked, FEWER[-1][0]) if nodes_for(asked) == nodes_for(tolerance) else asked


def _own(engine: Engine, fixed: str) -> Any:
    """Return the model's kernel module where what it integrates itself serves, else None.

    It does for a fixed light, and for a fixed view where both are the same.
    """
    model = engine.setup.model
    return models.kernel(model.name) if fixed == "light" or model.reciprocal else None


def _points(engine: Engine, fixed: str, ends: Array, theta: Array, phi: Array, azimuth: Array) -> Array:
    """Return f (N, P, C) between fixed ends and directions (theta, phi relative to the end, at absolute azimuths)."""
    if fixed == "light":
        return engine.points(ends, theta, phi, azimuth)
    return engine.points(theta, ends, -phi, azimuth + phi)


def many(engine: Engine, theta: Array, nodes: int, fixed: str = "light") -> Array:
    """Return the directional albedos (N, C) of an isotropic setup at polar angles (N,), many of them at once."""
    module = _own(engine, fixed)
    if engine.layers > 1 or isinstance(module, HasAlbedo | HasSmoothAlbedo):
        return np.array([directional(engine, float(t), 0.0, nodes, fixed)[0] for t in theta])
    found = delta.reflectance(engine.setup, theta)
    waiting: list[tuple[int, Array, Array, Array]] = []
    for number, angle in enumerate(theta):
        waiting.append((number, *half_vector_nodes(engine.setup, float(angle), 0.0, nodes)))
        if number == theta.size - 1 or sum(w[1].size for w in waiting) > _AT_ONCE:
            ends = np.concatenate([np.full_like(other, theta[n]) for n, other, _, _ in waiting])
            other, phi, weight = (np.concatenate([w[k] for w in waiting]) for k in (1, 2, 3))
            parts = weight[:, None] * _points(engine, fixed, ends, other, phi, np.zeros_like(other))[:, 0]
            start = 0
            for n, own, _, _ in waiting:
                found[n] += parts[start : start + own.size].sum(axis=0)
                start += own.size
            waiting = []
    return found


def directional(engine: Engine, theta: float, phi: float = 0.0, nodes: int = NODES, fixed: str = "light") -> Array:
    """Return the directional albedo (P, C) of an engine's setup at one direction of light, or of view, radians.

    Where a model integrates itself, that is taken; where it does so with its smooth part, only the highlights are left
    to half vectors. A delta is part of the first component. Of surfaces that transmit: `split`.
    """
    module = _own(engine, fixed)
    if isinstance(module, HasAlbedo):
        own = module.albedo(engine.setup, np.array([theta]), phi, engine.tolerance)
        if own is not None:
            return own
    other, around, weight = half_vector_nodes(engine.setup, theta, phi, nodes)
    if engine.layers == 1 and isinstance(module, HasSmoothAlbedo):
        smooth = module.smooth_albedo(engine.setup, theta, phi, engine.tolerance)
        if smooth is not None:
            pairs = (np.full_like(other, theta), other, around, np.full_like(other, phi))
            return (weight @ module.specular_points(engine.setup, *pairs, engine.tolerance) + smooth)[None]
    ends = np.full_like(other, theta), other, around, np.full_like(other, phi)
    found: Array = np.einsum("n,npc->pc", weight, _points(engine, fixed, *ends))
    found[0] += delta.reflectance(engine.setup, np.array([theta]))[0]
    return found


def split(setup: Setup, theta: Array, phi: float, tolerance: float, fixed: str = "light") -> tuple[Array, Array]:
    """Return what a surface that transmits reflects and what it transmits, (N, C) each, at polar angles in [0, pi].

    For a fixed view the transmitted part is int f |cos(theta_i)| domega_i over the other side: with
    f(i, o)/n_o^2 = f(o, i)/n_i^2 that of a light there, times (n_o/n_i)^2.
    """
    module = cast(HasSplitAlbedo, models.kernel(setup.model.name))
    reflected, transmitted = module.split_albedo(setup, theta, phi, tolerance)
    if fixed == "light":
        return reflected, transmitted
    assert setup.fresnel is not None
    squared = np.broadcast_to(setup.fresnel.a, reflected.shape[1:]) ** 2
    return reflected, transmitted * np.where((theta > 0.5 * math.pi)[:, None], squared, 1.0 / squared)


def check_fixed(fixed: str) -> str:
    """Return which direction of an albedo is fixed, checked."""
    if fixed not in FIXED:
        raise ParameterError(f"fixed = {fixed} is not known; choose one of {', '.join(FIXED)}")
    return fixed


def _check_angles(setup: Setup, theta: Array) -> None:
    """Refuse directions at the horizon, and below it unless the surface transmits."""
    above = (theta >= 0.0) & (theta < 0.5 * math.pi)
    below = (theta > 0.5 * math.pi) & (theta <= math.pi)
    bad = ~(above | (below & setup.transmits))
    if bad.any():
        shown = f"{math.degrees(theta[bad].flat[0]):g} degrees"
        valid = "[0, 180] degrees without 90" if setup.transmits else "[0, 90) degrees"
        why = "no light grazes" if setup.transmits else "only surfaces that transmit take light from below"
        raise ParameterError.out_of_range("theta_i", shown, valid, why)


def albedo(
    model: str,
    theta_i: ArrayLike,
    *,
    phi_i: float = 0.0,
    fixed: str = "light",
    part: str = "total",
    tolerance: float = 1e-4,
    **parameters: Any,
) -> Array:
    """Integrate f cos over all directions of view, or of light.

    Parameters
    ----------
    model : str
        Registry name.
    theta_i : array_like
        Polar angles of the light (of the view with ``fixed = "view"``), radians in [0, pi/2); of surfaces that transmit
        also in (pi/2, pi], from below.
    phi_i : float, optional
        Its azimuth, radians; matters for anisotropic surfaces only.
    fixed : {"light", "view"}, optional
        "light": int f(i, o) |cos(theta_o)| domega_o, the share of light from i that leaves. "view":
        int f(i, o) |cos(theta_i)| domega_i, the radiance towards o of a surface that is lit evenly by 1 from all sides.
        By reciprocity both are the same number, unless the model is not reciprocal, or the light passes an interface:
        what is transmitted to a view above has 1/n^2 of a light's from there, n^2 below.
    part : {"total", "reflected", "transmitted"}, optional
        Which sides count; the parts of surfaces that transmit only.
    tolerance : float, optional
        Relative error asked; 1e-5 and below doubles the nodes. Models that draw walks: standard error, at least 1e-3.
    **parameters
        Parameters of the model by name.

    Returns
    -------
    ndarray (..., C)
        Directional albedo, a channel each; the mirror reflection of flat interfaces is part of it.

    Raises
    ------
    ParameterError
        If a parameter is unknown or out of range, or theta_i lies at the horizon, or below it where nothing transmits.
    """
    setup = resolve(model, **parameters)
    asked, end = check_tolerance(tolerance), check_fixed(fixed)
    angles = np.asarray(theta_i, dtype=np.float64)
    _check_angles(setup, angles)
    if part not in PARTS:
        raise ParameterError(f"part = {part} is not known; choose one of {', '.join(PARTS)}")
    shape = (*angles.shape, len(setup.channels))
    if setup.transmits and (part != "total" or end == "view"):
        reflected, transmitted = split(setup, angles.reshape(-1), phi_i, asked, end)
        found = {"reflected": reflected, "transmitted": transmitted}.get(part, reflected + transmitted)
        return np.reshape(found, shape)
    if part != "total" and not setup.transmits:
        raise ParameterError(f"part = {part} is of surfaces that transmit, and {model} as given does not; leave it out")
    engine = Engine(setup, asked)
    nodes = NODES if asked > 1e-5 else 2 * NODES
    values = [directional(engine, float(t), phi_i, nodes, end)[0] for t in angles.reshape(-1)]
    return np.reshape(values, shape)
