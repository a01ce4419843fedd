"""Fast isotropic tables with interreflections: the single-bounce table, the cavity's modes, the V-groove's orders."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.models.ilm.interreflection.isotropic import Modes, synthesis
from brdftab.models.ilm.interreflection.points import interpolated, points_specular, specular_setup
from brdftab.models.ilm.interreflection.rule import rule
from brdftab.models.protocols import Evaluator, HasEvaluator
from brdftab.models.resolve import Setup, resolve
from brdftab.typing import Array

Prepare = Callable[[Setup, float, int, bool], Evaluator | None]
# the rule's error in the worst, grazing cells is a few times what it is named after
MARGIN = 0.25
# tighter tolerances are left to direct evaluation: the cavity's own quadratures end near 1e-5
REACH = 1e-5


class CavityEvaluator:
    """One isotropic setup with bounces 2 or inf, ready for points and product grids.

    Parameters
    ----------
    setup : Setup
        Isotropic.
    single : object
        The prepared single bounce of the same surface.
    tolerance : float
        Relative error asked of the sum.
    trial : bool
        Prepared only to compile the kernels: the resolution is the coarsest.
    """

    def __init__(self, setup: Setup, single: Any, tolerance: float, trial: bool) -> None:
        self._setup, self._single, self._tolerance = setup, single, tolerance
        self._rule = rule(0.5 if trial else MARGIN * tolerance)
        self._dark = setup.alpha_x == 0.0 or not np.any(setup.values["kd"])

    def points(self, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Evaluate at N pairs of directions (radians; phi_i does not matter); returns (N, 1, C) in 1/sr."""
        ti, to, p, az = (np.ascontiguousarray(a) for a in (theta_i, theta_o, phi, phi_i))
        out = self._single.points(ti, to, p, az) + points_specular(self._setup, ti, to, p, az, self._tolerance)[:, None]
        if not self._dark:
            out[:, 0] += interpolated(self._setup, ti, to, p, az, self._rule)
        return out

    def fill(self, theta_i: Array, theta_o: Array, phi: Array, square: bool, out: NDArray[np.floating]) -> None:
        """Fill out (1, I, O, F, C), float32 or float64, on a product grid of radians, in 1/sr.

        A square grid (both theta axes the same) is computed half and mirrored: reciprocal bit for bit.
        """
        self._single.fill(theta_i, theta_o, phi, square, out)
        out = out[0]
        self._add_specular(theta_i, theta_o, phi, square, out)
        if self._dark:
            return
        modes = Modes(self._setup, self._rule).table(theta_i, theta_o)
        waves = synthesis(phi, len(modes))
        for i in range(theta_i.size):
            stop = i + 1 if square else theta_o.size
            for c in range(out.shape[3]):
                row = (modes[:, i, :stop, c].T @ waves).astype(out.dtype)
                out[i, :stop, :, c] += row
                if square:
                    out[:i, i, :, c] += row[:i]

    def _add_specular(
        self, theta_i: Array, theta_o: Array, phi: Array, square: bool, out: NDArray[np.floating]
    ) -> None:
        """Add the V-groove's orders from two on: all orders less the first."""
        groove = specular_setup(self._setup)
        if groove is None:
            return
        kernel = cast(HasEvaluator, models.kernel("vgroove-sym"))
        first = resolve("vgroove-sym", **{**groove.parameters, "max_bounces": 1})
        tables = [kernel.prepare(some, self._tolerance) for some in (groove, first)]
        part = np.empty((*out.shape[:3], len(groove.channels)), out.dtype)
        prepared = [table for table in tables if table is not None]
        if len(prepared) < len(tables):
            self._add_rows(theta_i, theta_o, phi, square, out)
            return
        for sign, table in zip((1.0, -1.0), prepared, strict=True):
            table.fill(theta_i, theta_o, phi, square, part[None])
            # at the mirror direction itself, where a cell average follows, the sum need not be finite
            out += np.nan_to_num(sign * part, copy=False, posinf=0.0, neginf=0.0)

    def _add_rows(self, theta_i: Array, theta_o: Array, phi: Array, square: bool, out: NDArray[np.floating]) -> None:
        """Add the same point by point, where the V-groove has no fast table for the index."""
        for i in range(theta_i.size):
            stop = i + 1 if square else theta_o.size
            view = np.repeat(theta_o[:stop], phi.size)
            light, azimuth = np.full_like(view, theta_i[i]), np.tile(phi, stop)
            row = points_specular(self._setup, light, view, azimuth, np.zeros_like(view), self._tolerance)
            row = row.reshape(stop, phi.size, -1).astype(out.dtype)
            out[i, :stop] += row
            if square:
                out[:i, i] += row[:i]


def prepare_cavity(setup: Setup, prepare: Prepare, tolerance: float, trial: bool = False) -> CavityEvaluator | None:
    """Return the fast evaluation of an isotropic setup with bounces 2 or inf, or None where the tolerance is too tight.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    prepare : callable
        Prepares a single-bounce setup: as a kernel module does.
    tolerance : float
        Relative error asked, at least `REACH`.
    trial : bool
        Prepared only to compile the kernels, on a coarse rule.
    """
    if not setup.isotropic or tolerance < REACH:
        return None
    single = prepare(resolve("ilm", **{**setup.parameters, "bounces": "1"}), tolerance, 0, trial)
    return None if single is None else CavityEvaluator(setup, single, tolerance, trial)
