"""Options that the model parameters become: one option a parameter, degrees where the API takes radians."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import click

from brdftab.models import Param, names, spec


class Numbers(click.ParamType):
    """One number, or several separated by commas."""

    name = "number[,number...]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[float]:
        """Return the list of numbers."""
        if isinstance(value, list):
            return value
        try:
            return [float(x) for x in str(value).split(",")]
        except ValueError:
            self.fail(f"{value!r} is not a number or a list as 0.1,0.2,0.3", param, ctx)


def declared() -> dict[str, tuple[Param, list[str]]]:
    """Return every parameter of the registry with the models that take it."""
    found: dict[str, tuple[Param, list[str]]] = {}
    for model in (spec(name) for name in names()):
        for param in model.params:
            found.setdefault(param.name, (param, []))[1].append(model.name)
    return found


def _option(param: Param, users: list[str], total: int) -> Callable[[Any], Any]:
    """Return the click option of one parameter."""
    kind: Any = {"float": float, "int": int, "channels": Numbers(), "choice": str}[param.kind]
    unit = " [degrees]" if param.unit == "rad" else (f" [{param.unit}]" if param.unit else "")
    default = param.default
    if param.unit == "rad" and default is not None:
        default = round(math.degrees(default), 9)
    shown = (
        ""
        if default is None
        else f" [default: {default:g}]"
        if isinstance(default, float)
        else f" [default: {default}]"
    )
    only = "" if len(users) > 3 or len(users) == total else f" ({', '.join(users)})"
    words = f": {' | '.join(param.choices)}" if param.choices else ""
    return click.option(
        f"--{param.name.replace('_', '-')}", param.name, type=kind, help=f"{param.doc}{words}{unit}{shown}{only}"
    )


def model_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--model`` and one option for every parameter that any model of the registry declares."""
    everything = declared()
    total = len(names())
    for param, users in reversed(list(everything.values())):
        command = _option(param, users, total)(command)
    return click.option("--model", required=True, metavar="NAME", help="Model of the registry; see brdftab models.")(
        command
    )


def given_parameters(model: str, options: dict[str, Any]) -> dict[str, Any]:
    """Return the model parameters that the user gave, in API units (radians, one number where one is meant)."""
    everything = declared()
    given: dict[str, Any] = {}
    for name, value in options.items():
        if name not in everything or value is None:
            continue
        param = everything[name][0]
        if param.unit == "rad":
            value = math.radians(value)
        if isinstance(value, list) and len(value) == 1:
            value = value[0]
        given[name] = value
    return given
