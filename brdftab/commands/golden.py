"""Commands on golden tables: ``golden record`` and ``golden check``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from brdftab.commands.nearest_words import Group
from brdftab.commands.progress import progress_bar

if TYPE_CHECKING:
    from brdftab.golden.check import Checked

_only = click.option(
    "--only", multiple=True, metavar="PATTERN", help="Files to confine it to, as smith.points.npz or 'smith*'; repeats."
)
_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")


@click.group(cls=Group, epilog="\b\nExample:\n  brdftab golden check tests/golden --only 'lambert*'")
def golden() -> None:
    """Record small tables of every model, and check that the numbers still hold."""


@golden.command(epilog="\b\nExample:\n  brdftab golden record golden --only 'smith*' --overwrite")
@click.argument("folder")
@_only
@click.option("--overwrite", is_flag=True, help="Write anew also what exists; else it is kept.")
@_json
def record(folder: str, only: tuple[str, ...], overwrite: bool, as_json: bool) -> None:
    """Write the golden tables that FOLDER lacks: every model's values, and the tables of its tables.toml.

    Every distribution with every kind of reflectance, and every other choice once: values, components, albedo, density
    and draws of sampling. SOURCES.json says where each file is from.
    """
    from brdftab.golden.record import record_golden

    with progress_bar("recording") as report:
        written = record_golden(folder, only=only, overwrite=overwrite, progress=report)
    if as_json:
        click.echo(json.dumps({"folder": folder, "written": written}, indent=2))
        return
    for name in written:
        click.echo(f"{name}: written")
    if not written:
        click.echo("nothing to write: all golden tables are there; --overwrite records them anew")


@golden.command(epilog="\b\nExample:\n  brdftab golden check tests/golden --only 'lambert*' --json")
@click.argument("folder")
@_only
@click.option("--figure-dir", metavar="DIR", help="Existing folder for a figure of each file that differs.")
@click.option("--overwrite", is_flag=True, help="Replace existing figures.")
@click.option("--stop", is_flag=True, help="End with the first file that does not hold.")
@click.option("--jobs", type=int, default=1, help="Processes that share the models [default: 1].")
@_json
@click.pass_context
def check(
    ctx: click.Context,
    folder: str,
    only: tuple[str, ...],
    figure_dir: str | None,
    overwrite: bool,
    stop: bool,
    jobs: int,
    as_json: bool,
) -> None:
    """Compute the golden tables of FOLDER again; exit status 0 when all hold, 1 when any does not, 2 on an error.

    The worst numbers of each file that differs are listed. A model of the registry without a file counts as one that
    does not hold.
    """
    from brdftab.golden.check import check_golden

    with progress_bar("checking") as report:
        results = check_golden(
            folder, only=only, figure_dir=figure_dir, overwrite=overwrite, stop=stop, jobs=jobs, progress=report
        )
    if as_json:
        click.echo(json.dumps([result.to_json() for result in results], indent=2, allow_nan=False))
    else:
        for result in results:
            for text in _lines(result):
                click.echo(text, err=result.status == "error")
    statuses = {result.status for result in results}
    ctx.exit(2 if "error" in statuses else 1 if statuses - {"equal"} else 0)


def _lines(result: Checked) -> list[str]:
    """Say how one file compares."""
    found = result.found
    if result.message:
        return [f"{result.file}: {result.message}"]
    if result.status == "equal":
        return [f"{result.file}: holds in all {found.total:,} numbers (max relative difference {found.largest:.2g})"]
    lines = [
        f"{result.file}: {found.differing:,} of {found.total:,} numbers differ by more than {result.rtol:g}; worst"
    ]
    for cell in found.worst:
        at = ", ".join(f"{name} {value:.6g}" for name, value in cell.degrees.items())
        lines.append(
            f"  {cell.where} at {at} deg: golden {cell.golden:.9g}, now {cell.now:.9g}, relative {cell.relative:.2g}"
        )
    return lines + ([f"  figure {result.figure}"] if result.figure else [])
