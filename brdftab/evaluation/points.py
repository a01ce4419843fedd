"""Point values of any model of the registry."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab import models
from brdftab.directions import HORIZON, MIRROR_SINE, checked_angles
from brdftab.errors import ParameterError, SingularDirectionError
from brdftab.evaluation import delta
from brdftab.evaluation.agreement import LOOSEST, least_errors, looser
from brdftab.models.protocols import HasFinestRule, HasSingularSetup, Stochastic
from brdftab.models.resolve import Setup, component_names, resolve
from brdftab.timing import Clock
from brdftab.typing import Array

ORDERS = 8
EPS = float(np.finfo(np.float64).eps)
TOLERANCE = 1e-9
# the finer rule's share of the tolerance
FINER = 0.01
Progress = Callable[[float], None]


def check_tolerance(tolerance: float) -> float:
    """Return a relative tolerance after checking that it lies in [1e-14, 0.5]."""
    if not (isinstance(tolerance, int | float) and 1e-14 <= tolerance <= LOOSEST):
        raise ParameterError.out_of_range("tolerance", tolerance, "[1e-14, 0.5]", "it is a relative error")
    return float(tolerance)


def is_stochastic(setup: Setup) -> bool:
    """Tell whether a setup's values are estimates with a standard error."""
    module = models.kernel(setup.model.name)
    return isinstance(module, Stochastic) and module.stochastic(setup)


def finest_tolerance(setup: Setup) -> float:
    """Return the tolerance of the finest rule of a setup's model: tighter ones are served by the same rule."""
    module = models.kernel(setup.model.name)
    return module.finest(setup) if isinstance(module, HasFinestRule) else 0.0


def singular_setup(setup: Setup) -> Setup | None:
    """Return the setup whose bounce orders are infinite at the mirror direction, or None where none is.

    It is the given one, unless the model's kernel module has a function of this name to tell another.
    """
    if not setup.model.singular or setup.max_bounces == 1:
        return None
    module = models.kernel(setup.model.name)
    return module.singular_setup(setup) if isinstance(module, HasSingularSetup) else setup


def has_mirror_averages(setup: Setup) -> bool:
    """Tell whether cells that hold the mirror direction are averaged: no point there stands for them."""
    return singular_setup(setup) is not None or delta.exists(setup)


def singular(setup: Setup, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> NDArray[np.bool_]:
    """Tell where a singular model has no finite point value.

    There the half vector is the normal and two or more bounces reach the mirror direction with a weight that is not
    negligible: 1e-9 rad aside they still exceed 1e-12 of the value.
    """
    found = np.zeros(theta_i.shape, dtype=bool)
    bouncing = singular_setup(setup)
    if bouncing is None:
        return found
    so = np.sin(theta_o)
    half = np.cos(0.5 * phi)
    flat = np.hypot(
        2.0 * np.cos(0.5 * (theta_i + theta_o)) * np.sin(0.5 * (theta_i - theta_o)) + 2.0 * so * half * half,
        so * np.sin(phi),
    )
    up = np.cos(theta_i) + np.cos(theta_o)
    near = (flat <= MIRROR_SINE * up) & (np.minimum(np.cos(theta_i), np.cos(theta_o)) > HORIZON)
    if not near.any():
        return found
    t, az = theta_i[near], phi_i[near]
    aside = models.kernel(bouncing.model.name).points(
        bouncing, t, np.where(t > 0.7, t - 1e-9, t + 1e-9), np.full_like(t, math.pi), az, orders=1, tolerance=1e-9
    )
    first, rest = np.abs(aside[:, 0]).max(axis=-1), np.abs(aside[:, 1:]).sum(axis=(1, 2))
    found[near] = rest > 1e-12 * first
    return found


def evaluate_setup(
    setup: Setup,
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    phi: ArrayLike,
    phi_i: ArrayLike,
    orders: int,
    tolerance: float,
) -> Array:
    """Evaluate a checked setup; returns (..., P, C), P = 1 for orders = 0. Raises as `evaluate`."""
    shape, flat = checked_angles(theta_i=theta_i, theta_o=theta_o, phi=phi, phi_i=phi_i)
    bad = singular(setup, *flat)
    if bad.any():
        at = int(np.argmax(bad))
        raise SingularDirectionError(
            f"theta_i = {math.degrees(flat[0][at]):g}, theta_o = {math.degrees(flat[1][at]):g}, "
            f"phi = {math.degrees(flat[2][at]):g} degrees is the mirror direction, where {setup.model.name} has no "
            "finite value; ask for a direction aside, a cell average (tabulate) or "
            f"{'bounces' if setup.model.shares('bounces') else 'max_bounces'} = 1"
        )
    values = models.kernel(setup.model.name).points(setup, *flat, orders=orders, tolerance=tolerance)
    return np.asarray(values).reshape(*shape, *values.shape[1:])


def evaluate(
    model: str,
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    phi: ArrayLike,
    *,
    phi_i: ArrayLike = 0.0,
    components: bool = False,
    tolerance: float = TOLERANCE,
    **parameters: Any,
) -> Array | dict[str, Array]:
    """Evaluate a BRDF at pairs of directions.

    Parameters
    ----------
    model : str
        Registry name, see `brdftab.models`.
    theta_i, theta_o : array_like
        Polar angles of light and view, radians in [0, pi/2]; at or below the horizon the BRDF is 0.
    phi : array_like
        phi_o - phi_i, radians; pi is the mirror side.
    phi_i : array_like, optional
        Azimuth of the light, radians; matters for anisotropic surfaces only (alpha_x lies along azimuth 0).
    components : bool, optional
        Return each component apart.
    tolerance : float, optional
        Relative error asked of the quadratures, in [1e-14, 0.5].
    **parameters
        Parameters of the model by name (ndf, alpha, material, ...); see `brdftab.models`.

    Returns
    -------
    ndarray (..., C) or dict of str to ndarray (..., C)
        BRDF in 1/sr without cosine, a channel each; with `components` one array a component (bounce models: order1 to
        order8 and higher). Of a flat interface (sigma = 0) f has a delta at the mirror direction, too, which no value
        holds: `brdftab.albedo` and `brdftab.sample` contain it.

    Raises
    ------
    ParameterError
        If the model or a parameter is unknown or out of range, or the angles do not broadcast.
    SingularDirectionError
        If a direction is the mirror direction of a model whose density is infinite there.
    """
    setup = resolve(model, **parameters)
    values = evaluate_setup(
        setup, theta_i, theta_o, phi, phi_i, ORDERS if components else 0, check_tolerance(tolerance)
    )
    if not components:
        return values[..., 0, :]
    return {name: values[..., n, :] for n, name in enumerate(component_names(setup, ORDERS))}


def evaluate_point(
    setup: Setup,
    theta_i: float,
    theta_o: float,
    phi: float,
    phi_i: float,
    *,
    tolerance: float,
    components: bool,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Evaluate one pair of directions (radians) with its estimated errors and run times.

    The value is compared with those at a hundredth of the tolerance and at looser ones, up to the first that differs:
    the error is the difference to the finer one, but no less than what the looser ones support (`least_errors`),
    relative to the largest channel, plus the rounding of float64. Where the model has no rule that fine, the error is
    the difference to the first looser one than its finest that differs. Of an estimate with noise it is the standard
    error instead, or 1 where bounces were looked for and no path found any.
    `progress` is called with the finished share of what the value is compared with.

    Returns
    -------
    dict
        model, parameters, channels, value, components (None unless asked), component_errors (None unless asked; by
        name {"absolute": in 1/sr, "relative": to the component's own largest channel}), delta (None but at the mirror
        direction of a flat interface: the share of light, a channel each, that is reflected there beside `value`),
        unreached (True if no path of an estimate found bounces beyond the first, so that nothing is known of them),
        error, spectral (see `spectral`: what few wavelengths leave is no part of the error), run_time_s (of the value)
        and error_time_s (of what it was compared with), compilation left out; JSON-able.
    """
    asked = check_tolerance(tolerance)
    orders = ORDERS if components else 0
    at = (theta_i, theta_o, phi, phi_i)
    clock = Clock()
    unreached = False
    if is_stochastic(setup):
        angles = [np.array([a], dtype=np.float64) for a in at]
        found = models.estimator(setup.model.name).estimates(setup, *angles, orders=orders, tolerance=asked)
        elapsed = clock.seconds
        values = found.values[0]
        spread = float(found.standard_error.max())
        errors = found.component_errors[0].max(axis=-1)
        unreached = spread == 0.0 and setup.max_bounces != 1
    else:
        values = evaluate_setup(setup, *at, orders, asked)
        elapsed = clock.seconds
        spread, errors = _spreads(setup, at, orders, asked, values, progress)
    everything = clock.seconds
    total = values.sum(axis=0)
    names = component_names(setup, orders) if components else ()

    def relative(error: float, value: Array) -> float:
        # what no path found may have any size
        return 1.0 if unreached and not value.any() else _relative(error, value)

    return {
        "model": setup.model.name,
        "parameters": setup.parameters,
        "channels": list(setup.channels),
        "value": total.tolist(),
        "components": dict(zip(names, values.tolist(), strict=True)) if components else None,
        "component_errors": {
            name: {"absolute": float(error) + EPS * float(np.abs(total).max()), "relative": relative(error, value)}
            for name, error, value in zip(names, errors, values, strict=True)
        }
        if components
        else None,
        "delta": _delta(setup, theta_i, theta_o, phi),
        "unreached": unreached,
        "error": 1.0 if unreached else _relative(spread, total),
        "spectral": spectral(setup),
        "run_time_s": elapsed,
        "error_time_s": everything - elapsed,
    }


def spectral(setup: Setup) -> dict[str, Any] | None:
    """Say how many wavelengths stand behind RGB and what they cost in accuracy, relative; None without reflectance."""
    if setup.fresnel is None:
        return None
    return {
        "wavelengths_nm": list(setup.fresnel.wavelengths),
        "error_against_5nm": setup.fresnel.spectral_error,
        "source": setup.fresnel.source,
    }


def _relative(spread: float, value: Array) -> float:
    """Return an absolute error over the largest channel, with rounding; that alone where nothing is wrong with 0."""
    scale = float(np.abs(value).max())
    if scale == 0.0:
        return EPS if spread == 0.0 else 1.0
    return float(spread) / scale + EPS


def _spreads(
    setup: Setup,
    at: tuple[float, float, float, float],
    orders: int,
    tolerance: float,
    values: Array,
    progress: Progress | None,
) -> tuple[float, Array]:
    """Return the absolute errors to state of the total and of the components (P, C), without rounding.

    The difference to the finer rule, but no less than what looser rules support; where none is a hundred times finer,
    the difference to the first looser one that differs.
    """
    # rules finer than the finest would be made again in vain, and where none is finer by that much for every part,
    # those that agree say nothing: values are held against looser ones than the finest
    finest = finest_tolerance(setup)
    finer = [max(FINER * tolerance, 1e-14)] if (1.0 + EPS) * FINER * tolerance >= finest else []
    served = tolerance if finer else finest
    steps = [*finer, *looser(served)]
    done = 0

    def parts(wanted: float) -> Array:
        nonlocal done
        found = evaluate_setup(setup, *at, orders, wanted)
        done += 1
        if progress is not None:
            progress(done / len(steps))
        # the total is one more that may differ, or not
        return np.concatenate([found, found.sum(axis=0, keepdims=True)])

    whole = np.concatenate([values, values.sum(axis=0, keepdims=True)])
    stated = np.zeros(len(whole))
    for wanted in finer:
        stated = np.abs(parts(wanted) - whole).max(axis=-1)
    # an infinite scale lets the difference to a rule count alone that is looser in every part of it
    scale = None if finer else np.full((1, len(whole)), math.inf)
    least = least_errors(whole[None], served, lambda _, wanted: parts(wanted)[None], scale=scale)[0]
    stated = np.maximum(stated, least)
    return float(stated[-1]), stated[:-1]


def _delta(setup: Setup, theta_i: float, theta_o: float, phi: float) -> list[float] | None:
    """Return the reflectance of a delta at a pair of directions, or None where there is none."""
    if not (delta.exists(setup) and delta.mirrors(theta_i, theta_o, phi)):
        return None
    found: list[float] = delta.reflectance(setup, np.array([theta_i]))[0].tolist()
    return found
