"""What is held fast of a setup: values, components, albedo, density and weights of samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdftab import models
from brdftab.evaluation import importance_sampling
from brdftab.evaluation.albedo import NODES, directional
from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import ORDERS, is_stochastic
from brdftab.models.resolve import Setup
from brdftab.typing import Array

# what the rules are asked for: coarse ones are the same formulas, and cheap
TOLERANCE = 1e-3
PASSING_TOLERANCE = 1e-2
ALBEDO_ANGLES = (0.3, 1.2)
# Gauss nodes a panel of the albedo's rule where azimuths count one by one, with ten times the panels
NODES_OF_GRAIN = 3
DRAWN, DRAW_ANGLE, DRAW_AZIMUTH = 8, 0.7, 0.4


def tolerance_of(setup: Setup) -> float:
    """Return the relative error asked: looser where light passes the surface, whose solver is the slowest."""
    return PASSING_TOLERANCE if setup.transmits else TOLERANCE


def values(setup: Setup, directions: Array, tolerance: float) -> Array:
    """Return (N, C) in 1/sr by the way that tables take, the prepared one where the model has it."""
    return Engine(setup, tolerance).points(*directions)[:, 0]


def components(setup: Setup, directions: Array, tolerance: float) -> Array:
    """Return (N, P, C) in 1/sr by the kernel itself."""
    return models.kernel(setup.model.name).points(setup, *directions, orders=ORDERS, tolerance=tolerance)


def albedo(setup: Setup, directions: Array, tolerance: float) -> Array | None:
    """Return the directional albedo (2, C) at `ALBEDO_ANGLES`; None of estimates with noise."""
    if is_stochastic(setup):
        return None
    engine = Engine(setup, tolerance)
    nodes = NODES if setup.isotropic else NODES_OF_GRAIN
    return np.array([directional(engine, angle, DRAW_AZIMUTH, nodes)[0] for angle in ALBEDO_ANGLES])


def pdf(setup: Setup, directions: Array, tolerance: float) -> Array:
    """Return the density (N,) of sampling in 1/sr; 0 where a side below the surface is not drawn."""
    return importance_sampling.pdf(setup.model.name, *directions[:3], phi_i=directions[3], **setup.parameters)


def samples(setup: Setup, directions: Array, tolerance: float) -> Array:
    """Return (8, 3 + C): polar angle, azimuth, density and weights of directions drawn with a seed."""
    # the seed here is that of the draw, not that of a model's own estimates
    given = {name: value for name, value in setup.parameters.items() if name != "seed"}
    drawn = importance_sampling.sample(setup.model.name, DRAW_ANGLE, DRAWN, phi_i=DRAW_AZIMUTH, seed=DRAWN, **given)
    held = np.column_stack([drawn.theta_o, drawn.phi_o, drawn.pdf, drawn.weight])
    # where a path ends below the horizon its direction means nothing
    return np.where(drawn.valid[:, None], held, 0.0)


QUANTITIES: dict[str, Callable[[Setup, Array, float], Array | None]] = {
    "values": values,
    "components": components,
    "albedo": albedo,
    "pdf": pdf,
    "samples": samples,
}
