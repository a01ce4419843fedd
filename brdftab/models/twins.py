"""From a checked setup to the arguments of a model's JAX twin, its values, and their derivatives."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from brdftab import models
from brdftab.errors import ParameterError, proposal
from brdftab.models._shared.facets.rough import rough_class
from brdftab.models._shared.twin.frame import Directions, directions
from brdftab.models._shared.twin.static import WEIGHTS, Static
from brdftab.models.protocols import HasDataNodes, HasPreparation, HasRuleNodes, RulesByRoughness
from brdftab.models.resolve import Setup

# how many of a and b each kind of reflectance has
_FRESNEL_COUNT = {-1: 0, 0: 0, 1: 2, 2: 1, 3: 1, 4: 2}


def split(setup: Setup, tolerance: float = 1e-9, precision: str = "float64") -> tuple[Static, dict[str, np.ndarray]]:
    """Split a setup into what a twin is compiled for and the numbers that it takes.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    tolerance : float, optional
        Relative error asked of the model's rules.
    precision : {"float64", "float32"}, optional
        Of the inner loops of models that offer one.

    Returns
    -------
    Static
        The choices.
    dict of str to float64
        By canonical name: alpha_x, alpha_y, sigma (1,); kd (1,) or (C,); a, b (1,), (C,) or (W,); with several
        wavelengths behind a channel also `WEIGHTS` (W, C).
    """
    params: dict[str, np.ndarray] = {}
    if setup.ndf >= 0:
        params["alpha_x"] = np.array([setup.alpha_x], dtype=np.float64)
        params["alpha_y"] = np.array([setup.alpha_y], dtype=np.float64)
    options = []
    for param in setup.model.params:
        given = setup.values.get(param.name)
        if param.kind == "choice" and param.name in setup.values:
            options.append((param.name, given))
        elif param.kind in ("float", "channels") and given is not None:
            params[param.name] = np.atleast_1d(np.asarray(given, dtype=np.float64))
    fresnel = setup.fresnel
    if fresnel is not None:
        for name, numbers in (("a", fresnel.a), ("b", fresnel.b))[: _FRESNEL_COUNT[fresnel.kind]]:
            params[name] = np.array(numbers, dtype=np.float64)
        if not np.array_equal(fresnel.weights, np.eye(fresnel.weights.shape[0])):
            params[WEIGHTS] = np.array(fresnel.weights, dtype=np.float64)
    static = Static(
        model=setup.model.name,
        ndf=setup.ndf,
        fresnel=-1 if fresnel is None else fresnel.kind,
        isotropic=setup.isotropic,
        options=tuple(sorted(options)),
        max_bounces=setup.max_bounces,
        tolerance=tolerance,
        precision=precision,
        rough=rough_class(setup) if isinstance(models.twin(setup.model.name), RulesByRoughness) else 1.0,
    )
    return static, params


def integrates(model: str) -> bool:
    """Tell whether a model's twin sums over nodes that follow from the tolerance."""
    module = models.twin(model)
    return isinstance(module, HasRuleNodes | HasDataNodes | RulesByRoughness)


def numbers(static: Static, theta_i: Any, theta_o: Any, phi: Any) -> dict[str, Any]:
    """Return what a twin's ``nodes`` makes of the data's angles (N,), under that name; nothing for twins without."""
    module = models.twin(static.model)
    return {"nodes": module.nodes(static, theta_i, theta_o, phi)} if isinstance(module, HasDataNodes) else {}


def prepared(static: Static, p: dict[str, Any]) -> dict[str, Any]:
    """Return what a twin's ``prepare`` makes of one channel's parameters, under the name ``prepared``; else nothing.

    It is what does not depend on the single point and is costly: worth doing once a set of parameters.
    """
    module = models.twin(static.model)
    return {"prepared": module.prepare(static, p)} if isinstance(module, HasPreparation) else {}


def channel_values(static: Static, params: dict[str, Any], d: Directions, given: dict[str, Any] | None = None) -> Any:
    """Return (N, C) in 1/sr from JAX parameters as `split` gives them; to be traced with `static` fixed.

    Entries of size 1 are shared by all channels. The shapes are computed once, unless they depend on a parameter that
    has one entry a channel. `given` comes from `numbers`.
    """
    module = models.twin(static.model)
    own = {k: v for k, v in params.items() if k != WEIGHTS and v.shape[0] > 1}
    shared = {k: v[0] for k, v in params.items() if k != WEIGHTS and v.shape[0] == 1} | (given or {})
    common = None if own.keys() & set(module.SHAPE_PARAMS) else module.shapes(static, shared, d)

    def one(mine: dict[str, Any]) -> Any:
        p = {**shared, **mine}
        p |= prepared(static, p)
        return module.value(static, p, module.shapes(static, p, d) if common is None else common, d)

    values = jax.vmap(one, out_axes=1)(own) if own else one({})[:, None]
    return values @ params[WEIGHTS] if WEIGHTS in params else values


@partial(jax.jit, static_argnums=0)
def _values(static: Static, params: dict[str, Any], d: Directions, given: dict[str, Any]) -> Any:
    return channel_values(static, params, d, given)


@partial(jax.jit, static_argnums=0)
def _tangents(
    static: Static, params: dict[str, Any], tangents: dict[str, Any], d: Directions, given: dict[str, Any]
) -> Any:
    def f(p: dict[str, Any]) -> Any:
        return channel_values(static, p, d, given)

    return jax.jvp(f, (params,), (tangents,))[1]


def _full(setup: Setup, values: Any) -> np.ndarray:
    """Return (N, C) as NumPy float64; one column serves all channels if nothing tells them apart."""
    found = np.asarray(values, dtype=np.float64)
    return np.array(np.broadcast_to(found, (found.shape[0], len(setup.channels))))


def evaluate(
    setup: Setup,
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    phi: ArrayLike,
    phi_i: ArrayLike,
    tolerance: float = 1e-9,
) -> np.ndarray:
    """Evaluate a model's twin at N pairs of directions.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    theta_i, theta_o, phi, phi_i : array_like (N,)
        Radians.
    tolerance : float, optional
        Relative error asked of the model's rules.

    Returns
    -------
    float64 (N, C)
        BRDF in 1/sr; 0 at and below the horizon.

    Raises
    ------
    ParameterError
        If the model has no twin.
    """
    static, params = split(setup, tolerance)
    d = directions(theta_i, theta_o, phi, phi_i)
    return _full(setup, _values(static, params, d, numbers(static, *d[:3])))


def derivative(
    setup: Setup,
    name: str,
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    phi: ArrayLike,
    phi_i: ArrayLike,
    tolerance: float = 1e-9,
    *,
    channel: int | None = None,
) -> np.ndarray:
    """Return the forward-mode derivative of the values by one parameter.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    name : str
        Canonical name as in `split`; on an isotropic surface alpha_x stands for both axes.
    theta_i, theta_o, phi, phi_i : array_like (N,)
        Radians.
    tolerance : float, optional
        Relative error asked of the model's rules.
    channel : int, optional
        Entry of a parameter that has one a channel or wavelength; by default all its entries move together.

    Returns
    -------
    float64 (N, C)
        1/sr over the parameter's unit.

    Raises
    ------
    ParameterError
        If the model has no twin, or no such parameter or entry.
    """
    static, params = split(setup, tolerance)
    known = [k for k in params if k != WEIGHTS]
    if name not in known:
        near = proposal(name, known)
        raise ParameterError(
            f"{name} is not a number of {setup.model.name} here; {near}{'C' if near else 'c'}hoose one of "
            f"{', '.join(known)}"
        )
    size = params[name].size
    if channel is not None and not 0 <= channel < size:
        raise ParameterError.out_of_range("channel", channel, f"[0, {size - 1}]", f"{name} has {size} entries")
    tangents = {k: np.zeros_like(v) for k, v in params.items()}
    tangents[name][slice(None) if channel is None else channel] = 1.0
    d = directions(theta_i, theta_o, phi, phi_i)
    return _full(setup, _tangents(static, params, tangents, d, numbers(static, *d[:3])))
