"""What ``info`` tells of measured data."""

from __future__ import annotations

import json
import math
import os
from typing import TYPE_CHECKING, Any

import click

from brdftab.commands.text import clean, line

if TYPE_CHECKING:
    from brdftab.tables.measurement import Measurement


def show(file: str, found: Measurement, as_json: bool) -> None:
    """Print what ``info`` tells of a measurement."""
    told = facts(file, found)
    if as_json:
        click.echo(json.dumps(told, indent=2, allow_nan=False))
        return
    for key in ("file", "bytes", "format", "description", "reciprocity"):
        click.echo(f"{key:<11} {line(told[key]) or '-'}")
    cells = told["cells"]
    click.echo(f"{'cells':<11} {cells['above_horizon']:,} above the horizon, {cells['below_horizon']:,} below it")
    for name, angle in told["angles"].items():
        click.echo(f"{name:<11} from {line(angle['first_degrees'])} to {line(angle['last_degrees'])} deg")
    for name, channel in told["channels"].items():
        numbers = ", ".join(f"{key} {_short(channel[key])}" for key in ("min", "median", "max"))
        click.echo(f"{'channel ' + name:<11} {100.0 * channel['valid_share']:.2f} % valid; {numbers} 1/sr")
    click.echo("provenance")
    for name, value in told["provenance"].items():
        click.echo(f"  {clean(str(name))}: {line(value) or '-'}")


def facts(file: str, found: Measurement) -> dict[str, Any]:
    """Return what ``info`` tells of a measurement, JSON-able."""
    import numpy as np

    cells = found.cells()
    measured = cells.valid.any(axis=1)
    channels = {}
    for c, name in enumerate(found.channels):
        valid = cells.valid[:, c]
        good = cells.values[valid, c]
        channels[name] = {
            "valid_share": float(valid.mean()) if valid.size else 0.0,
            "min": float(good.min()) if good.size else None,
            "max": float(good.max()) if good.size else None,
            "median": float(np.median(good)) if good.size else None,
        }
    return {
        "file": file,
        "bytes": os.path.getsize(file),
        "format": found.provenance["format"],
        "description": found.provenance.get("description", ""),
        "cells": {"above_horizon": int(cells.theta_i.size), "below_horizon": cells.below_horizon},
        "angles": {
            name: {"first_degrees": _degrees(angle[measured], min), "last_degrees": _degrees(angle[measured], max)}
            for name, angle in (("theta_i", cells.theta_i), ("theta_o", cells.theta_o), ("phi", cells.phi))
        },
        "channels": channels,
        "reciprocity": "built into the format" if found.reciprocal else "both orders of a pair are measured",
        "provenance": found.provenance,
    }


def _degrees(angles: Any, end: Any) -> float | None:
    """Return the least or greatest of some angles in degrees."""
    return round(math.degrees(end(angles.tolist())), 9) if angles.size else None


def _short(value: float | None) -> str:
    """Format a value of a measurement."""
    return "-" if value is None else f"{value:.6g}"
