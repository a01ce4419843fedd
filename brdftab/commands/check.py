"""The command ``check``: what must hold of a model, measured."""

from __future__ import annotations

import json

import click

from brdftab.commands.progress import progress_bar

_GREEN, _RED = 0, 1


@click.command(
    epilog="\b\nExamples:\n"
    "  brdftab check --model smith --fast\n"
    "  brdftab check --model ilm --property reciprocity --property energy --json\n"
    "  brdftab check --all --fast\n"
    "  brdftab check --model ilm --map condition.png"
)
@click.option("--model", metavar="NAME", help="Model of the registry; see brdftab models.")
@click.option("--all", "everything", is_flag=True, help="Every model of the registry.")
@click.option("--property", "only", multiple=True, metavar="NAME", help="Only this property; may be repeated.")
@click.option("--fast", is_flag=True, help="An even choice of settings and directions: seconds a model.")
@click.option("--map", "drawn", metavar="FILE", help="Draw condition and recovery of a fit instead (.png, .pdf, .svg).")
@click.option("--overwrite", is_flag=True, help="Replace an existing figure.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
@click.pass_context
def check(
    ctx: click.Context,
    model: str | None,
    everything: bool,
    only: tuple[str, ...],
    fast: bool,
    drawn: str | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Measure what must hold of a model at ordinary and extreme settings; the worst case of each property.

    Exit status 0 when all holds but for known limits, 1 when something fails, 2 on an error. Each worst case is told
    with the command line that evaluates the model there.
    """
    from brdftab.errors import ParameterError
    from brdftab.validate.run import check as run

    if everything == (model is not None):
        what = f"model = {model} and all exclude each other" if everything else "model is missing"
        raise ParameterError(f"{what}; give --model NAME or --all")
    if drawn is not None:
        _map(model, drawn, overwrite, as_json)
        return
    with progress_bar("checking") as report:
        found = run(model, fast=fast, only=only, progress=report)
    if as_json:
        click.echo(json.dumps(found.to_json(), indent=2, allow_nan=False))
    else:
        click.echo("\n".join(found.lines()))
    ctx.exit(_GREEN if found.green else _RED)


def _map(model: str | None, path: str, overwrite: bool, as_json: bool) -> None:
    """Draw the map of one model's condition."""
    from brdftab.errors import ParameterError
    from brdftab.io.atomic import check_target
    from brdftab.validate.maps import NOISE, condition_map, draw

    if model is None:
        raise ParameterError(f"map = {path} shows one model; give --model NAME")
    check_target(path, overwrite=overwrite)
    with progress_bar("fitting") as report:
        found = condition_map(model, progress=report)
    draw(found, path, overwrite=overwrite)
    if as_json:
        facts = {
            "model": model,
            "roughness": found.roughness.tolist(),
            found.second: found.other.tolist(),
            "condition": found.scaled.tolist(),
            "expected": found.expected.tolist(),
            "recovery": found.recovery.tolist(),
            "figure": path,
        }
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
        return
    click.echo(f"condition    {found.scaled.min():.3g} to {found.scaled.max():.3g} (log residual, scaled)")
    for name, errors in (("expected", found.expected), ("recovery", found.recovery)):
        click.echo(f"{name:<13}{errors.min():.2g} to {errors.max():.2g} relative at {100.0 * NOISE:g} % noise")
    click.echo(f"wrote        {path}")
