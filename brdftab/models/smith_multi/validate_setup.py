"""Which estimator serves a setup, and which combinations are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brdftab.errors import ParameterError
from brdftab.materials.fresnel import CONDUCTOR
from brdftab.models._shared.codes import BECKMANN
from brdftab.models.resolve import Setup
from brdftab.models.smith_multi.volterra.poles import followed
from brdftab.models.smith_multi.volterra.settings import SOLVER_ALPHA


def _solvable(setup: Setup) -> bool:
    """Tell whether the solver's sums follow the reflectance; those of Beckmann facets are fitted at all angles."""
    f = setup.fresnel
    # absorbing and dense metals are known to be smooth
    if f is None or setup.ndf == BECKMANN or f.kind != CONDUCTOR or bool(((f.b >= 1.0) | (f.a >= 1.1)).all()):
        return True
    return followed(f.kind, tuple(f.a.tolist()), tuple(f.b.tolist()))


def validate_setup(setup: Setup) -> Setup:
    """Return the setup with its estimator by name.

    Raises
    ------
    ParameterError
        If the estimator does not serve the surface, or sampling options are given to the solver.
    """
    asked, below = setup.values["estimator"], setup.transmits
    low, high = SOLVER_ALPHA
    chosen = asked
    solvable = _solvable(setup)
    if asked == "auto":
        chosen = "solver" if setup.isotropic and solvable else ("pt" if below else "hybrid")
    if chosen == "solver":
        if not setup.isotropic:
            raise ParameterError(
                f"estimator = solver needs an isotropic surface, not alpha_x = {setup.alpha_x:g}, alpha_y = "
                f"{setup.alpha_y:g}; use {'pt' if below else 'hybrid, bdpt or pt'}"
            )
        if not low <= setup.alpha_x <= high:
            raise ParameterError(
                f"alpha = {setup.alpha_x:g} is outside [{low:g}, {high:g}], where the solver is accurate; use "
                f"estimator = {'pt' if below else 'bdpt'}"
            )
        if not solvable:
            assert setup.fresnel is not None
            worst = int(np.argmin(setup.fresnel.b))
            raise ParameterError(
                f"estimator = solver cannot follow the reflectance of eta = {setup.fresnel.a[worst]:g}, k = "
                f"{setup.fresnel.b[worst]:g}, which turns sharply at an angle; use hybrid, bdpt or pt, or a larger k"
            )
        for name, idle in (("samples", None), ("seed", 0), ("roulette", "off")):
            if setup.values[name] != idle:
                raise ParameterError(
                    f"{name} = {setup.values[name]} has no meaning for estimator = solver, which draws no paths; leave "
                    "it out, or use pt or bdpt"
                )
    if below and chosen in ("bdpt", "hybrid"):
        raise ParameterError(
            f"estimator = {chosen} traces reflections only and ior = {setup.parameters['ior']} transmits too; use "
            "solver or pt"
        )
    kept = {n: v for n, v in setup.parameters.items() if chosen != "solver" or n not in ("samples", "seed", "roulette")}
    return replace(setup, values={**setup.values, "estimator": chosen}, parameters={**kept, "estimator": chosen})
