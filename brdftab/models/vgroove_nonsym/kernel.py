"""Nonsymmetric V-grooves: direct quadrature at points, an interpolant for isotropic tables."""

from __future__ import annotations

from typing import Any

from brdftab.models.resolve import Setup
from brdftab.models.vgroove_nonsym.direct import points
from brdftab.models.vgroove_nonsym.interpolant import build

__all__ = ["points", "prepare"]


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> Any:
    """Return the interpolant that serves isotropic tables at loose tolerance, or None (then evaluate directly)."""
    return None if orders else build(setup, tolerance, trial)
