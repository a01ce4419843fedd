"""What a user must be told before believing a fit: one line for each thing that speaks against it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.fit.resolution import FEWEST
from brdftab.fit.stages import AGREE, BIAS, Outcome
from brdftab.typing import Array

CORRELATED = 0.95
# a fit is poor where most of its squared error is no noise, but for what single precision and coarse cells leave
SHARE, LEAST = 2.0, 0.02
# independent noise lies sqrt 2 above the reciprocity floor that it leaves
ABOVE_FLOOR = 1.5
# log-RMS, a typical factor of 1.35, that counts where too few directions tell the noise
POOR = 0.3
# error around the mirror direction, relative to the data and to the fit's own, that no tail of a lobe explains
SPIKE = 2.0
# relative standard error from which on a parameter says little
VAGUE = 0.3


def doubts(
    outcome: Outcome,
    labels: Sequence[str],
    outer: Array,
    spread: Array,
    correlation: Array,
    at_bound: NDArray[np.bool_],
    bias: Array,
    metrics: dict[str, Any],
    by_theta: Sequence[dict[str, Any]],
    judged: float,
    noise: float | None,
    least: Mapping[str, float],
    near: float | None,
    cause: str,
) -> list[str]:
    """Return warnings.

    Parameters
    ----------
    outcome : Outcome
        The end of the solve.
    labels : sequence of str
        Names of the n entries.
    outer, spread : ndarray (n,)
        Parameters and their standard errors in API units.
    correlation : ndarray (n, n)
        Of the entries, from J^T J: noise that channels share correlates estimates that are each well determined.
    at_bound : ndarray (n,) of bool
        Entries on a bound.
    bias : ndarray (n,)
        What the quadrature rule costs, in standard errors.
    metrics : dict
        With the reciprocity floor.
    by_theta : sequence of dict
        Error by theta_i.
    judged : float
        Log-RMS over what is brighter than the data's floor and the noise floor.
    noise : float or None
        Of the same, what neighbouring directions disagree by.
    least : mapping of str to float
        Roughnesses, by name, below which too few directions see a lobe.
    near : float or None
        Cosine-weighted error around the mirror direction, at other directions than those of the fit.
    cause : str
        What to look at first if the fit is poor.
    """
    lines = []
    if outcome.verdict != "converged":
        lines.append(f"the solver {outcome.verdict}; the values are those of its best step")
    for name, value, stuck in zip(labels, outer, at_bound, strict=True):
        if stuck and value == least.get(name):
            lines.append(f"{name} = {value:g} lies on its bound: fewer than {FEWEST} directions see a narrower lobe")
        elif stuck:
            lines.append(f"{name} = {value:g} lies on its bound: the data pull beyond it, or do not determine it")
    lines += _correlations(labels, correlation)
    for n, name in enumerate(labels):
        if not at_bound[n] and spread[n] > VAGUE * abs(outer[n]):
            lines.append(f"{name} = {outer[n]:.3g} +- {spread[n]:.2g} is hardly determined by the data")
    lines += _starts(outcome)
    if near is not None and near > max(SPIKE, SPIKE * metrics["cosine_rms"]):
        lines.append(
            f"spike: around the mirror direction, between the directions of the fit, f cos is off by {near:.3g} times "
            "the data; fit with --sampling mirror"
        )
    lines += _misfit(metrics, by_theta, judged, noise, cause)
    worst = np.abs(bias)
    if worst.size and worst.max() > BIAS:
        name = labels[int(worst.argmax())]
        lines.append(f"the finest quadrature rule still biases {name} by {worst.max():.1f} standard errors")
    return lines


def _correlations(labels: Sequence[str], correlation: Array) -> list[str]:
    """Name the worst pair of correlated parameters, and how many more there are."""
    pairs = [
        (abs(correlation[i, j]), j, i)
        for i in range(len(labels))
        for j in range(i)
        if abs(correlation[i, j]) > CORRELATED
    ]
    if not pairs:
        return []
    _, j, i = max(pairs)
    more = f" (and {len(pairs) - 1} more pairs above {CORRELATED:g})" if len(pairs) > 1 else ""
    return [
        f"{labels[j]} and {labels[i]} are correlated ({correlation[i, j]:+.3f}): the data determine a combination of "
        f"them, not both{more}"
    ]


def _starts(outcome: Outcome) -> list[str]:
    """Doubt a minimum that few starts reach, or that another one matches."""
    costs = np.sort([c for c in outcome.start_costs if math.isfinite(c)])
    if outcome.tried < 2 or not costs.size:
        return []
    lines = []
    if outcome.agreed == 1:
        lines.append(f"only 1 of {outcome.tried} starts reached the best minimum; try more starts")
    others = costs[costs > costs[0] * (1.0 + AGREE) + 1e-12 * outcome.residuals]
    if others.size and others[0] < 1.02 * costs[0]:
        lines.append(
            f"starts disagree: another minimum costs only {100.0 * (others[0] / costs[0] - 1.0):.2g} % more; "
            "the parameters are not unique"
        )
    return lines


def _misfit(
    metrics: dict[str, Any], by_theta: Sequence[dict[str, Any]], judged: float, noise: float | None, cause: str
) -> list[str]:
    """Doubt a model that the data do not follow as well as they follow themselves."""
    lines = []
    floor = metrics["reciprocity_floor"]
    known = POOR if noise is None else max(math.sqrt(SHARE) * noise, LEAST)
    if judged > max(known, ABOVE_FLOOR * (floor or 0.0)):
        told = [f"neighbouring directions agree to {noise:.2g}"] if noise is not None else []
        told += [f"the data's own reciprocity floor is {floor:.3f}"] if floor is not None else []
        beside = f" ({', '.join(told)})" if told else ""
        lines.append(
            f"poor fit: log-RMS {judged:.3f}, typically wrong by a factor of {math.exp(judged):.2f}{beside}; {cause}"
        )
    means = [b for b in by_theta if b["mean"] is not None and b["count"] >= 100]
    if means:
        worst = max(means, key=lambda b: abs(b["mean"]))
        if abs(worst["mean"]) > max(0.5 * metrics["logeps"], 0.02):
            low, high = math.degrees(worst["low"]), math.degrees(worst["high"])
            lines.append(
                f"residual structure: the fit is {'high' if worst['mean'] > 0 else 'low'} by "
                f"{100.0 * abs(math.expm1(worst['mean'])):.3g} % on average for theta_i {low:.0f} to {high:.0f} degrees"
            )
    return lines
