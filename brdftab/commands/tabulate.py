"""``tabulate``: a model on a grid, written with its error and its cost."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from brdftab.commands.nearest_words import Choice
from brdftab.commands.options import given_parameters, optional_model_options
from brdftab.commands.progress import progress_bar
from brdftab.commands.scratch_forms import write_form
from brdftab.commands.text import as_json_option, spectrum_line, tell_compiling, with_components

if TYPE_CHECKING:
    from brdftab.tables.table import Table


# rows of centres that are further from the albedo than this are told
BETWEEN = 0.1

_AXIS = "start:stop:count or a,b,c [degrees]"


@click.command(
    epilog="\b\nExamples:\n"
    "  brdftab tabulate --model vgroove-nonsym\n"
    "  brdftab tabulate --model smith --ndf ggx --alpha 0.3 --material Cu --grid 45x45x90 --out copper.npz\n"
    "  brdftab tabulate --model vgroove-sym --alpha-x 0.1 --alpha-y 0.4 --grid 12x24x12x24 --components\n"
    "  brdftab tabulate --model cook-torrance --theta-i 10,30,60 --theta-o 0:80:17 --phi 0:180:37 --cell point\n"
    "  brdftab tabulate --scene scene.toml --out tables --verify-plan"
)
@optional_model_options
@click.option("--grid", metavar="IxOxP", help="Cells, theta_i x theta_o x phi (or four) [default: 90x90x180].")
@click.option("--theta-i", "theta_i", metavar="AXIS", help=f"Positions instead of --grid: {_AXIS}.")
@click.option("--theta-o", "theta_o", metavar="AXIS", help="Positions [default: those of theta_i].")
@click.option("--phi", metavar="AXIS", help="Positions of phi_o - phi_i [default: 180 cells of 1 degree].")
@click.option("--phi-i", "phi_i", metavar="AXIS", help="Positions of the light's azimuth, for four axes.")
@click.option("--phi-o", "phi_o", metavar="AXIS", help="Positions of the view's azimuth, for four axes.")
@click.option(
    "--out", "outs", multiple=True, metavar="FILE", help="Output, .exr or .npz; may be repeated [default: MODEL.exr]."
)
@click.option("--cell", type=Choice(["center", "average", "point"]), help="What a cell holds [default: center].")
@click.option("--dtype", type=Choice(["float32", "float64"]), help="Stored type [default: float32].")
@click.option("--tolerance", type=float, help="Relative error asked [default: 1e-3].")
@with_components
@click.option(
    "--scene",
    metavar="FILE",
    help="Tabulate the materials of a scene (TOML) instead of a model, and only what it needs; --out is a folder or "
    "FOLDER/{name}.npz [default: the scene's name].",
)
@click.option("--verify-plan", is_flag=True, help="Measure the true error of a scene's tables against full ones.")
@click.option("--no-cache", is_flag=True, help="Neither take a scene's tables from the cache nor keep them there.")
@click.option(
    "--form",
    type=Choice(["native", "triplet", "dense", "blurred"]),
    help="What is written of a scratch: flux and cosines by bounce order for any material; the paper's texture; a 4-D "
    "table in the scratch's own angles (--grid TxP, default 16x32); or a table as of other models [default: native; "
    "blurred with a grid].",
)
@click.option("--threads", type=int, help="Threads [default: all].")
@click.option("--overwrite", is_flag=True, help="Replace existing outputs.")
@as_json_option
def tabulate(
    model: str | None,
    grid: str | None,
    outs: tuple[str, ...],
    cell: str | None,
    dtype: str | None,
    tolerance: float | None,
    components: bool,
    scene: str | None,
    verify_plan: bool,
    no_cache: bool,
    form: str | None,
    threads: int | None,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Tabulate a model on a grid and write it, with its error and its cost, to EXR or NPZ files."""
    from brdftab.errors import ParameterError
    from brdftab.io import check_output, write
    from brdftab.models.resolve import resolve
    from brdftab.timing import Clock

    if scene is not None:
        from brdftab.commands.scene import tabulate_scene

        given = {"model": model, "grid": grid, "cell": cell, "dtype": dtype, "tolerance": tolerance, "form": form}
        idle = {**given, "components": components, "threads": threads, **options}
        if not tabulate_scene(scene, outs, overwrite, verify_plan, not no_cache, as_json, idle):
            click.get_current_context().exit(1)
        return
    if model is None:
        raise ParameterError("model is missing; give --model NAME (see brdftab models), or --scene FILE")
    for name, asked in (("verify_plan", verify_plan), ("no_cache", no_cache)):
        if asked:
            raise ParameterError(f"{name} goes with --scene; leave it out")
    clock = Clock()
    axes = {name: options.pop(name) for name in ("theta_i", "theta_o", "phi", "phi_i", "phi_o")}
    axes = {name: value for name, value in axes.items() if value is not None}
    if axes and grid is not None:
        raise ParameterError(f"grid = {grid} and {', '.join(axes)} exclude each other; give --grid or the axes")
    if axes and "theta_i" not in axes:
        raise ParameterError(f"{', '.join(axes)} need theta_i beside them; give --theta-i, as 0.5:89.5:90")
    if axes and not {"phi", "phi_i", "phi_o"} & set(axes):
        axes["phi"] = "0:180:181" if cell == "point" else "0.5:179.5:180"
    parameters = given_parameters(model, options)
    forms = resolve(model, **parameters).model.forms
    if form is not None and form not in forms:
        raise ParameterError(f"form = {form} is not one of model = {model}, which has tables alone; leave it out")
    paths = outs or (f"{model}.exr",)
    if len(set(paths)) != len(paths):
        raise ParameterError(f"out = {', '.join(paths)} names a file twice; give each once")
    for path in paths:
        check_output(path, overwrite=overwrite)
    tell_compiling(model)
    # a grid of directions asks for a table
    chosen = form or (forms[0] if forms and not axes and grid is None else "blurred")
    if chosen != "blurred":
        idle = {"cell": cell, "components": components or None, "threads": threads, **axes}
        write_form(chosen, parameters, grid, paths, idle, overwrite, as_json)
        return
    from brdftab.tabulation.tabulate import tabulate as run

    with progress_bar("tabulating") as report:
        table = run(
            model,
            axes or grid,
            cell=cell,
            dtype=dtype or "float32",
            tolerance=1e-3 if tolerance is None else tolerance,
            components=components,
            threads=threads,
            progress=report,
            **parameters,
        )
    for path in paths:
        write(table, path, overwrite=overwrite)
    _summary(table, paths, clock.seconds, as_json)


def _summary(table: Table, paths: tuple[str, ...], wall: float, as_json: bool) -> None:
    """Print what was made: shape, parameters, albedo, error, cost, files."""
    made = table.provenance
    error, albedo = made["error"], made["albedo"]
    if as_json:
        facts = {
            "model": made["model"],
            "parameters": made["parameters"],
            "shape": list(table.values.shape),
            "axes": list(table.grid.axis_names),
            "cell": table.grid.cell,
            "dtype": str(table.dtype),
            "channels": list(table.channels),
            "components": list(table.components),
            "albedo": albedo,
            "error": error,
            "delta": made["delta"],
            "energy": made["energy"],
            "energy_left_out": made["energy_left_out"],
            "kernel_time_s": made["kernel_time_s"],
            "compile_time_s": made["compile_time_s"],
            "total_time_s": made["total_time_s"],
            "wall_time_s": wall,
            "cells_per_s": made["cells_per_s"],
            "files": list(paths),
        }
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
    else:
        shape = " x ".join(f"{n} {name}" for n, name in zip(table.grid.shape, table.grid.axis_names, strict=True))
        click.echo(f"model        {made['model']}")
        click.echo("parameters   " + ", ".join(f"{k} = {_short(v)}" for k, v in made["parameters"].items()))
        click.echo(
            f"table        {shape}, cell = {table.grid.cell}, {table.dtype}, channels {' '.join(table.channels)}"
        )
        if table.components:
            click.echo(f"components   {' '.join(table.components)}")
        for angle, values in zip(albedo["theta_i_degrees"], albedo["values"], strict=True):
            click.echo(f"albedo {angle:>4g}  " + "  ".join(f"{v:.5f}" for v in values))
        spectrum = spectrum_line(made["spectral"])
        if spectrum:
            click.echo(f"spectrum     {spectrum}")
        if made["delta"]:
            for angle, values in zip(made["delta"]["theta_i_degrees"], made["delta"]["reflectance"], strict=True):
                click.echo(f"mirrored {angle:>2g}  " + "  ".join(f"{v:.5f}" for v in values))
            click.echo(f"             {made['delta']['meaning']}")
        if made["energy_left_out"]:
            for angle, values in zip(albedo["theta_i_degrees"], made["energy_left_out"]["values"], strict=True):
                click.echo(f"left out {angle:>2g}  " + "  ".join(f"{v:.2e}" for v in values))
        if made["energy"]:
            click.echo(
                f"energy       rows hold their albedo within {made['energy']['largest']:.1e}, worst at theta_i = "
                f"{made['energy']['at_degrees']:.4g}"
            )
        click.echo(f"error        {error['estimate']:.1e} estimated (95 % of cells below {error['p95']:.1e})")
        click.echo(
            f"run time     {made['kernel_time_s']:.3f} s in kernels, {wall:.2f} s in all, "
            f"{made['cells_per_s']:.3g} cells/s; {made['compile_time_s']:.2f} s more to compile or load kernels"
        )
        for path in paths:
            click.echo(f"wrote        {path}")
    if made["compile_time_s"] > 0.5:
        click.echo(f"brdftab: compiled for {made['compile_time_s']:.1f} s, which no run time counts", err=True)
    if table.grid.cell == "center" and made["energy"] and made["energy"]["largest"] > BETWEEN:
        click.echo(f"Warning: {_between(made['energy'])}", err=True)
    if not error["met"]:
        click.echo(
            f"Warning: the estimated error {error['estimate']:.1e} exceeds tolerance {error['tolerance']:g}: "
            f"{error['reason']}",
            err=True,
        )


def _between(energy: dict[str, Any]) -> str:
    """Say that a lobe falls between the cells' centres, or on them, at the row where it tells most."""
    row = energy["theta_i_degrees"].index(energy["at_degrees"])
    held, albedo = max(energy["table"][row]), max(energy["albedo"][row])
    return (
        f"the cells of the row at theta_i = {energy['at_degrees']:.4g} degrees hold {held:.3g} of the light, the "
        f"albedo is {albedo:.3g}: values at centres miss or overstate a lobe as narrow as a cell; take --cell average "
        "or a finer grid"
    )


def _short(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(f"{v:g}" for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value)
