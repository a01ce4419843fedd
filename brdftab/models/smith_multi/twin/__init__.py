"""Smith microfacets with all bounces in JAX: GGX, isotropic, reflecting.

The first bounce is closed. What two and more add is solved once a set of parameters (`prepare`) at polar angles that
suit the data (`nodes`), and looked up at each point (`value`).
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from brdftab.errors import ParameterError
from brdftab.models._shared.twin import single
from brdftab.models._shared.twin.frame import lifted
from brdftab.models._shared.twin.fresnel import DIELECTRIC, reflectance
from brdftab.models._shared.twin.masking import SEPARABLE
from brdftab.models._shared.twin.ndf import GGX
from brdftab.models.smith_multi.twin.grid import at_points, spread_modes
from brdftab.models.smith_multi.twin.nodes import nodes as nodes_of
from brdftab.models.smith_multi.twin.solve import solve
from brdftab.models.smith_multi.volterra.settings import SOLVER_ALPHA

SHAPE_PARAMS = ("alpha_x", "alpha_y")


def roughness_bounds(ndf: str) -> tuple[float, float]:
    """Return between which roughnesses a fit may move: where the solver is accurate, for any distribution."""
    return SOLVER_ALPHA


def check(static: Any) -> None:
    """Refuse what has no closed modes.

    Raises
    ------
    ParameterError
        Unless the surface is isotropic, GGX, reflecting, and its estimator the solver.
    """
    if static.option("estimator") != "solver":
        raise ParameterError(
            f"estimator = {static.option('estimator')} of smith-multi has noise and no derivatives; fit with solver"
        )
    if static.ndf != GGX:
        raise ParameterError("ndf = beckmann of smith-multi has no twin to fit with; fit with ggx")
    if static.fresnel == DIELECTRIC:
        raise ParameterError(
            "ior of smith-multi lets light through, which has no twin to fit with; fit f0, or eta and k"
        )


def nodes(static: Any, theta_i: np.ndarray, theta_o: np.ndarray, phi: np.ndarray) -> dict[str, Any]:
    """Return what depends on the data's angles (N,) alone, as numbers to be put among the parameters."""
    check(static)
    return nodes_of(static.fresnel, static.max_bounces, static.tolerance, theta_i, theta_o, phi)


def prepare(static: Any, p: dict[str, Any]) -> Any:
    """Return the light of two and more bounces on a grid of angles (I, O, F), without the masking of both directions.

    Parameters
    ----------
    static : Static
        Choices.
    p : dict
        One channel's numbers, and those of `nodes` under that name.
    """
    return spread_modes(solve(static, p), p["nodes"]) if static.max_bounces != 1 else jnp.zeros((1, 1, 1))


def shapes(static: Any, p: dict[str, Any], d: Any) -> Any:
    """Return D G/(4 i_z o_z) in 1/sr, i.h, and G/(i_z o_z) of both directions (0 below the horizon), each (N,)."""
    check(static)
    front, i_h = single.geometry(static, SEPARABLE, p, d)
    above, safe = lifted(d)
    square = p["alpha_x"] ** 2
    ends = [2.0 / (c + jnp.sqrt(c * c + square * s * s)) for c, s in ((safe.ci, safe.si), (safe.co, safe.so))]
    return front, i_h, jnp.where(above, ends[0] * ends[1], 0.0)


def value(static: Any, p: dict[str, Any], shapes: Any, d: Any) -> Any:
    """Return the BRDF (1/sr) of one wavelength, (N,); `p` holds what `prepare` gave under ``prepared``."""
    front, i_h, both = shapes
    first = front * reflectance(static.fresnel, p.get("a"), p.get("b"), i_h)
    return first if static.max_bounces == 1 else first + both * at_points(p["prepared"], p["nodes"], d)
