"""``tabulate`` for models that have files of their own kind: what is asked, traced, written and told."""

from __future__ import annotations

import json
import math
from typing import Any

import click

ANGLES = (0, 30, 60)
# share of the light that the cap of bounces may cut off without a warning
LOST = 1e-3


def _sizes(form: str, grid: str | None) -> dict[str, tuple[int, int]]:
    """Return the bins of a dense table that --grid asks for."""
    from brdftab.errors import ParameterError

    if grid is None:
        return {}
    if form != "dense":
        raise ParameterError(f"grid = {grid} has no meaning for form = {form}, whose size is bins; leave it out")
    words = grid.split("x")
    if len(words) != 2 or not all(w.isdigit() and 2 <= int(w) <= 512 for w in words):
        raise ParameterError(f"grid = {grid} is not TxP, bins in [2, 512] along and across the scratch, as 16x32")
    return {"sizes": (int(words[0]), int(words[1]))}


def write_form(
    form: str,
    parameters: dict[str, Any],
    grid: str | None,
    paths: tuple[str, ...],
    idle: dict[str, Any],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Trace a scratch, write it in one of its own forms and print what was made.

    `idle` are options of plain tables, which none of these forms takes.
    """
    from brdftab.errors import ParameterError
    from brdftab.models import spec
    from brdftab.scratch_layers.files import write_scratch
    from brdftab.scratch_layers.scratch import trace_scratch

    parameters = dict(parameters)
    for name, value in {**idle, "psi": parameters.pop("psi", None)}.items():
        if value is not None:
            raise ParameterError(f"{name} has no meaning for form = {form}; leave it out, or take form = blurred")
    sizes = _sizes(form, grid)
    declared = spec("scratch")
    own = {name: parameters.pop(name, declared.param(name).default) for name in ("profile", "bins", "rays")}
    if "max_bounces" in parameters:
        own["cap"] = parameters.pop("max_bounces")
    scratch = trace_scratch(**own)
    material = parameters or {"material": declared.param("material").default}
    # a native file serves any material: the one named is for the albedo that is printed
    kept = {} if form == "native" else material
    heads = [write_scratch(scratch, path, form=form, overwrite=overwrite, **sizes, **kept) for path in paths]
    albedo = [scratch.albedo(math.radians(t), **material).tolist() for t in ANGLES]
    orders = (scratch.flux.sum(axis=(1, 2)) / 2.0).tolist()
    lost = heads[0]["error"]["lost_mean"]
    if lost > LOST:
        click.echo(
            f"Warning: max_bounces = {heads[0]['cap']} cuts off {lost:.2g} of the light; raise it with --max-bounces",
            err=True,
        )
    if as_json:
        facts = {k: v for k, v in heads[0].items() if k not in ("shape", "phi_edges")}
        facts |= {"form": form, "flux_by_order": orders, "material": material}
        facts |= {"albedo": {"t_degrees": list(ANGLES), "values": albedo}, "files": list(paths)}
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
        return
    head, error = heads[0], heads[0]["error"]
    named = ", ".join(f"{k} = {v:g}" if isinstance(v, float) else f"{k} = {v}" for k, v in material.items())
    click.echo("model        scratch")
    click.echo(f"profile      {head['profile']}, depth {scratch.profile.depth:.3g} half widths")
    click.echo(f"traced       {head['bins']} bins of angle, {head['rays']} rays a bin, at most {head['cap']} bounces")
    shown = zip(("1", "2", "3", "4", "5+"), orders, strict=True)
    click.echo("flux         " + "  ".join(f"order {n}: {v:.5f}" for n, v in shown) + "  (mirrors)")
    for t, values in zip(ANGLES, albedo, strict=True):
        click.echo(f"albedo {t:>4}  " + "  ".join(f"{v:.5f}" for v in values) + f"  ({named})")
    click.echo(
        f"error        {error['l1']:.1e} (L1 of the flux), {error['lost_mean']:.1e} cut off by the cap of bounces"
    )
    for path in paths:
        click.echo(f"wrote        {path} ({form})")
