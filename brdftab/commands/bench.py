"""The command ``bench``: error against run time, and comparisons of two runs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from typing import Any

import click

from brdftab.commands.nearest_words import Choice
from brdftab.commands.options import given_parameters, model_options
from brdftab.commands.progress import progress_bar

_CHANGED = 1


def _one_of_many(command: Callable[..., Any]) -> Callable[..., Any]:
    """Let ``--model`` be left out: --all, --list and --compare say what to do as well."""
    for param in getattr(command, "__click_params__", []):
        if param.name == "model":
            param.required = False
    return command


@click.command(
    epilog="\b\nExamples:\n"
    "  brdftab bench --model smith-multi --alpha 0.5 --out bench.json --figure bench.svg\n"
    "  brdftab bench --list materials.toml --json\n"
    "  brdftab bench --compare old.json new.json --slower 1.3"
)
@_one_of_many
@model_options
@click.option("--all", "everything", is_flag=True, help="Every model of the registry with its defaults.")
@click.option("--list", "list_file", metavar="TOML", help="Every [[bench]] of a file: model and its parameters.")
@click.option("--compare", nargs=2, metavar="OLD NEW", help="Compare two JSON files; status 1 if slower or worse.")
@click.option("--grid", metavar="IxOxP", help="Cells that every method fills, three axes or four [default: 16x16x32].")
@click.option("--quick", is_flag=True, help="Few cells, rungs and repeats; says little about time.")
@click.option("--repeats", type=int, help="Most timed calls of a method [default: 25].")
@click.option("--seconds", type=float, help="Time for the timed calls of a method [default: 0.5].")
@click.option("--limit", type=float, help="CPU seconds of a run after which finer rungs are left out [default: 3].")
@click.option("--threads", type=click.IntRange(min=1), help="Numba threads [default: all].")
@click.option("--no-peers", "alone", is_flag=True, help="Leave out other programs (Mitsuba 3, SciPy).")
@click.option(
    "--error",
    type=Choice(["l1", "l2", "max", "albedo"]),
    default="l1",
    help="Error of the figure and of the marks [default: l1].",
)
@click.option(
    "--time",
    "clock",
    type=Choice(["kernel", "total"]),
    default="kernel",
    help="Run time of the figure and of the marks: kernel, or end to end [default: kernel].",
)
@click.option("--slower", type=float, help="Ratio of times above which --compare fails [default: 1.5].")
@click.option("--worse", type=float, help="Ratio of errors above which --compare fails [default: 1.5].")
@click.option("--out", metavar="FILE", help="Write the results as JSON.")
@click.option("--figure", metavar="FILE", help="Draw error against run time: .svg, .png or .pdf.")
@click.option("--overwrite", is_flag=True, help="Replace existing outputs.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
@click.pass_context
def bench(
    ctx: click.Context,
    /,
    model: str | None,
    everything: bool,
    list_file: str | None,
    compare: tuple[str, str] | None,
    **options: Any,
) -> None:
    """Measure error against run time of every method that computes a model: rules, caps, estimators, stand-ins, twin.

    Errors are relative to a converged reference whose own uncertainty is stated; * marks methods that no other one
    beats in both.
    """
    from brdftab.errors import ParameterError

    asked = {"model": model, "all": everything, "list": list_file, "compare": compare}
    named = [name for name, value in asked.items() if value]
    if len(named) != 1:
        what = f"{' and '.join('--' + n for n in named)} exclude each other" if named else "nothing to measure is named"
        raise ParameterError(f"{what}; give one of --model, --all, --list, --compare")
    given = given_parameters(model or "", options)
    if given and model is None:
        raise ParameterError(f"{', '.join(given)} belong to --model, not to --{named[0]}; leave them out")
    _check_outputs(options, named[0])
    if compare is not None:
        ctx.exit(_compare(compare, options))
    _measure(_asked(model, given, list_file), options)


def _check_outputs(options: dict[str, Any], mode: str) -> None:
    """Refuse outputs that cannot be written, and options without meaning, before anything is measured."""
    from brdftab.errors import ParameterError
    from brdftab.io.atomic import check_target

    idle = {
        "compare": ("grid", "repeats", "seconds", "limit", "threads", "figure", "out"),
    }
    for name in idle.get(mode, ("slower", "worse")):
        if options[name] is not None:
            raise ParameterError(f"{name} = {options[name]} has no meaning for --{mode}; leave it out")
    for path in (options["out"], options["figure"]):
        if path is not None:
            check_target(path, overwrite=options["overwrite"])
    if options["figure"] is not None:
        from brdftab.plotting.figure import check_ending

        check_ending(options["figure"], "figure")


def _asked(model: str | None, given: dict[str, Any], list_file: str | None) -> list[tuple[str, dict[str, Any]]]:
    """Return models with their parameters."""
    from brdftab.bench.lists import read_list
    from brdftab.models import names

    if model is not None:
        return [(model, given)]
    return read_list(list_file) if list_file is not None else [(name, {}) for name in names()]


def _measure(what: list[tuple[str, dict[str, Any]]], options: dict[str, Any]) -> None:
    """Measure, print and write."""
    from brdftab.bench.lists import document, write_results
    from brdftab.bench.report import table
    from brdftab.bench.run import benchmark
    from brdftab.models.resolve import resolve

    for name, given in what:
        resolve(name, **given)
    results = []
    settings = {key: options[key] for key in ("quick", "repeats", "seconds", "limit", "threads")}
    with progress_bar("measuring") as report:
        for number, (name, given) in enumerate(what):

            def share(part: float, number: int = number) -> None:
                if report is not None:
                    report((number + part) / len(what))

            results.append(
                benchmark(name, options["grid"], peer=not options["alone"], progress=share, **settings, **given)
            )
    data = document(results)
    if options["out"] is not None:
        write_results(data, options["out"], overwrite=options["overwrite"])
    if options["figure"] is not None:
        from brdftab.bench.figure import draw

        draw(results, options["figure"], error=options["error"], time=options["clock"], overwrite=options["overwrite"])
    if options["as_json"]:
        click.echo(json.dumps(data, indent=1, allow_nan=False))
        return
    for result in results:
        for line in table(result, options["error"], options["clock"]):
            click.echo(line)
    _tell_written(options)


def _tell_written(options: dict[str, Any]) -> None:
    for path in (options["out"], options["figure"]):
        if path is not None:
            click.echo(f"wrote {os.fspath(path)}")


def _compare(files: tuple[str, str], options: dict[str, Any]) -> int:
    """Compare two runs, print, and return the exit status."""
    from brdftab.bench import compare
    from brdftab.bench.lists import read_results

    old, new = (read_results(path) for path in files)
    bounds = {name: options[name] for name in ("slower", "worse") if options[name] is not None}
    changes = compare.compare(old, new, **bounds)
    failed = any(change.failed for change in changes)
    if options["as_json"]:
        data = {"old": files[0], "new": files[1], "failed": failed, "changes": [c.to_json() for c in changes]}
        click.echo(json.dumps(data, indent=1, allow_nan=False))
    else:
        for line in compare.lines(changes):
            click.echo(line)
    return _CHANGED if failed else 0
