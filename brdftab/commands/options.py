"""Options that the model parameters become: one option a parameter, degrees where the API takes radians."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import click

from brdftab.models import names, spec
from brdftab.models.declaration import Param


class Numbers(click.ParamType):  # type: ignore[type-arg]  # generic in some versions of click
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


# what click makes of a parameter's kind
KINDS: dict[str, Any] = {"float": float, "int": int, "channels": Numbers(), "choice": str, "text": str}


def declared() -> dict[str, list[tuple[Param, list[str]]]]:
    """Return every parameter name of the registry with its declarations, each with the models that share it."""
    found: dict[str, list[tuple[Param, list[str]]]] = {}
    for model in (spec(name) for name in names()):
        for param in model.params:
            variants = found.setdefault(param.name, [])
            same = next((users for other, users in variants if _text(other) == _text(param)), None)
            if same is None:
                variants.append((param, [model.name]))
            else:
                same.append(model.name)
    return found


def _text(param: Param) -> str:
    """Return what the help says of one declaration: meaning, choices, unit and default."""
    unit = " [degrees]" if param.unit == "rad" else (f" [{param.unit}]" if param.unit else "")
    default = param.default
    if param.unit == "rad" and default is not None:
        default = round(math.degrees(default), 9)
    words = f": {' | '.join(param.choices)}" if param.choices else ""
    shown = f"{default:g}" if isinstance(default, float) else str(default)
    return f"{param.doc}{words}{unit}" + ("" if default is None else f" [default: {shown}]")


def _option(name: str, variants: list[tuple[Param, list[str]]], total: int) -> Callable[[Any], Any]:
    """Return the click option of one parameter name."""
    kinds = {param.kind for param, _ in variants}
    kind: Any = KINDS[kinds.pop()] if len(kinds) == 1 else str if kinds & {"choice", "text"} else Numbers()
    parts = []
    for param, users in variants:
        plain = len(variants) == 1 and (len(users) > 3 or len(users) == total)
        parts.append(_text(param) + ("" if plain else f" ({', '.join(users)})"))
    return click.option(f"--{name.replace('_', '-')}", name, type=kind, help="; ".join(parts))


def model_options(command: Callable[..., Any], required: bool = True) -> Callable[..., Any]:
    """Add ``--model`` and one option for every parameter that any model of the registry declares.

    A command's own option of that name, as the seed of a fit, takes its place.
    """
    own = {param.name for param in getattr(command, "__click_params__", [])}
    everything = {name: variants for name, variants in declared().items() if name not in own}
    total = len(names())
    for name, variants in reversed(list(everything.items())):
        command = _option(name, variants, total)(command)
    told = "Model of the registry; see brdftab models."
    return click.option("--model", required=required, metavar="NAME", help=told)(command)


def optional_model_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of `model_options` to a command that can do without a model."""
    return model_options(command, required=False)


def given_parameters(model: str, options: dict[str, Any]) -> dict[str, Any]:
    """Return the model parameters that the user gave, in API units (radians, one number where one is meant)."""
    everything = declared()
    own = {p.name: p for p in spec(model).params} if model in names() else {}
    given: dict[str, Any] = {}
    for name, value in options.items():
        if name not in everything or value is None:
            continue
        given[name] = in_api_units(own.get(name), value)
    return given


def in_api_units(param: Param | None, value: Any) -> Any:
    """Return an option's value for a model's own parameter of that name: radians, one number where one is meant."""
    if isinstance(value, str) and param is not None and param.kind not in ("choice", "text"):
        # another model's parameter of that name is a word
        value = Numbers().convert(value, None, None)
    if param is not None and param.unit == "rad":
        value = [math.radians(x) for x in value] if isinstance(value, list) else math.radians(value)
    return value[0] if isinstance(value, list) and len(value) == 1 else value
