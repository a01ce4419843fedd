"""What commands print alike."""

from __future__ import annotations

import json
from typing import Any

import click

as_json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
with_components = click.option("--components", is_flag=True, help="Also give each component (bounce order, ...) apart.")


def line(value: Any) -> str:
    """Put a JSON value on one line."""
    if isinstance(value, str):
        return clean(value)
    if isinstance(value, dict):
        return ", ".join(f"{clean(str(name))} {line(item)}" for name, item in value.items())
    if isinstance(value, list) and not any(isinstance(item, dict | list) for item in value):
        return " ".join(line(item) for item in value)
    return clean(json.dumps(value))


def number(value: float | str) -> str:
    """Format a number of a comparison, which JSON holds as text where it is not finite."""
    return value if isinstance(value, str) else f"{value:.9g}"


def clean(text: str) -> str:
    """Return a file's text without what could steer a terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def tell_compiling(model: str) -> None:
    """Say once, on stderr, that kernels are about to be compiled."""
    from brdftab.kernel_cache import has_compiled
    from brdftab.models import package, spec

    parts = [package(model)]
    # models of single bounces off facets have no kernels of their own
    parts += ["brdftab.models._shared.single_bounce"] if spec(model).ndfs else []
    if not any(has_compiled(part) for part in parts):
        click.echo(
            f"brdftab: compiling kernels for {model}: the first run takes up to a minute, later ones start at once",
            err=True,
        )


def spectrum_line(made: dict[str, Any] | None) -> str:
    """Say what few wavelengths leave; nothing where there are none, or all."""
    if not made or made["error_against_5nm"] == 0.0:
        return ""
    return f"{len(made['wavelengths_nm'])} wavelengths, error {made['error_against_5nm']:.0e} against 5 nm steps"
