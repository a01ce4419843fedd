"""Orders one and two without noise, the others by bidirectional paths: for anisotropic surfaces, without a solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brdftab.models._shared.codes import SEPARABLE
from brdftab.models._shared.fresnel.project import arguments, thinned
from brdftab.models._shared.random_walk.layout import vectors
from brdftab.models._shared.random_walk.sampling_plan import PathSampler
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models.resolve import Setup
from brdftab.models.smith_multi.montecarlo import bdpt
from brdftab.models.smith_multi.montecarlo.second import second_bounces
from brdftab.typing import Array

# tightest error of the second bounce relative to the value, which spectral samples do not reach anyway
_TIGHTEST = 1e-8


def path_samplers(setup: Setup, tolerance: float) -> list[PathSampler]:
    """Return how paths are drawn: orders three and above; the second bounce is good to half the tolerance."""
    asked = max(0.5 * tolerance, _TIGHTEST)
    fresnel = thinned(setup, asked)
    term = arguments(fresnel, asked)

    def known(theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        first = evaluate_points(setup, SEPARABLE, theta_i, theta_o, phi, phi_i)
        if setup.max_bounces == 1:
            return first
        i, o = vectors(theta_i, phi_i), vectors(theta_o, phi_i + phi)
        second = np.empty((theta_i.size, fresnel.a.size))
        floor = np.abs(first[:, 0]).max(axis=1)
        second_bounces(setup.ndf, setup.alpha_x, setup.alpha_y, i, o, *term, floor, asked, second)
        return np.concatenate([first, (second @ fresnel.weights)[:, None]], axis=1)

    return [replace(bdpt.path_sampler(setup, tolerance, 3, known), left=asked)]
