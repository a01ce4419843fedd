"""Scaled single bounce at listed pairs of directions and on product grids."""

from brdftab.models.turquin.compensation import points, prepare

__all__ = ["points", "prepare"]
