"""What properties look at: a model's setups with directions, their values computed once, and what the model says."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from brdftab import models
from brdftab.evaluation.points import is_stochastic
from brdftab.models.declaration import Model
from brdftab.models.protocols import Checks
from brdftab.models.resolve import Setup
from brdftab.typing import Array
from brdftab.validate.angles import Angles, both
from brdftab.validate.finding import Finding
from brdftab.validate.settings import setups

TOLERANCE = 1e-6
# failures told of one setup; more say the same
MOST = 24


class Probe:
    """One setup at some directions; values are computed when a property asks, and once.

    Parameters
    ----------
    setup : Setup
        A checked setup.
    angles : tuple of ndarray (N,)
        theta_i, theta_o, phi, phi_i in radians.
    tolerance : float
        Relative error asked of the rules.
    """

    def __init__(self, setup: Setup, angles: Angles, tolerance: float) -> None:
        self.setup, self.angles, self.tolerance = setup, angles, tolerance
        self.model = setup.model.name
        self.stochastic = is_stochastic(setup)

    def evaluated(self, angles: Angles, setup: Setup | None = None) -> tuple[Array, Array]:
        """Return values and standard errors (N, C) at some directions; errors are 0 without noise."""
        chosen, module = setup or self.setup, models.kernel(self.model)
        if self.stochastic:
            found = models.estimator(self.model).estimates(chosen, *angles, orders=0, tolerance=self.tolerance)
            return np.asarray(found.values)[:, 0], np.asarray(found.standard_error).reshape(angles[0].size, -1)
        values = module.points(chosen, *angles, orders=0, tolerance=self.tolerance)[:, 0]
        return values, np.zeros_like(values)

    @property
    def projected(self) -> bool:
        """Tell whether channels are wavelengths projected to RGB, whose values may leave [0, 1] and the positive."""
        fresnel = self.setup.fresnel
        return fresnel is not None and bool((fresnel.weights < 0.0).any())

    @cached_property
    def estimate(self) -> tuple[Array, Array]:
        """Values and standard errors (N, C)."""
        return self.evaluated(self.angles)

    @property
    def values(self) -> Array:
        """Values (N, C) in 1/sr."""
        return self.estimate[0]

    def findings(
        self, prop: str, value: Array, bound: float | Array, detail: Any = "", angles: Angles | None = None
    ) -> Iterator[Finding]:
        """Give one finding for every direction that fails, up to `MOST`, and the worst of those that hold."""
        at = self.angles if angles is None else angles
        value = np.asarray(value, dtype=np.float64)
        allowed = np.broadcast_to(bound, value.shape)
        failing = np.flatnonzero(~(value <= allowed))
        holding = np.flatnonzero(value <= allowed)
        picked = failing[np.argsort(-np.nan_to_num(value[failing], nan=np.inf, posinf=np.inf))][:MOST].tolist()
        if holding.size:
            share = value[holding] / np.where(allowed[holding] > 0.0, allowed[holding], 1.0)
            picked.append(int(holding[np.argmax(share)]))
        for n in picked:
            where = (float(at[0][n]), float(at[1][n]), float(at[2][n]), float(at[3][n]))
            said = detail(n) if callable(detail) else detail
            yield Finding(prop, self.model, float(value[n]), float(allowed[n]), self.setup.parameters, where, said)


@dataclass
class Subject:
    """A model under check.

    Attributes
    ----------
    model : str
        Registry name.
    fast : bool
        Take a choice of the settings and directions.
    example : tuple or None
        A setup with its directions, to look at these alone.
    """

    model: str
    fast: bool = False
    example: tuple[Setup, Angles] | None = None

    @property
    def spec(self) -> Model:
        """The model's declaration."""
        return models.spec(self.model)

    @cached_property
    def own(self) -> Checks:
        """What the model's folder says of its own checks."""
        return models.checks(self.model)

    def count(self, given: Mapping[str, int], fast: int, full: int) -> int:
        """Return what the model's checks give for this extent, or the default for fast or full checks."""
        return given.get("fast" if self.fast else "full", fast if self.fast else full)

    def is_expensive(self, setup: Setup) -> bool:
        """Tell whether one light has to do for albedos of a setup: in fast checks of what has two roughnesses."""
        return self.fast and not (setup.isotropic or setup.model.grain)

    @property
    def tolerance(self) -> float:
        """Relative error at which the model is evaluated."""
        return TOLERANCE if self.own.tolerance is None else self.own.tolerance

    @cached_property
    def setups(self) -> list[Setup]:
        """Default, extremes, and what the model's folder adds."""
        if self.example is not None:
            return [self.example[0]]
        return setups(self.model, fast=self.fast)

    @cached_property
    def probes(self) -> list[Probe]:
        """The setups with their directions, kept so that several properties share the values."""
        if self.example is not None:
            return [Probe(*self.example, self.tolerance)]
        thin = self.count(self.own.directions, 2, 1)
        found = []
        for setup in self.setups:
            seed = zlib.crc32(f"{self.model} {setup.parameters}".encode())
            found.append(Probe(setup, both(setup, seed, thin), self.tolerance))
        return found

    def some(self, count: int) -> list[Probe]:
        """Return about `count` of the probes, evenly chosen, the first among them."""
        step = max(1, -(-len(self.probes) // count))
        return self.probes[::step]

    @property
    def has_twin(self) -> bool:
        """Tell whether the model has a twin."""
        return models.has(self.model, "twin")

    @property
    def has_sampler(self) -> bool:
        """Tell whether the model can be sampled."""
        return models.has(self.model, "sample")
