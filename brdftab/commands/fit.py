"""The command that fits: ``fit``."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import click

from brdftab.commands.nearest_words import Choice
from brdftab.commands.options import declared, in_api_units, model_options

if TYPE_CHECKING:
    from brdftab.fit.result import FitResult

LOSSES = ("log", "logeps", "cbrt", "cosine", "l1p")
SOLVERS = ("levenberg-marquardt", "dogleg")
# what is said of a held parameter by where it comes from
ORIGIN = {"user": "", "file": " (from the file)", "default": " (default)"}


@click.command(
    epilog="\b\nExamples:\n"
    "  brdftab fit data.npz --model ilm\n"
    "  brdftab fit data.npz --model ilm --free kd,sigma --ior 1.5 --theta-max 60 --out fit.json\n"
    "  brdftab fit data.npz --model ilm,smith+lambert --loss logeps --json\n"
    "  brdftab fit data.npz --model smith+lambert --ndf beckmann --predict fit.exr",
)
@click.argument("data", type=click.Path())
@model_options
@click.option("--free", metavar="NAMES", help="Parameters to fit, as kd,sigma or smith.alpha [default: all, f0].")
@click.option(
    "--fix", "fixes", multiple=True, metavar="NAME=VALUE", help="Fix a parameter of one term: smith2.alpha=.3."
)
@click.option("--start", "begin", multiple=True, metavar="NAME=VALUE", help="Start value of a free parameter.")
@click.option("--theta-max", type=float, default=75.0, help="Largest polar angle [degrees; default: 75].")
@click.option("--loss", type=Choice(LOSSES), default="log", help="What residuals compare [default: log].")
@click.option("--robust", metavar="SCALE", help="Soft-L1 with this scale of the residual, or auto.")
@click.option(
    "--sampling",
    type=Choice(["uniform", "mirror", "solid-angle", "grid"]),
    default="uniform",
    help="Directions uniform in the angles, half around the mirror direction, views uniform over the solid angle, or "
    "all cells [default: uniform].",
)
@click.option("--samples", type=int, default=20000, help="Directions to draw [default: 20000].")
@click.option("--saturation", type=float, help="Value from which on data are clipped [1/sr].")
@click.option("--noise-floor", type=float, default=0.0, help="Value below which noise is additive [1/sr; default: 0].")
@click.option("--solver", type=Choice(SOLVERS), default=SOLVERS[0], help=f"Solver [default: {SOLVERS[0]}].")
@click.option("--starts", type=int, default=8, help="Starts to try [default: 8].")
@click.option("--seed", type=int, default=0, help="Seed of directions and starts [default: 0].")
@click.option("--out", type=click.Path(), metavar="FILE", help="Write the result as JSON.")
@click.option("--predict", "predicted", metavar="FILE", help="Write the fitted table, .exr or .npz.")
@click.option("--grid", metavar="IxOxP", help="Grid of the fitted table [default: 90x90x180].")
@click.option("--overwrite", is_flag=True, help="Replace existing outputs.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def fit(
    data: str,
    model: str,
    free: str | None,
    fixes: tuple[str, ...],
    begin: tuple[str, ...],
    theta_max: float,
    robust: str | None,
    out: str | None,
    predicted: str | None,
    grid: str | None,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Fit models to a table or measurement (EXR, NPZ, MERL, RGL): values, errors, warnings.

    NAME may be a sum, as smith+lambert, or several separated by commas, which are then ranked; --predict writes the
    best by BIC. Choices such as --ndf and --masking are those that a table was made with unless given.
    """
    from brdftab.errors import ParameterError
    from brdftab.fit.api import fit_model, rank
    from brdftab.fit.source import load
    from brdftab.io import check_output, write
    from brdftab.io.atomic import check_target, write_text

    names = [n.strip() for n in model.split(",")]
    if grid and not predicted:
        raise ParameterError(f"grid = {grid} needs --predict beside it")
    if predicted:
        check_output(predicted, overwrite=overwrite, name="predict")
    if out:
        check_target(out, overwrite=overwrite)
    more = ("loss", "sampling", "samples", "saturation", "noise_floor", "solver", "starts", "seed")
    how = {n: options.pop(n) for n in more}
    source = load(data)
    results = []
    for name in names:
        fixed = {**_fixed(name, options, names), **_pairs("fix", fixes, name)}
        start = _pairs("start", begin, name)
        turned = math.radians(theta_max)
        results.append(
            fit_model(source, name, free, theta_max=turned, robust=_robust(robust), fixed=fixed, start=start, **how)
        )
    best = min(results, key=lambda r: r.bic)
    facts: dict[str, Any] = best.to_json()
    if len(results) > 1:
        facts = {"fits": [r.to_json() for r in results], "ranking": rank(results)}
    text = json.dumps(facts, indent=2, allow_nan=False)
    if out:
        write_text(out, text + "\n", overwrite=overwrite)
    if predicted:
        write(best.predict(grid), predicted, overwrite=overwrite)
    if as_json:
        click.echo(text)
        return
    for result in results:
        _show(result)
    if len(results) > 1:
        _show_ranking(results, facts["ranking"])
    if out:
        click.echo(f"wrote        {out}")
    if predicted:
        click.echo(f"wrote        {predicted}" + (f" ({best.model}, the best by BIC)" if len(results) > 1 else ""))


def _robust(text: str | None) -> float | str | None:
    """Return the scale of the robust loss."""
    if text is None or text == "auto":
        return text
    try:
        return float(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is neither auto nor a number", param_hint="'--robust'") from None


def _fixed(model: str, options: dict[str, Any], listed: list[str]) -> dict[str, Any]:
    """Return the fixed parameters of a sum by qualified name, in API units.

    Where several models are ranked, each takes what it knows.
    """
    from brdftab.errors import ParameterError, proposal
    from brdftab.fit.parameters import term_labels
    from brdftab.models import names, spec

    terms = [(label, spec(name)) for label, name in term_labels(model)]
    known = {p.name for one in listed for _, n in term_labels(one) if n in names() for p in spec(n).params}
    found: dict[str, Any] = {}
    for name, value in options.items():
        if value is None or name not in declared():
            continue
        if name not in known:
            near = proposal(name, known)
            raise ParameterError(
                f"{name} is not a parameter of {', '.join(listed)}; {near}{'T' if near else 't'}hey take "
                f"{', '.join(sorted(known))}"
            )
        for label, one in terms:
            if one.has(name):
                found[f"{label}.{name}"] = in_api_units(one.param(name), value)
    return found


def _unit(model: str, name: str) -> str:
    """Return the unit of a parameter that may be qualified by its term."""
    from brdftab.errors import ParameterError
    from brdftab.fit.parameters import term_labels
    from brdftab.models import spec

    label, _, param = name.rpartition(".")
    owners = [(at, spec(n)) for at, n in term_labels(model) if not label or at == label]
    units = {one.param(param).unit: at for at, one in owners if one.has(param)}
    if len(units) > 1:
        more = ", ".join(f"{at}.{param}" for at in units.values())
        raise ParameterError(f"{name} is an angle in one term and none in another; name the one that is meant: {more}")
    return next(iter(units), "")


def _pairs(option: str, texts: tuple[str, ...], model: str) -> dict[str, Any]:
    """Read NAME=VALUE pairs; numbers in degrees where the parameter is an angle."""
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise click.BadParameter(f"{text!r} is not NAME=VALUE, as smith2.alpha=0.3", param_hint=f"'--{option}'")
        try:
            numbers = [float(x) for x in value.split(",")]
        except ValueError:
            found[name] = value
            continue
        turn = math.radians if _unit(model, name) == "rad" else float
        found[name] = [turn(x) for x in numbers] if len(numbers) > 1 else turn(numbers[0])
    return found


def _shown(result: FitResult, name: str, value: float) -> float:
    """Return a parameter in the command line's unit."""
    return math.degrees(value) if _unit(result.model, name) == "rad" else value


def _held(result: FitResult, name: str, value: Any) -> str:
    """Return a held value in the command line's unit."""
    if isinstance(value, list | tuple):
        return ",".join(_held(result, name, v) for v in value)
    return f"{_shown(result, name, value):.6g}" if isinstance(value, float) else str(value)


def _show(result: FitResult) -> None:
    """Print one fit."""
    click.echo(f"model        {result.model}")
    fixed = [
        f"{label}.{name} = {_held(result, f'{label}.{name}', value)}{ORIGIN[result.fixed_from[label][name]]}"
        for label, given in result.fixed.items()
        for name, value in given.items()
    ]
    if fixed:
        click.echo(f"fixed        {', '.join(fixed)}")
    points = result.points
    left = [f"{max(n):,} {reason}" for reason, n in points["left_out"].items() if max(n)]
    click.echo(
        f"data         {result.source}: {points['directions']:,} directions ({result.sampling}), "
        f"{points['residuals']:,} residuals of {result.loss['meaning']}"
    )
    if left:
        click.echo(f"left out     {', '.join(left)} (the channel with most)")
    if points["saturated"]:
        click.echo(f"saturated    {points['saturated']:,} values count only where the fit is lower")
    for name, value in result.values.items():
        unit = " degrees" if _unit(result.model, name) == "rad" else ""
        error = result.stderr[name]
        if isinstance(value, float):
            click.echo(f"{name:<12} {_number(_shown(result, name, value), _shown(result, name, error))}{unit}")
            continue
        parts = [f"{c} {_number(v, e)}" for c, v, e in zip(result.channels, value, error, strict=True)]
        click.echo(f"{name:<12} {'   '.join(parts)}{unit}")
    metrics = {k: v for k, v in result.metrics.items() if v is not None}
    click.echo("errors       " + ", ".join(f"{k} {v:.4g}" for k, v in metrics.items()))
    starts, solver, times = result.starts, result.solver, result.times
    click.echo(
        f"solver       {solver['method']}: {solver['verdict']} in {solver['steps']} steps; "
        f"{starts['agreed']} of {starts['tried']} starts agree"
    )
    click.echo(
        f"time         {times['total']:.3g} s, and {times['compile']:.3g} to compile: starts {times['starts']:.3g}, "
        f"first stage {times['first_stage']:.3g}, polish {times['polish']:.3g}"
    )
    for line in result.warnings:
        click.echo(f"warning      {line}")


def _number(value: float, error: float) -> str:
    """Return a value with as many digits as its standard error justifies."""
    if not error > 0.0:
        return f"{value:.6g} (on its bound)"
    digits = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{min(digits, 12)}f} +- {error:.2g}"


def _show_ranking(results: list[FitResult], order: dict[str, list[str]]) -> None:
    """Print several fits side by side, best first by BIC."""
    by_name = {r.model: r for r in results}
    columns = ["bic", *[k for k in order if k != "bic"]]
    width = max(12, *(len(r.model) for r in results))
    click.echo(f"{'ranking':<{width}}" + "".join(f"{c:>16}" for c in columns))
    for name in order["bic"]:
        result = by_name[name]
        numbers = [result.bic, *(result.metrics[c] or 0.0 for c in columns[1:])]
        marks = ["*" if order[c][0] == name else " " for c in columns]
        cells = "".join(f"{n:>15.6g}{m}" for n, m in zip(numbers, marks, strict=True))
        click.echo(f"{name:<{width}}{cells}")
    click.echo("* best")
