"""The public way into fitting: one call from data to a result, and the ranking of several models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from brdftab.errors import BrdftabError, ParameterError
from brdftab.fit.data import Dataset, dataset, suspicions
from brdftab.fit.losses import LOSSES
from brdftab.fit.parameters import parse, shares
from brdftab.fit.result import FitResult
from brdftab.fit.solver import MAX_STEPS, SOLVERS
from brdftab.fit.source import Source, load
from brdftab.fit.stages import STARTS, Options
from brdftab.fit.verdict import fit_points
from brdftab.tables.measurement import Measurement
from brdftab.tables.table import Table
from brdftab.timing import Clock

THETA_MAX = math.radians(75.0)
# directions that show whether a lobe is a spike
NEAR = 4000
METRICS = ("logeps", "log_rms", "cube_root_rms", "cosine_rms", "l1p")


def fit_model(
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
        Registry name, or several joined by ``+`` for their sum.
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
        one that the table's own provenance names, else the model's default.

    Returns
    -------
    FitResult
        Values, standard errors, warnings, metrics; see there.

    Raises
    ------
    ParameterError
        For unknown or conflicting parameters, and models without a twin.
    BrdftabError
        If no value is valid, or none of one channel.
    """
    options = _options(loss, robust, noise_floor, solver, starts, start, max_steps, seed)
    given = {**fixed_parameters, **(fixed or {})}
    if not isinstance(model, str):
        raise ParameterError(f"model = {model!r} is no name; give one, or a sum as smith+lambert")
    if "," in model:
        raise ParameterError(f"model = {model} names several; rank_models(data, [...]) fits and ranks them")
    where = {
        "theta_max": theta_max,
        "sampling": sampling,
        "samples": samples,
        "seed": seed,
        "saturation": saturation,
        "positive": loss == "log",
    }
    return _fit_all(data, [(model, given)], free, options, where)[0]


def rank_models(
    data: Source,
    models: Sequence[str],
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
) -> list[FitResult]:
    """Fit several models to the same points and return the results, best first by BIC.

    Parameters
    ----------
    data : Table, Measurement, str or path-like
        As for `fit_model`.
    models : sequence of str
        Names, or sums of names joined by ``+``, as ``["lambert", "smith+lambert"]``.
    free, theta_max, loss, robust, sampling, samples, seed, saturation, noise_floor, solver, starts, start, max_steps
        As for `fit_model`, the same for every model.
    fixed, **fixed_parameters
        As for `fit_model`; each model takes what it knows.

    Returns
    -------
    list of FitResult
        Best first by the Bayesian information criterion, residuals counted as independent.

    Raises
    ------
    ParameterError
        As for `fit_model`, and for a parameter that no model of the list has.
    BrdftabError
        If no value is valid, or none of one channel.
    """
    options = _options(loss, robust, noise_floor, solver, starts, start, max_steps, seed)
    if isinstance(models, str) or not models or not all(isinstance(name, str) for name in models):
        raise ParameterError(f"models = {models!r} is no list of names; give one, as ['smith', 'smith+lambert']")
    named = shares(",".join(models), {**fixed_parameters, **(fixed or {})})
    where = {
        "theta_max": theta_max,
        "sampling": sampling,
        "samples": samples,
        "seed": seed,
        "saturation": saturation,
        "positive": loss == "log",
    }
    return sorted(_fit_all(data, named, free, options, where), key=lambda r: r.bic)


def _fit_all(
    data: Source,
    named: Sequence[tuple[str, Mapping[str, Any]]],
    free: Sequence[str] | str | None,
    options: Options,
    where: dict[str, Any],
) -> list[FitResult]:
    """Fit sums, by name and fixed parameters, to the same points of data that are read once."""
    clock = Clock()
    source = load(data)
    made = source.provenance if isinstance(source, Table) else {}
    sums = [parse(name, _names(free), dict(part), made) for name, part in named]
    theta_max, seed = where["theta_max"], where["seed"]
    points = dataset(source, **{**where, "theta_max": THETA_MAX if theta_max is None else theta_max})
    near = _near_mirror(source, theta_max, seed)
    doubted = suspicions(source, theta_max, seed)
    results = []
    for total in sums:
        results.append(fit_points(total, points, options, made, near))
        results[-1].warnings += doubted
        results[-1].times |= {"total": clock.seconds, "compile": clock.compiling}
        clock = Clock()
    return results


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
