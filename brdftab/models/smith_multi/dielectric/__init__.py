"""Rough dielectrics that reflect and transmit, all bounces, without noise: light and views on either side."""

from brdftab.models.smith_multi.dielectric.energy import albedo, split_albedo
from brdftab.models.smith_multi.dielectric.levels import FINEST
from brdftab.models.smith_multi.dielectric.table import points, prepare

__all__ = ["FINEST", "albedo", "points", "prepare", "split_albedo"]
