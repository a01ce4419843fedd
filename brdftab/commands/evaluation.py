"""Commands that evaluate models: ``eval`` and ``tabulate``."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import click

from brdftab.commands.options import given_parameters, model_options
from brdftab.commands.progress import progress_bar
from brdftab.commands.text import as_json_option, spectrum_line, tell_compiling, with_components

if TYPE_CHECKING:
    pass


@click.command(
    "eval",
    epilog="\b\nExample:\n"
    "  brdftab eval --model vgroove-nonsym --ndf ggx --alpha 0.3 --theta-i 30 --theta-o 40 --phi 180 --json",
)
@model_options
@click.option("--theta-i", "theta_i", type=float, required=True, help="Polar angle of the light [degrees].")
@click.option("--theta-o", "theta_o", type=float, required=True, help="Polar angle of the view [degrees].")
@click.option("--phi", type=float, required=True, help="phi_o - phi_i [degrees]; 180 is the mirror side.")
@click.option("--phi-i", "phi_i", type=float, default=0.0, help="Azimuth of the light [degrees; default: 0].")
@click.option("--tolerance", type=float, default=1e-9, help="Relative error asked [default: 1e-9].")
@with_components
@as_json_option
def evaluate(
    model: str,
    theta_i: float,
    theta_o: float,
    phi: float,
    phi_i: float,
    tolerance: float,
    components: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Evaluate a model at one pair of directions: value per channel and component, error, run time."""
    from brdftab.evaluation.points import evaluate_point
    from brdftab.models.resolve import resolve

    setup = resolve(model, **given_parameters(model, options))
    tell_compiling(model)
    angles = [math.radians(x) for x in (theta_i, theta_o, phi, phi_i)]
    with progress_bar("evaluating") as report:
        result = evaluate_point(setup, *angles, tolerance=tolerance, components=components, progress=report)
    if as_json:
        click.echo(json.dumps(result, indent=2, allow_nan=False))
        return
    click.echo(f"{model}  theta_i {theta_i:g}  theta_o {theta_o:g}  phi {phi:g}  phi_i {phi_i:g} degrees, f in 1/sr")
    click.echo(f"{'':<14}" + "".join(f"{c:>18}" for c in result["channels"]))
    rows = {"value": result["value"], **(result["components"] or {})}
    for name, values in rows.items():
        click.echo(f"{name:<14}" + "".join(f"{v:>18.10g}" for v in values))
    if result["delta"]:
        shares = "  ".join(f"{v:.10g}" for v in result["delta"])
        click.echo(f"mirror direction of a flat interface: its reflectance {shares} is a delta, no part of the value")
    if result["unreached"]:
        click.echo("no path found bounces beyond the first here: how large they are is not known; give more --samples")
    for name, error in (result["component_errors"] or {}).items():
        click.echo(f"error of {name:<11} {error['absolute']:.1e}/sr, relative {error['relative']:.1e}")
    click.echo(
        f"estimated relative error {result['error']:.1e}, run time {result['run_time_s'] * 1e3:.3g} ms, "
        f"and {result['error_time_s'] * 1e3:.3g} ms for the error"
    )
    spectrum = spectrum_line(result["spectral"])
    if spectrum:
        click.echo(f"beside it: {spectrum}")
