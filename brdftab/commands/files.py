"""Commands on files that exist: ``info``, ``compare``, ``verify``."""

from __future__ import annotations

import json
import math
import os
from typing import TYPE_CHECKING, Any

import click

from brdftab.commands.text import clean, line, number

if TYPE_CHECKING:
    from brdftab.tables.comparison import Comparison
    from brdftab.tables.table import Table

_EQUAL, _DIFFERS, _ERROR = 0, 1, 2

_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
_rtol = click.option("--rtol", type=float, help="Relative tolerance [default: 1e-5 for float32, 1e-9 for float64].")
_atol = click.option("--atol", type=float, help="Absolute tolerance in 1/sr [default: 1e-12 of the largest value].")


@click.command(epilog="\b\nExample:\n  brdftab info vgroove-nonsym.exr\n  brdftab info vgroove-nonsym.npz --json")
@click.argument("file")
@_json
def info(file: str, as_json: bool) -> None:
    """Say what a table holds: grid, channels, convention, what made it, error, run time; or what was measured."""
    from brdftab.io import read
    from brdftab.tables.table import Table

    found = read(file)
    if not isinstance(found, Table):
        from brdftab.commands.measured import show

        show(file, found, as_json)
        return
    facts = _facts(file, found)
    if as_json:
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
        return
    for key in ("file", "bytes", "version", "model", "shape", "dtype", "cell"):
        click.echo(f"{key:<11} {line(facts[key])}")
    for name, axis in facts["axes"].items():
        click.echo(
            f"{name:<11} {axis['count']} positions from {axis['first_degrees']:g} to {axis['last_degrees']:g} deg"
        )
    for key in ("channels", "components", "values"):
        click.echo(f"{key:<11} {line(facts[key]) or '-'}")
    for key in ("convention", "provenance"):
        click.echo(key)
        for name, value in facts[key].items():
            click.echo(f"  {clean(str(name))}: {line(value)}")


@click.command(epilog="\b\nExample:\n  brdftab compare old.exr new.npz --rtol 1e-4 --figure difference.png")
@click.argument("a")
@click.argument("b")
@_rtol
@_atol
@click.option("--figure", metavar="FILE", help="Also draw where they differ (.png, .pdf, .svg).")
@click.option("--overwrite", is_flag=True, help="Replace an existing figure.")
@_json
@click.pass_context
def compare(
    ctx: click.Context,
    a: str,
    b: str,
    rtol: float | None,
    atol: float | None,
    figure: str | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Compare tables A and B cell by cell; exit status 0 when equal, 1 when they differ, 2 on an error.

    Numbers x and y differ where |x - y| > atol + rtol max(|x|, |y|), and where either is NaN.
    """
    from brdftab.tables.comparison import compare as compare_tables

    one, two = _read_table(a), _read_table(b)
    result = compare_tables(one, two, rtol=rtol, atol=atol)
    if figure is not None:
        from brdftab.plotting.difference import difference

        difference(one, two, result, figure, overwrite=overwrite)
    if as_json:
        click.echo(json.dumps({"a": a, "b": b, **result.to_json(), "figure": figure}, indent=2, allow_nan=False))
    else:
        for line in _report(result):
            click.echo(line)
    ctx.exit(_EQUAL if result.equal else _DIFFERS)


@click.command(epilog="\b\nExample:\n  brdftab verify tests/golden/*.npz")
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@_rtol
@_atol
@click.option("--threads", type=click.IntRange(min=1), help="Threads to tabulate with [default: all].")
@_json
@click.pass_context
def verify(
    ctx: click.Context,
    files: tuple[str, ...],
    rtol: float | None,
    atol: float | None,
    threads: int | None,
    as_json: bool,
) -> None:
    """Tabulate again what each FILE says it holds, and compare.

    One line a file; exit status 0 when all repeat, 1 when any differs, 2 when any cannot be verified.
    """
    results = [_verify(file, rtol, atol, threads) for file in files]
    if as_json:
        click.echo(json.dumps(results, indent=2, allow_nan=False))
    else:
        for result in results:
            click.echo(_verdict(result), err=result["status"] == "error")
    statuses = {result["status"] for result in results}
    ctx.exit(_ERROR if "error" in statuses else _DIFFERS if "differs" in statuses else _EQUAL)


def _verify(file: str, rtol: float | None, atol: float | None, threads: int | None) -> dict[str, Any]:
    """Verify one file; an error is a result like another, so that the remaining files are still done."""
    from brdftab._version import __version__
    from brdftab.errors import BrdftabError
    from brdftab.tables.comparison import compare as compare_tables
    from brdftab.validate.reproduce import retabulate

    result: dict[str, Any] = {"file": file, "installed": __version__}
    try:
        table = _read_table(file)
        result |= {"version": table.version}
        outcome = compare_tables(table, retabulate(table, threads=threads), rtol=rtol, atol=atol)
    except BrdftabError as error:
        return result | {"status": "error", "message": str(error)}
    return result | {"status": "equal" if outcome.equal else "differs", "comparison": outcome.to_json()}


def _verdict(result: dict[str, Any]) -> str:
    """Put the outcome of one file into one line."""
    name = clean(result["file"])
    if result["status"] == "error":
        message = clean(result["message"])
        return message if message.startswith(f"{name}:") else f"{name}: {message}"
    found = result["comparison"]
    aged = (
        ""
        if result["version"] == result["installed"]
        else (f"; made by brdftab {clean(result['version'])}, {result['installed']} is installed")
    )
    if result["status"] == "equal":
        most = number(found["max_rel"])
        return f"{name}: repeats in all {found['total']:,} cells (max relative difference {most}){aged}"
    where = ", ".join(f"{axis} {degrees:g}" for axis, degrees in found["directions"].items())
    label = f"{found['component'] + '.' if found['component'] else ''}{found['channel']}"
    return (
        f"{name}: {found['differing']:,} of {found['total']:,} cells differ; worst {label} at {where} deg: "
        f"file {number(found['value_a'])}, now {number(found['value_b'])}{aged}"
    )


def _report(result: Comparison) -> list[str]:
    """Lines that say how two tables compare."""
    verdict = "equal" if result.equal else "differ"
    lines = [
        f"{verdict}: {result.differing:,} of {result.total:,} cells differ",
        f"tolerances rtol {result.rtol:g}, atol {result.atol:g}",
        f"max relative {result.max_rel:.6g}, max absolute {result.max_abs:.6g}, relative rms {result.rms:.6g}",
    ]
    if result.worst_index is not None:
        where = ", ".join(f"{name} = {degrees:g}" for name, degrees in result.directions.items())
        label = f"{result.component + '.' if result.component else ''}{result.channel}"
        lines += [
            f"worst cell {list(result.worst_index[:-1])} {label}: {where} deg",
            f"  a = {result.value_a:.9g}, b = {result.value_b:.9g}, absolute {result.abs_difference:.6g}, "
            f"relative {result.rel_difference:.6g}",
        ]
    if result.mask_differs:
        lines.append(f"the masks disagree at {result.mask_differs:,} numbers")
    if result.not_finite:
        lines.append(f"{result.not_finite:,} numbers are NaN or infinite in at least one table")
    lines += [f"component {name}: {count:,} numbers differ" for name, count in result.components.items() if name]
    return lines


def _read_table(file: str) -> Table:
    """Read a file that must hold a table."""
    from brdftab.errors import BrdftabError
    from brdftab.io import read
    from brdftab.tables.table import Table

    found = read(file)
    if isinstance(found, Table):
        return found
    kind = found.provenance["format"]
    raise BrdftabError(
        f"{clean(file)}: holds a measurement ({kind}), no table; give a file that brdftab tabulate wrote"
    )


def _facts(file: str, table: Table) -> dict[str, Any]:
    """Return what ``info`` tells, JSON-able."""
    import numpy as np

    values = table.values if table.mask is None else table.values[table.mask]
    finite = values[np.isfinite(values)]
    return {
        "file": file,
        "bytes": os.path.getsize(file),
        "version": table.version,
        "model": table.provenance.get("model"),
        "shape": list(table.shape),
        "dtype": table.dtype.name,
        "cell": table.grid.cell,
        "axes": {
            name: {
                "count": int(axis.size),
                "first_degrees": round(math.degrees(axis[0]), 12),
                "last_degrees": round(math.degrees(axis[-1]), 12),
            }
            for name, axis in table.grid.axes.items()
        },
        "channels": list(table.channels),
        "components": list(table.components),
        "values": {
            "min": float(finite.min()) if finite.size else None,
            "max": float(finite.max()) if finite.size else None,
            "negative": int((finite < 0.0).sum()),
            "not_finite": int(values.size - finite.size),
            "masked": 0 if table.mask is None else int((~table.mask).sum()),
        },
        "convention": table.convention,
        "provenance": table.provenance,
    }
