"""Estimates at points and on product grids, for any way of drawing paths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from brdftab.directions import HORIZON
from brdftab.models._shared.random_walk.estimates import Draw, Estimates, Progress, Rows, Whole, estimate
from brdftab.models._shared.random_walk.layout import Layout, vectors
from brdftab.models.resolve import Setup, component_names
from brdftab.typing import Array


@dataclass(frozen=True)
class PathSampler:
    """A way of drawing paths, for one or more channels.

    Attributes
    ----------
    draw : callable
        Adds paths to sums, see `estimates.Draw`.
    views : callable
        From unit vectors (M, 3) to what `draw` wants to know of a view, (M, K); column 3 scales its value.
    weights : ndarray (W, C)
        Projection of the wavelengths that the paths carry.
    known : callable
        From theta_i, theta_o, phi, phi_i (m,) to the first components (m, K, C), exact.
    shared : bool
        True where one walk serves all views of a row.
    below : float
        Index below the surface if light passes, else 0.
    left : float
        What a quadrature leaves of the second known component, over the largest channel of all; 0 where all are exact.
    """

    draw: Draw
    views: Callable[[Array], Array]
    weights: Array
    known: Callable[[Array, Array, Array, Array], Array]
    shared: bool
    below: float = 0.0
    left: float = 0.0


def layers(setup: Setup, orders: int) -> int:
    """Return the number of components."""
    return len(component_names(setup, orders)) if orders else 1


def _rows(sampler: PathSampler, angles: tuple[Array, ...], lights: Array, identities: Whole, offsets: Whole) -> Rows:
    """Return cells at `angles` (M,) as rows, dark where light or view are at the horizon or on a side without light."""
    theta_i, theta_o, phi, phi_i = angles
    views = sampler.views(vectors(theta_o, phi_i + phi))
    ci, co = np.cos(theta_i), np.cos(theta_o)
    lit = np.minimum(np.abs(ci), np.abs(co)) > HORIZON if sampler.below else np.minimum(ci, co) > HORIZON
    views[~lit, 3] = 0.0
    return Rows(lights, identities, views, offsets, lambda some: sampler.known(*(a[some] for a in angles)))


def _estimate(
    setup: Setup, sampler: PathSampler, rows: Rows, orders: int, tolerance: float, progress: Progress | None = None
) -> Estimates:
    """Draw a path sampler's cells; the error of the second component holds what its quadrature leaves, too."""
    count = layers(setup, orders)
    found = estimate(sampler.draw, rows, count, sampler.weights, setup.values["samples"], tolerance, progress)
    if sampler.left == 0.0 or count == 1:
        return found
    errors = found.component_errors.copy()
    errors[:, 1] = np.hypot(errors[:, 1], sampler.left * np.abs(found.values.sum(axis=1)).max(axis=1, keepdims=True))
    return replace(found, component_errors=errors)


def _joined(parts: list[Estimates]) -> Estimates:
    """Return estimates of one channel each as one."""
    if len(parts) == 1:
        return parts[0]
    return Estimates(
        np.concatenate([p.values for p in parts], axis=-1),
        np.concatenate([p.standard_error for p in parts], axis=-1),
        np.concatenate([p.component_errors for p in parts], axis=-1),
        np.max([p.samples for p in parts], axis=0),
    )


def _grazing_light(theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> tuple[Array, Array, Array, Array]:
    """Return pairs with light and view exchanged where the view is the more grazing of the two.

    The surface is reciprocal, and walks that start at grazing light have up to 30 times less variance.
    """
    turn = theta_o > theta_i
    phi_o = phi_i + phi
    ends = np.where(turn, theta_o, theta_i), np.where(turn, theta_i, theta_o)
    return *ends, np.where(turn, -phi, phi), np.where(turn, phi_o, phi_i)


def at_points(
    setup: Setup, samplers: list[PathSampler], angles: tuple[Array, ...], orders: int, tolerance: float
) -> Estimates:
    """Estimate at N pairs of directions (radians): values (N, P, C); each point draws paths of its own."""
    if setup.isotropic:
        # only phi counts, and equal phi give equal estimates
        angles = (*angles[:3], np.zeros_like(angles[3]))
    if samplers[0].shared and not samplers[0].below:
        angles = _grazing_light(*angles)
    theta_i, _, _, phi_i = angles
    index = np.arange(len(theta_i) + 1, dtype=np.int64)
    lights = vectors(theta_i, phi_i)
    return _joined(
        [
            _estimate(setup, sampler, _rows(sampler, angles, lights, index[:-1], index), orders, tolerance)
            for sampler in samplers
        ]
    )


def on_grid(
    setup: Setup,
    samplers: list[PathSampler],
    axes: dict[str, Array],
    orders: int,
    tolerance: float,
    progress: Progress | None,
) -> Estimates:
    """Estimate on a product grid, see `layout.Layout`: values (P, *shape, C)."""
    layout = Layout.of(axes)
    angles = layout.angles()
    parts = []
    for number, sampler in enumerate(samplers):
        if sampler.shared:
            lights = vectors(*layout.incoming.T)
            rows = _rows(sampler, angles, lights, np.arange(len(lights), dtype=np.int64), layout.offsets())
        else:
            row, column, step = layout.cells()
            name = (row * len(layout.outgoing) + column) * len(layout.phi) + step
            rows = _rows(sampler, angles, vectors(angles[0], angles[3]), name, np.arange(len(name) + 1, dtype=np.int64))

        def report(share: float, number: int = number) -> None:
            if progress is not None:
                progress((number + share) / len(samplers))

        found = _estimate(setup, sampler, rows, orders, tolerance, report)
        swap = None
        if sampler.below:
            swap = np.where(angles[0] < 0.5 * np.pi, 1.0, sampler.below**2)
            swap /= np.where(angles[1] < 0.5 * np.pi, 1.0, sampler.below**2)
        parts.append(layout.spread(found, swap))
    return _joined(parts)
