"""How many positions a table of four axes needs: a slab across each axis tells which ones interpolation gives back."""

from __future__ import annotations

import math

import numpy as np

from brdftab.evaluation.engine import Engine
from brdftab.evaluation.points import has_mirror_averages
from brdftab.scene.cubic import choose
from brdftab.scene.interpolation import options
from brdftab.scene.plan import once
from brdftab.scene.resolution_isotropic import AROUND, Kept, bent, slab, spread, with_mirror_views
from brdftab.scene.subgrid import part
from brdftab.tables.grid import Grid
from brdftab.timing import Clock

# positions of each axis that lines along the others cross; views at the mirror side of the lights come on top
CROSSED = {"theta_i": 5, "theta_o": 9, "phi_i": 4, "phi_o": 5}
# errors of the axes add up to less than they may: .26 of the promise at most in 68 tables of 300 random ones thinned
AXES = 2.0
# slabs of a coarse grid would hold much of it, and leave little to save
MOST = 0.2


def keep_azimuths(
    engine: Engine, grid: Grid, symmetric: bool, tolerance: float, floor: float, dtype: str, times: int = 1
) -> Kept:
    """Choose the positions of a grid of four axes between which cubics in log f meet a tolerance.

    Parameters
    ----------
    engine, grid, tolerance, floor, dtype, times
        As in `brdftab.scene.resolution_isotropic.keep`.
    symmetric : bool
        Whether the grid holds a quarter of the light's azimuths.

    Returns
    -------
    Kept
        With the grid as it is where slabs would hold more than a fifth of it, and where the mirror direction is
        singular: the cells that hold averages lie along a diagonal, which no axis leaves out.
    """
    more = math.isqrt(times)
    crossed = {
        name: spread(
            grid.axes[name].size, (times if name == "theta_i" else more) * count, 1.0 if name in AROUND else 1.5
        )
        for name, count in CROSSED.items()
    }
    crossed = with_mirror_views(grid, crossed)
    product = math.prod(index.size for index in crossed.values())
    cells = sum(product // crossed[name].size * axis.size for name, axis in grid.axes.items())
    if cells > MOST * grid.size or has_mirror_averages(engine.setup):
        return Kept(grid, 0, 0.0, 0.0, 0.0)
    few = {name: np.arange(min(2, axis.size)) for name, axis in grid.axes.items()}
    once(f"fill of {engine.setup.model.name}, 4 axes", lambda: slab(engine, grid, few, dtype))
    clock, error, kept = Clock(), 0.0, {}
    for axis, name in enumerate(grid.axis_names):
        values = slab(engine, grid, {other: index for other, index in crossed.items() if other != name}, dtype)
        lines = np.moveaxis(values, axis, 0).reshape(values.shape[axis], -1, values.shape[-1])
        way = options(name, symmetric=symmetric)
        kept[name], worst = choose(grid.axes[name], bent(lines, floor, times), tolerance / AXES, **way)
        error += worst
    rate = clock.seconds / cells
    if grid.square:
        for one, other in (("theta_i", "theta_o"), AROUND):
            kept[one] = kept[other] = np.union1d(kept[one], kept[other])
    return Kept(part(grid, kept), 0, error, rate, 0.0)
