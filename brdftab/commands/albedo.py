"""The command ``albedo``: tables of directional and average albedo."""

from __future__ import annotations

import json
import math
from typing import Any

import click

from brdftab.commands.options import given_parameters, model_options
from brdftab.commands.progress import progress_bar


def _values(text: str | None) -> list[float] | None:
    """Return the numbers of ``start:stop:count`` or ``a,b,c``."""
    if text is None:
        return None
    from brdftab.errors import ParameterError

    words = text.split(":")
    try:
        if len(words) == 3 and words[2].strip().isdigit() and 2 <= int(words[2]) <= 4096:
            low, high, count = float(words[0]), float(words[1]), int(words[2])
            return [low + (high - low) * n / (count - 1) for n in range(count)]
        found = [float(word) for word in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(map(math.isfinite, found)):
        raise ParameterError(f"roughness = {text!r} is malformed; write start:stop:count as 0.05:1:20, or 0.1,0.5")
    return found


@click.command(
    epilog="\b\nExamples:\n"
    "  brdftab albedo --model smith-multi --ndf ggx --material mirror --max-bounces 1 --roughness 0.05:1:20\n"
    "  brdftab albedo --model smith-multi --ior 1.5 --alpha 0.3 --out glass.exr --out glass.npz"
)
@model_options
@click.option(
    "--cosines",
    type=int,
    default=32,
    help="Cells in the cosine of the fixed direction [default: 32].",
)
@click.option("--roughness", metavar="LIST", help="Rows of alpha (sigma): start:stop:count or a,b,c [default: one].")
@click.option(
    "--out", "outs", multiple=True, metavar="FILE", help="Output, .exr or .npz; may be repeated [default: albedo.exr]."
)
@click.option(
    "--fixed",
    type=click.Choice(["light", "view"]),
    default="light",
    help="Whose cosine it is: the light's (views are integrated over) or the view's [default: light].",
)
@click.option("--tolerance", type=float, default=1e-4, help="Absolute error asked [default: 1e-4].")
@click.option("--overwrite", is_flag=True, help="Replace existing outputs.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def albedo(
    model: str,
    cosines: int,
    roughness: str | None,
    outs: tuple[str, ...],
    fixed: str,
    tolerance: float,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Tabulate directional and average albedo over cosine and roughness, as renderers need for compensation.

    EXR: part albedo has a row a roughness and a column a cosine of theta_i; part average has one column. Surfaces that
    transmit get the layers transmitted, reflected_below and transmitted_below beside it: the last two are of light (or,
    with --fixed view, of views) from below. Both choices of --fixed give the same for reciprocal models, but for n^2 of
    what passes an interface; for others, such as a compensation scaled by the view, they do not.
    """
    from brdftab.errors import ParameterError
    from brdftab.io import check_output
    from brdftab.tabulation.albedo_table import tabulate_albedo, write_albedo

    paths = outs or ("albedo.exr",)
    if len(set(paths)) != len(paths):
        raise ParameterError(f"out = {', '.join(paths)} names a file twice; give each once")
    for path in paths:
        check_output(path, overwrite=overwrite)
    rows = _values(roughness)
    with progress_bar("integrating") as report:
        table = tabulate_albedo(
            model,
            cosines=cosines,
            roughness=rows,
            tolerance=tolerance,
            fixed=fixed,
            progress=report,
            **given_parameters(model, options),
        )
    for path in paths:
        write_albedo(table, path, overwrite=overwrite)
    made = table.provenance
    if as_json:
        averages = {name: values.tolist() for name, values in table.average.items()}
        facts = {**table.metadata(), "average": averages, "files": list(paths)}
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
    else:
        click.echo(f"model        {model}")
        count = f"{len(table.cosines)} cosines of the {table.fixed}"
        click.echo(f"table        {len(table.roughness)} x {made['roughness_parameter']}, {count}")
        for name, values in table.average.items():
            for rough, row in zip(table.roughness, values, strict=True):
                click.echo(f"average      {name}, {rough:g}: " + "  ".join(f"{v:.6f}" for v in row))
        click.echo(f"error        {made['error']['estimate']:.1e} estimated, run time {made['run_time_s']:.2f} s")
        for path in paths:
            click.echo(f"wrote        {path}")
    if not made["error"]["met"]:
        click.echo(
            f"Warning: the estimated error {made['error']['estimate']:.1e} exceeds tolerance {tolerance:g}; ask for a "
            "looser one",
            err=True,
        )
