"""The command that shows the registry: ``models``."""

from __future__ import annotations

import dataclasses
import json
import math
import textwrap
from typing import Any

import click

from brdftab.models.declaration import Model, Param


@click.command(
    epilog="\b\nExample:\n  brdftab models\n  brdftab models vgroove-nonsym --json\n  brdftab models ilm-approx --glsl"
)
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
@click.option("--glsl", is_flag=True, help="Print the model's GLSL function, where it has one (ilm-approx).")
def models(name: str | None, as_json: bool, glsl: bool) -> None:
    """List the models, or say all about one: parameters, citation, variant and errata."""
    from brdftab.models import names, shader, spec

    if glsl:
        if name is None or as_json:
            raise click.UsageError("--glsl prints the shader of one model: give its NAME, and leave out --json.")
        click.echo(shader(name), nl=False)
        return
    found = [spec(n) for n in ([name] if name else names())]
    if as_json:
        facts = [_facts(model) for model in found]
        click.echo(json.dumps(facts[0] if name else facts, indent=2, allow_nan=False))
        return
    if name:
        _describe(found[0])
        return
    for model in found:
        click.echo(f"{model.name:<16} {model.summary}")


def _facts(model: Model) -> dict[str, Any]:
    """Return a model's declaration as plain JSON; angles in degrees."""
    facts = dataclasses.asdict(model)
    facts["params"] = [
        {**facts_of, "unit": _unit(p), **_shown(p)} for p, facts_of in zip(model.params, facts["params"], strict=True)
    ]
    return facts


def _unit(param: Param) -> str:
    return "degrees" if param.unit == "rad" else param.unit


def _shown(param: Param) -> dict[str, Any]:
    """Return default and bounds in the command line's units, and the choices."""
    from brdftab.materials.indices import names

    turn = math.degrees if param.unit == "rad" else (lambda x: x)
    choices = ("mirror", *names()) if param.name == "material" and param.role == "optics" else param.choices
    return {
        "default": param.default if param.default is None or isinstance(param.default, str) else turn(param.default),
        "bounds": None if param.bounds is None else [turn(b) for b in param.bounds],
        "choices": list(choices),
    }


def _describe(model: Model) -> None:
    click.echo(f"{model.name}: {model.title}")
    for label, text in (
        ("summary", model.summary),
        ("variant", model.variant),
        ("errata", model.errata),
        ("citation", model.citation),
        ("doi", model.doi),
        ("components", ", ".join("order1, order2, ..." if c == "order" else c for c in model.components)),
    ):
        if text:
            click.echo(textwrap.fill(text, 108, initial_indent=f"{label:<11} ", subsequent_indent=" " * 12))
    click.echo("parameters")
    for param in model.params:
        shown = _shown(param)
        default = shown["default"]
        value = "-" if default is None else f"{default:g}" if isinstance(default, float) else str(default)
        if shown["choices"]:
            span = " | ".join(shown["choices"])
        else:
            span = f"[{shown['bounds'][0]:g}, {shown['bounds'][1]:g}]" if shown["bounds"] else ""
        line = f"--{param.name.replace('_', '-')}  {param.doc}; default {value}; {span} {_unit(param)}".rstrip()
        click.echo(textwrap.fill(line, 108, initial_indent="  ", subsequent_indent="      "))
