"""A table by Monte Carlo: values with a standard error each, and what they cost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.evaluation.engine import Engine, Progress
from brdftab.models.resolve import Setup
from brdftab.tables.grid import Grid
from brdftab.tabulation.cell_averages import FLOOR
from brdftab.timing import Clock

LAYER = "standard_error"
DEFINITION = (
    "largest standard error of a channel's mean over the cell's largest channel (at least 1e-9/sr), the maximum over "
    "all cells; the layer standard_error holds that of every value"
)


@dataclass(frozen=True)
class Spread:
    """Statistical error of a table.

    Attributes
    ----------
    largest, p95, rms : float
        Relative standard errors over all cells.
    cells : int
        Cells of the table.
    worst : tuple of int
        Index of the worst cell.
    samples : dict
        Paths drawn a cell: least, most, total.
    fixed : bool
        True if the number of paths was given.
    """

    largest: float
    p95: float
    rms: float
    cells: int
    worst: tuple[int, ...]
    samples: dict[str, int]
    fixed: bool

    def to_json(self) -> dict[str, Any]:
        """Return the estimate as plain JSON."""
        return {
            "estimate": self.largest,
            "p95": self.p95,
            "rms": self.rms,
            "cells": self.cells,
            "mirror_cells": 0,
            "worst_cell": list(self.worst),
            "samples": self.samples,
            "definition": DEFINITION,
        }

    @property
    def reason(self) -> str:
        """Say what to change where the tolerance is not met."""
        if self.fixed:
            return f"samples = {self.samples['most']} leaves this much noise; leave --samples out or give more"
        return "noisy cells reached the cap of paths; ask for a looser tolerance, or give --samples"


class Drawn:
    """A finished table of estimates; offers what `attempts.Run` offers."""

    def __init__(self, setup: Setup, grid: Grid, dtype: DTypeLike, tolerance: float, orders: int) -> None:
        self.setup, self.grid, self.orders = setup, grid, orders
        self.dtype, self.tolerance = np.dtype(dtype), tolerance
        self.cells = np.empty((0, len(grid.shape)), dtype=np.int64)
        self.engine = Engine(setup, tolerance, orders, fast=False)
        self.method = str(setup.values.get("estimator", "walk"))
        self.kernel_time = 0.0

    def compute(self, progress: Progress | None) -> Spread:
        """Draw the paths and return how noisy the table is."""
        clock = Clock()
        found = models.estimator(self.setup.model.name).estimate_table(
            self.setup, self.grid.axes, orders=self.orders, tolerance=self.tolerance, progress=progress
        )
        self.kernel_time = clock.seconds
        self.values = found.values.astype(self.dtype, copy=False)
        self.standard_error = found.standard_error.astype(self.dtype, copy=False)
        total = np.abs(found.values.sum(axis=0)).max(axis=-1)
        relative = found.standard_error.max(axis=-1) / np.maximum(total, FLOOR)
        worst = np.unravel_index(int(np.argmax(relative)), relative.shape)
        return Spread(
            largest=float(relative.max()),
            p95=float(np.quantile(relative, 0.95)),
            rms=float(math.sqrt(np.mean(relative * relative))),
            cells=relative.size,
            worst=tuple(int(k) for k in worst),
            samples={
                "least": int(found.samples.min()),
                "most": int(found.samples.max()),
                "total": int(found.samples.sum()),
            },
            fixed=self.setup.values["samples"] is not None,
        )

    @property
    def total(self) -> NDArray[np.floating]:
        """Return the sum over the components."""
        if len(self.values) == 1:
            return self.values[0]
        return self.values.sum(axis=0, dtype=np.float64).astype(self.dtype)


def draw(
    setup: Setup, grid: Grid, dtype: DTypeLike, tolerance: float, orders: int, progress: Progress | None
) -> tuple[Drawn, Spread]:
    """Estimate a table.

    Raises
    ------
    ParameterError
        For cell averages, which take quadrature.
    """
    if grid.cell == "average":
        raise ParameterError(
            f"cell = average is not offered for estimates with noise (model = {setup.model.name}); use cell = center"
        )
    drawn = Drawn(setup, grid, dtype, tolerance, orders)
    return drawn, drawn.compute(progress)
