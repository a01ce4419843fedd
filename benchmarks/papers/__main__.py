"""The papers' numbers beside ours, as one page; run it from the repository's root.

python -m benchmarks.papers [--quick] [--out docs/results/papers.md --overwrite]
"""

from __future__ import annotations

import json
import sys

import click

from benchmarks.papers import page, suite
from brdftab.commands.progress import progress_bar
from brdftab.errors import BrdftabError
from brdftab.io.atomic import atomic, check_target


@click.command()
@click.option("--quick", is_flag=True, help="A hundredth of the samples; the numbers mean nothing.")
@click.option("--repeats", type=click.IntRange(min=1), help="Most timed calls [default: 9].")
@click.option("--threads", type=click.IntRange(min=1), help="Numba threads [default: all].")
@click.option("--no-peers", "alone", is_flag=True, help="Leave out other programs (Mitsuba 3, SciPy).")
@click.option("--out", metavar="FILE", help="Write the page [default: print it].")
@click.option("--overwrite", is_flag=True, help="Replace an existing page.")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of Markdown.")
def main(
    quick: bool, repeats: int | None, threads: int | None, alone: bool, out: str | None, overwrite: bool, as_json: bool
) -> None:
    """Measure what the papers state beside ours."""
    if out is not None:
        check_target(out, overwrite=overwrite)
    with progress_bar("papers") as report:
        found = suite(quick=quick, repeats=repeats, threads=threads, peer=not alone, progress=report)
    text = json.dumps(found, indent=1, allow_nan=False) + "\n" if as_json else page(found)
    if out is None:
        click.echo(text, nl=False)
        return
    with atomic(out, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
    click.echo(f"wrote {out}")


if __name__ == "__main__":
    try:
        main()
    except BrdftabError as error:
        sys.exit(f"Error: {error}")
