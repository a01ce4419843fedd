"""Whether a fit finds the parameters again: tables made by the kernel, with noise, fitted from scratch."""

from __future__ import annotations

import math

import numpy as np

from brdftab.fit.data import Dataset
from brdftab.fit.parameters import default_free, parse
from brdftab.fit.stages import Options
from brdftab.fit.verdict import fit_points
from brdftab.models.resolve import Setup
from brdftab.validate import differences
from brdftab.validate.angles import Angles

# far below any noise that is put on the data
TOLERANCE = 1e-4


def free_names(setup: Setup, second: str) -> tuple[str, ...]:
    """Return what `brdftab fit` frees of a model by itself, with `second` as its source of reflectance."""
    model = setup.model
    return (*(n for n in default_free(model, {}) if n not in model.of_role("optics")), second)


def recovery_error(setup: Setup, second: str, angles: Angles, noise: float, draws: int, seed: int = 0) -> float:
    """Fit noisy data of known parameters and return how far off the worst parameter is.

    The fit knows the choices (distribution, cavity) and nothing else: its starts do not depend on the truth.

    Parameters
    ----------
    setup : Setup
        One channel, isotropic.
    second : {"ior", "f0"}
        Source of reflectance, free beside the roughness.
    angles : tuple of ndarray (N,)
        theta_i, theta_o, phi and phi_i of the data, radians.
    noise : float
        Standard deviation of the logarithm of the data.
    draws : int
        How often the noise is drawn.
    seed : int, optional
        Of noise and starts.

    Returns
    -------
    float
        The largest over the parameters of the root mean square over the draws of the relative error.
    """
    names = free_names(setup, second)
    given = {k: v for k, v in setup.parameters.items() if v is not None and setup.model.param(k).kind == "choice"}
    total = parse(setup.model.name, names, {k: v for k, v in given.items() if setup.model.param(k).role != "optics"})
    exact = differences.kernel_values(setup, angles, TOLERANCE)[:, :1]
    valid = exact > 0.0
    truth = {n: setup.parameters[n] for n in names}
    squares = dict.fromkeys(names, 0.0)
    for draw in range(draws):
        rng = np.random.default_rng((seed, draw))
        values = exact * np.exp(noise * rng.standard_normal(exact.shape))
        points = Dataset(*angles[:3], values, valid, ("L",), {}, np.zeros_like(valid), "given", setup.model.name)
        found = fit_points(total, points, Options(seed=seed)).values
        for n in names:
            squares[n] += float(np.ravel(found[n])[0] / np.ravel(truth[n])[0] - 1.0) ** 2
    return math.sqrt(max(squares.values()) / draws)
