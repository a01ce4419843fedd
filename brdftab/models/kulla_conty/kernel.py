"""Single bounce and compensation lobe at listed pairs of directions and on product grids."""

from brdftab.models.kulla_conty.compensation import points, prepare

__all__ = ["points", "prepare"]
