"""The command ``check``: what must hold of a model, measured."""

from __future__ import annotations

import json

import click

from brdftab.cli.progress import progress_bar

_GREEN, _RED = 0, 1


@click.command(
    epilog="\b\nExamples:\n"
    "  brdftab check --model smith --fast\n"
    "  brdftab check --model ilm --property reciprocity --property energy --json\n"
    "  brdftab check --all --fast"
)
@click.option("--model", metavar="NAME", help="Model of the registry; see brdftab models.")
@click.option("--all", "everything", is_flag=True, help="Every model of the registry.")
@click.option("--property", "only", multiple=True, metavar="NAME", help="Only this property; may be repeated.")
@click.option("--fast", is_flag=True, help="An even choice of settings and directions: seconds a model.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
@click.pass_context
def check(
    ctx: click.Context,
    model: str | None,
    everything: bool,
    only: tuple[str, ...],
    fast: bool,
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
    with progress_bar("checking") as report:
        found = run(model, fast=fast, only=only, progress=report)
    if as_json:
        click.echo(json.dumps(found.to_json(), indent=2, allow_nan=False))
    else:
        click.echo("\n".join(found.lines()))
    ctx.exit(_GREEN if found.green else _RED)
