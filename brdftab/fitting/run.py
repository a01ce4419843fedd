"""The public way into fitting: one call from data to a result, and the ranking of several models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import BrdftabError, ParameterError
from brdftab.fitting.data import Dataset, dataset, suspicions
from brdftab.fitting.doubts import doubts
from brdftab.fitting.engine import STARTS, Fitter, Options, Outcome, covariance
from brdftab.fitting.held import held, of_data
from brdftab.fitting.losses import LOSSES, MEANING
from brdftab.fitting.metrics import error_by_theta, log_ratio, metrics
from brdftab.fitting.noise import neighbour_noise
from brdftab.fitting.resolution import least_roughness, resolved
from brdftab.fitting.result import FitResult
from brdftab.fitting.solver import MAX_STEPS, SOLVERS
from brdftab.fitting.source import Source, load
from brdftab.fitting.terms import Sum, parse, shares
from brdftab.measurement import Measurement
from brdftab.table import Table
from brdftab.timing import Clock

Array = NDArray[np.float64]
THETA_MAX = math.radians(75.0)
BINS = 5
# directions that show whether a lobe is a spike
NEAR = 4000
METRICS = ("logeps", "log_rms", "cube_root_rms", "cosine_rms", "l1p")


def fit(
    data: Source,
    model: str,
    free: Sequence[str] | str | None = None,
    *,
    theta_max: float | None = None,
    loss: str = "log",
    robust: float | str | None = None,
    sampling: str = "uniform",
    samples: int = 20000,
    seed: int = 0,
    saturation: float | None = None,
    noise_floor: float = 0.0,
    solver: str = SOLVERS[0],
    starts: int = STARTS,
    start: Mapping[str, Any] | None = None,
    max_steps: int = MAX_STEPS,
    fixed: Mapping[str, Any] | None = None,
    **fixed_parameters: Any,
) -> FitResult:
    """Fit a model, or a sum of models, to measured or tabulated data.

    Parameters
    ----------
    data : Table, Measurement, str or path-like
        A table, or a file that `brdftab.read` reads (EXR, NPZ, MERL, RGL). Validity is a value's, not a cell's.
    model : str
        Registry name, or several joined by ``+``; several of these separated by commas are fitted to the same points.
    free : sequence of str or str, optional
        Parameters to fit, as ``"kd,sigma"``; by default all that can be, with ``f0`` a channel for facets. In a sum a
        name that several terms have is qualified, as ``smith.alpha``; a second smith is ``smith2``.
    theta_max : float, optional
        Largest polar angle of light and view, radians in (0, pi/2]; default 75 degrees.
    loss : {"log", "logeps", "cbrt", "cosine", "l1p"}, optional
        What the residual compares: ln(f + 1e-6 of the data's mean), ln(f + 0.001), cube root of f cos(theta_i),
        f cos(theta_i), ln(1 + f).
    robust : float or "auto", optional
        Scale of the soft-L1 loss in units of the residual; "auto" takes 1.5 times the spread of a first fit.
    sampling : {"uniform", "mirror", "solid-angle", "grid"}, optional
        Directions stratified-uniform in theta_i, theta_o, phi; half of them around the mirror direction; with the views
        uniform over the solid angle; or all cells of the data.
    samples : int, optional
        How many directions to draw.
    seed : int, optional
        Of directions, subsets and starts.
    saturation : float, optional
        Values (1/sr) from which on the data are clipped: there the fit may be higher at no cost.
    noise_floor : float, optional
        Value (1/sr) below which noise is additive rather than proportional.
    solver : {"levenberg-marquardt", "dogleg"}, optional
        Optimistix solver; the first works in the box of the bounds.
    starts : int, optional
        How many starts to try on a subset, at least 1.
    start : mapping, optional
        Start values by name; they hold in every start.
    max_steps : int, optional
        Most steps of one solve.
    fixed : mapping, optional
        Fixed parameters by qualified name, as ``{"smith2.ndf": "beckmann"}``.
    **fixed_parameters
        Fixed parameters by plain name, in API units; choices such as ndf among them. A choice that is not given is the
        one that the table's own provenance names, else the model's default. Of several models each takes what it knows.

    Returns
    -------
    FitResult
        Of several models the best by BIC, the others in its ``alternatives`` in this order.

    Raises
    ------
    ParameterError
        For unknown or conflicting parameters, and models without a twin.
    BrdftabError
        If no value is valid, or none of one channel.
    """
    clock = Clock()
    options = _options(loss, robust, noise_floor, solver, starts, start, max_steps, seed)
    source = load(data)
    made = source.provenance if isinstance(source, Table) else {}
    given = {**fixed_parameters, **(fixed or {})}
    sums = [parse(name, _names(free), part, made) for name, part in shares(model, given)]
    points = dataset(
        source,
        theta_max=THETA_MAX if theta_max is None else theta_max,
        sampling=sampling,
        samples=samples,
        seed=seed,
        saturation=saturation,
        positive=loss == "log",
    )
    near = _near_mirror(source, theta_max, seed)
    doubted = suspicions(source, theta_max, seed)
    results = []
    for total in sums:
        results.append(fit_points(total, points, options, made, near))
        results[-1].warnings += doubted
        results[-1].times |= {"total": clock.seconds, "compile": clock.compiling}
        clock = Clock()
    best, *rest = sorted(results, key=lambda r: r.bic)
    best.alternatives = rest
    return best


def _near_mirror(source: Table | Measurement, theta_max: float | None, seed: int) -> Dataset | None:
    """Return points around the mirror direction that a fit is held against; None where the data have none."""
    top = THETA_MAX if theta_max is None else theta_max
    try:
        return dataset(source, theta_max=top, sampling="mirror", samples=NEAR, seed=seed + 1)
    except BrdftabError:
        return None


def _names(free: Sequence[str] | str | None) -> list[str] | None:
    """Return free parameters as a list."""
    if free is None:
        return None
    return [n.strip() for n in free.split(",")] if isinstance(free, str) else list(free)


def _options(
    loss: str,
    robust: float | str | None,
    noise_floor: float,
    solver: str,
    starts: int,
    start: Mapping[str, Any] | None,
    max_steps: int,
    seed: int,
) -> Options:
    """Check how to fit."""
    if loss not in LOSSES:
        raise ParameterError.not_known("loss", loss, LOSSES)
    if solver not in SOLVERS:
        raise ParameterError.not_known("solver", solver, SOLVERS)
    if isinstance(robust, str) and robust != "auto":
        raise ParameterError(f"robust = {robust} is neither auto nor a positive number; give a scale of the residual")
    if isinstance(robust, int | float) and not (math.isfinite(robust) and robust > 0.0):
        raise ParameterError.out_of_range("robust", robust, "(0, inf)", "give the residual from which on to forgive")
    if not (math.isfinite(noise_floor) and noise_floor >= 0.0):
        raise ParameterError.out_of_range("noise_floor", noise_floor, "[0, inf)", "it is a value in 1/sr")
    for name, count, most in (("starts", starts, 1000), ("max_steps", max_steps, 100_000)):
        if int(count) != count or not 1 <= count <= most:
            raise ParameterError.out_of_range(name, count, f"the whole numbers in [1, {most}]", "how many to allow")
    return Options(loss, robust, noise_floor, solver, int(starts), dict(start or {}), int(max_steps), int(seed))


def fit_points(
    total: Sum,
    points: Dataset,
    options: Options,
    made: Mapping[str, Any] | None = None,
    near: Dataset | None = None,
) -> FitResult:
    """Fit a parsed sum to points: what `fit` does once data and options are settled.

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


def rank(results: Sequence[FitResult]) -> dict[str, list[str]]:
    """Return the models in order, best first, by BIC and by each metric.

    Parameters
    ----------
    results : sequence of FitResult
        Fits of the same points with the same loss.
    """
    order = {"bic": [r.model for r in sorted(results, key=lambda r: r.bic)]}
    for name in METRICS:
        order[name] = [r.model for r in sorted(results, key=lambda r: r.metrics[name] or 0.0)]
    return order
