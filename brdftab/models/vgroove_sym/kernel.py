"""Symmetric V-grooves: direct sums at points, fast rows for isotropic tables."""

from brdftab.models.vgroove_sym.direct import points
from brdftab.models.vgroove_sym.table import prepare

__all__ = ["points", "prepare"]
