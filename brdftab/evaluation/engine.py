"""How a setup is evaluated in bulk: a model's prepared fast path where it has one, else its points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.evaluation.pace import Pace
from brdftab.models.protocols import Evaluator, HasEvaluator, SolvesJointly
from brdftab.models.resolve import Setup, component_names
from brdftab.typing import Array

Progress = Callable[[float], None]


class Engine:
    """Evaluates one setup on points and product grids.

    Parameters
    ----------
    setup : Setup
        A checked setup.
    tolerance : float
        Relative error asked.
    orders : int
        0 for the total; else the components are kept apart.
    fast : bool
        Allow the model's prepared path.
    trial : bool
        Prepare coarsely, only to compile the kernels.
    """

    def __init__(self, setup: Setup, tolerance: float, orders: int = 0, fast: bool = True, trial: bool = False) -> None:
        self.setup = setup
        self.tolerance = tolerance
        self.orders = orders
        self.layers = len(component_names(setup, orders)) if orders else 1
        self._module = models.kernel(setup.model.name)
        self._prepared: Evaluator | None = None
        self._pace = Pace(steady=isinstance(self._module, SolvesJointly) and self._module.JOINT)
        # pairs of directions evaluated one by one so far
        self.evaluated = 0
        if fast and setup.isotropic and isinstance(self._module, HasEvaluator):
            self._prepared = self._module.prepare(setup, tolerance, orders, trial)

    @property
    def is_fast(self) -> bool:
        """True when the model's prepared path is in use."""
        return self._prepared is not None

    def points(self, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Return (N, P, C) in 1/sr at N pairs of directions, 1-D arrays in radians.

        They are evaluated in blocks of less than half a second.
        """
        angles, parts, count = (theta_i, theta_o, phi, phi_i), [], len(theta_i)
        for block in self._pace.blocks(count):
            parts.append(self._points(*(a[block] for a in angles)))
            self.evaluated += block.stop - block.start
        if not parts:
            return self._points(*angles)
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _points(self, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Evaluate one block."""
        if self._prepared is not None:
            return self._prepared.points(theta_i, theta_o, phi, phi_i)
        return self._module.points(
            self.setup, theta_i, theta_o, phi, phi_i, orders=self.orders, tolerance=self.tolerance
        )

    def fill(
        self, theta_i: Array, theta_o: Array, phi: Array, out: NDArray[np.floating], progress: Progress | None = None
    ) -> None:
        """Fill out (P, I, O, K, C) on an isotropic product grid; identical theta axes are computed half."""
        square = self.setup.model.reciprocal and bool(np.array_equal(theta_i, theta_o))
        if self._prepared is not None:
            self._prepared.fill(theta_i, theta_o, phi, square, out)
            return
        rows, columns, steps = theta_i.size, theta_o.size, phi.size
        first, second = np.tril_indices(rows) if square else np.divmod(np.arange(rows * columns), columns)
        start = 0
        while start < first.size:
            size = max(1, self._pace.size // steps)
            i, o = first[start : start + size], second[start : start + size]
            shape = (i.size, steps)
            angles = (np.broadcast_to(a, shape).reshape(-1) for a in (theta_i[i, None], theta_o[o, None], phi))
            ti, to, ph = (np.ascontiguousarray(a) for a in angles)
            values = self.points(ti, to, ph, np.zeros_like(ti)).reshape(i.size, steps, self.layers, -1)
            values = values.transpose(2, 0, 1, 3)
            out[:, i, o] = values
            if square:
                out[:, o, i] = values
            if progress is not None:
                progress(min(1.0, (start + size) / first.size))
            start += size

    def fill_azimuths(
        self, incoming: Array, outgoing: Array, out: NDArray[np.floating], progress: Progress | None = None
    ) -> None:
        """Fill out (P, N, M, C) for all pairs of listed directions (n, 2) of theta and azimuth.

        Identical lists are computed half.
        """
        square = self.setup.model.reciprocal and bool(np.array_equal(incoming, outgoing))
        rows, columns = len(incoming), len(outgoing)
        # of half a square, row n has n + 1 columns
        pairs = np.cumsum(np.arange(1, rows + 1) if square else np.full(rows, columns))
        start = 0
        while start < rows:
            done = pairs[start - 1] if start else 0
            stop = max(start + 1, int(np.searchsorted(pairs, done + self._pace.size, side="right")))
            a = np.arange(start, stop)
            i, o = np.meshgrid(a, np.arange(a[-1] + 1 if square else columns), indexing="ij")
            kept = o <= i if square else np.ones(i.shape, dtype=bool)
            i, o = i[kept], o[kept]
            ti, az = np.ascontiguousarray(incoming[i, 0]), np.ascontiguousarray(incoming[i, 1])
            to, phi = np.ascontiguousarray(outgoing[o, 0]), outgoing[o, 1] - az
            values = self.points(ti, to, phi, az).transpose(1, 0, 2)
            out[:, i, o] = values
            if square:
                out[:, o, i] = values
            if progress is not None:
                progress(float(pairs[stop - 1] / pairs[-1]))
            start = stop
