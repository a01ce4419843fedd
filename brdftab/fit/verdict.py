"""From a solved fit to its result: standard errors, metrics, warnings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from brdftab.fit.data import Dataset
from brdftab.fit.held import held, of_data
from brdftab.fit.losses import MEANING
from brdftab.fit.metrics import error_by_theta, log_ratio, metrics
from brdftab.fit.noise import neighbour_noise
from brdftab.fit.parameters import Sum
from brdftab.fit.resolution import least_roughness, resolved
from brdftab.fit.result import FitResult
from brdftab.fit.stages import Fitter, Options, Outcome, covariance
from brdftab.fit.warnings import doubts
from brdftab.timing import Clock
from brdftab.typing import Array

BINS = 5


def fit_points(
    total: Sum,
    points: Dataset,
    options: Options,
    made: Mapping[str, Any] | None = None,
    near: Dataset | None = None,
) -> FitResult:
    """Fit a parsed sum to points: what `fit_model` does once data and options are settled.

    `made` is the provenance of the data, which a poor fit is explained by; `near` are other points of them, around the
    mirror direction, at which a spike between the points shows.
    """
    clock = Clock()
    total = resolved(total, points)
    fitter = Fitter(total, points, options)
    outcome = fitter.run()
    channels = len(points.channels)
    sandwich, classical, at_bound = covariance(outcome, fitter.low, fitter.high)
    labels = total.labels(points.channels)
    outer, slope = _outer(total, outcome.x, channels)
    spread = np.sqrt(np.diag(sandwich))
    correlation = sandwich / np.outer(*2 * [np.where(spread > 0.0, spread, 1.0)])
    np.fill_diagonal(correlation, 1.0)
    fitted = fitter.predict(outcome.x, points.theta_i, points.theta_o, points.phi)
    # where values are clipped, a fit above them is no error
    shown = np.where(points.saturated, np.minimum(fitted, np.abs(points.values)), fitted)
    seen = (shown, points.values, points.valid, points.theta_i, points.theta_o)
    measures: dict[str, Any] = dict(metrics(*seen, fitter.floor))
    least = max(fitter.floor, options.noise_floor)
    judged = metrics(*seen, least)["log_rms"]
    with np.errstate(invalid="ignore"):
        ratio, bright = log_ratio(shown, points.values, least), points.valid & (points.values > 0.0)
    noise = neighbour_noise(points.theta_i, points.theta_o, points.phi, ratio, bright)
    measures["reciprocity_floor"] = points.reciprocity_floor
    bias = outcome.bias / np.where(spread > 0.0, spread, np.inf)
    edges = np.linspace(0.0, max(float(points.theta_i.max()), 1e-3) * (1.0 + 1e-12), BINS + 1)
    by_theta = error_by_theta(shown, points.values, points.valid, points.theta_i, edges)
    slant = np.sqrt(np.diag(classical))
    # what the data cannot tell apart, whatever their noise: from J^T J alone
    entangled = classical / np.outer(*2 * [np.where(slant > 0.0, slant, 1.0)])
    np.fill_diagonal(entangled, 1.0)
    classical_spread = np.where(at_bound, np.nan, np.sqrt(np.diag(classical)) * slope)
    outcome.times |= {"total": clock.seconds, "compile": clock.compiling}
    values = total.unpack(outcome.x, channels)
    kept = [
        held(t, {v.param: float(np.ravel(values[v.name])[0]) for v in total.variables if v.term == n})
        for n, t in enumerate(total.terms)
    ]
    return FitResult(
        model=total.name,
        channels=points.channels,
        values=values,
        stderr=_named(total, np.where(at_bound, np.nan, spread * slope), channels),
        stderr_classical=_named(total, classical_spread, channels),
        fixed={t.label: h[0] for t, h in zip(total.terms, kept, strict=True)},
        fixed_from={t.label: h[1] for t, h in zip(total.terms, kept, strict=True)},
        correlation=correlation,
        labels=labels,
        metrics=measures,
        error_by_theta=by_theta,
        points={
            "directions": int(points.theta_i.size),
            "residuals": outcome.residuals,
            "saturated": int(points.saturated.sum()),
            "left_out": points.left_out,
            "least_roughness": least_roughness(total),
        },
        loss={
            "residual": options.loss,
            "meaning": f"ln(f + {fitter.floor:.2g}/sr)" if options.loss == "log" else MEANING[options.loss],
            "floor": fitter.floor,
            "robust": None if options.robust is None else "soft-L1",
            "robust_scale": outcome.scale,
            "noise_floor": options.noise_floor,
        },
        starts={"tried": outcome.tried, "agreed": outcome.agreed, "costs": outcome.start_costs},
        solver=_solver(outcome, options, bias, fitter.integrates),
        cost=outcome.cost,
        bic=_bic(outcome, len(labels)),
        times=outcome.times,
        source=points.source,
        sampling=points.sampling,
        total=total,
        warnings=doubts(
            outcome,
            labels,
            outer,
            np.where(at_bound, 0.0, spread * slope),
            entangled,
            at_bound,
            bias,
            measures,
            by_theta,
            judged,
            noise,
            least_roughness(total),
            None if near is None else _error_at(fitter, outcome.x, near),
            _cause(total, made or {}, [h[0] for h in kept], [n for n, b in zip(labels, at_bound, strict=True) if b]),
        ),
    )


def _error_at(fitter: Fitter, x: Array, points: Dataset) -> float:
    """Return the cosine-weighted error of a fit at other points than its own, relative to the data there."""
    fitted = fitter.predict(x, points.theta_i, points.theta_o, points.phi)
    return metrics(fitted, points.values, points.valid, points.theta_i, points.theta_o)["cosine_rms"]


def _cause(total: Sum, made: Mapping[str, Any], kept: Sequence[Mapping[str, Any]], bound: Sequence[str]) -> str:
    """Return what to look at first where a fit is poor: choices other than the data's, bounds, the shape."""
    for term, values in zip(total.terms, kept, strict=True):
        for name, value in of_data(term.label, term.model, made).items():
            if name in values and values[name] != value and term.model.param(name).kind == "choice":
                return f"the data were made with {name} = {value}, this fit holds {name} = {values[name]}"
    if bound:
        return f"{', '.join(bound)} end{'s' if len(bound) == 1 else ''} on a bound: the data pull beyond it"
    distributions = any(t.model.ndfs for t in total.terms)
    return f"try another {'ndf, ' if distributions else ''}model or sum of models"


def _solver(outcome: Outcome, options: Options, bias: Array, integrates: bool) -> dict[str, Any]:
    """Return what the solver says of itself; closed forms have no rule and no bias by it."""
    return {
        "method": options.method,
        "verdict": outcome.verdict,
        "steps": outcome.steps,
        "rule": outcome.rule if integrates else None,
        "bias_in_standard_errors": float(np.abs(bias).max()) if integrates else None,
        "standard_errors": "sandwich, clustered by direction",
    }


def _bic(outcome: Outcome, free: int) -> float:
    """Return the Bayesian information criterion of normal residuals."""
    n = outcome.residuals
    return n * math.log(max(2.0 * outcome.cost / n, 1e-300)) + free * math.log(n)


def _outer(total: Sum, x: Array, channels: int) -> tuple[Array, Array]:
    """Return the parameters of a vector entry by entry, and d parameter / d coordinate."""
    variables = [*total.shared, *list(total.own) * channels]
    outer = np.array([float(v.outer(u)) for v, u in zip(variables, x, strict=True)])
    return outer, np.array([float(v.slope(o)) for v, o in zip(variables, outer, strict=True)])


def _named(total: Sum, entries: Array, channels: int) -> dict[str, Any]:
    """Return entries as floats and arrays (C,) by parameter."""
    ns = len(total.shared)
    found: dict[str, Any] = {v.name: float(entries[n]) for n, v in enumerate(total.shared)}
    block = entries[ns:].reshape(channels, len(total.own))
    found |= {v.name: block[:, n].copy() for n, v in enumerate(total.own)}
    return {v.name: found[v.name] for v in total.variables}
