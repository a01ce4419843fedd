"""Fast tables of isotropic single-bounce setups on product grids, with an error held in every cell.

A cell is F D G/(4 i_z o_z) + kappa I. The body integral I of all cells comes from bulk.py, twice: at two resolutions,
the coarser one at some azimuths only. `SAFETY` times their difference, the largest of the neighbouring azimuths, stands
for the error. Cells where kappa times it exceeds half the tolerance, relative to the cell's value in any channel, are
made again by the split rule of body.py: grazing cells whose I is tiny against that of other azimuths.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.directions import HORIZON
from brdftab.models._shared.codes import GAUSSIAN, SEPARABLE, V_CAVITY
from brdftab.models._shared.facets.gaussian import gaussian_norm
from brdftab.models._shared.fresnel.interface import body_factor, transmission
from brdftab.models.ilm.interreflection.table import prepare_cavity
from brdftab.models.ilm.single_bounce.cells import axis, exact, rewrite, write
from brdftab.models.ilm.single_bounce.many_points import Bodies
from brdftab.models.resolve import Setup
from brdftab.quadrature import unit_gauss
from brdftab.typing import Array

# least tolerance; rings, modes and (V-cavities) radii and angles of the wedges; the same of the coarser resolution
SMITH_LEVELS = (
    (1e-3, (64, 64), (44, 44)),
    (1e-4, (96, 128), (64, 88)),
    (1e-5, (160, 320), (112, 224)),
    (1e-6, (320, 640), (224, 448)),
)
CAVITY_LEVELS = (
    (1e-3, (96, 128, 10, 12), (64, 88, 8, 9)),
    (1e-4, (128, 256, 12, 16), (88, 176, 10, 12)),
    (1e-5, (256, 512, 16, 24), (176, 352, 13, 18)),
    (1e-6, (512, 1024, 24, 36), (352, 704, 19, 28)),
)
# nodes a panel of the split rule, by tolerance
PANELS = ((1e-3, 10), (1e-4, 12), (0.0, 16))
# every so many azimuths are made coarsely, too, and the first and last of them all
STRIDE, ENDS = 3, 6
# numbers of a block of pairs of polar angles that are made at a time
BLOCK = 1 << 21
# tighter tolerances are left to the direct rules
REACH = 1e-6


def _neighbours(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the azimuths that are made coarsely, too (S,), and the range of them next to each azimuth (2, count)."""
    index = np.arange(count)
    taken = index[(index % STRIDE == 0) | (index < ENDS) | (index >= count - ENDS)]
    low = np.searchsorted(taken, index - STRIDE, side="left")
    high = np.searchsorted(taken, index + STRIDE, side="right")
    return taken, np.stack([low, high])


def _above(theta: Array) -> tuple[NDArray[np.int64], Array]:
    """Return index and angle of the polar angles above the horizon."""
    index = np.flatnonzero(np.cos(theta) > HORIZON).astype(np.int64)
    return index, np.ascontiguousarray(theta[index], dtype=np.float64)


class BodyEvaluator:
    """An isotropic single-bounce setup of interfaced Lambertian facets, ready for points and product grids.

    Attributes
    ----------
    masking : int
        0 Smith, else V_CAVITY.
    kappa : ndarray (C,)
        Factor of I in each channel.
    mended : int
        Cells that the last `fill` made again, a cell of a square grid and its mirror image counted once.
    """

    def __init__(self, setup: Setup, tolerance: float) -> None:
        assert setup.fresnel is not None
        self._setup, self._tolerance = setup, tolerance
        self.mended = 0
        self.masking = 0 if setup.values["masking"] == "smith" else V_CAVITY
        levels: Any = SMITH_LEVELS if self.masking == SEPARABLE else CAVITY_LEVELS
        self._level = next(sizes for least, *sizes in levels if tolerance >= least)
        count = len(setup.channels)
        kd = np.broadcast_to(setup.values["kd"], count)
        index = np.broadcast_to(setup.fresnel.a, count)
        self.kappa = np.array([body_factor(k, n) for k, n in zip(kd, index, strict=True)])
        # channels of the same index share everything but a factor
        self._groups = [(float(n), np.flatnonzero(index == n)) for n in np.unique(index)]

    def points(self, theta_i: Array, theta_o: Array, phi: Array, phi_i: Array) -> Array:
        """Evaluate at N pairs of directions (radians), one by one; returns (N, 1, C) in 1/sr."""
        direct = models.kernel(self._setup.model.name).points
        return direct(self._setup, theta_i, theta_o, phi, phi_i, orders=0, tolerance=self._tolerance)

    def fill(self, theta_i: Array, theta_o: Array, phi: Array, square: bool, out: NDArray[np.floating]) -> None:
        """Fill out (1, I, O, F, C), float32 or float64, on a product grid of radians, in 1/sr.

        A square grid (both polar axes identical) is computed half and mirrored; at the horizon and below it is 0.
        """
        out = out[0]
        out[:] = 0.0
        self.mended = 0
        lights = _above(theta_i)
        views = lights if square else _above(theta_o)
        if min(lights[0].size, views[0].size, phi.size) == 0:
            return
        phi = np.ascontiguousarray(phi, dtype=np.float64)
        for n, channels in self._groups:
            if self._setup.alpha_x == 0.0:
                self._fill_flat(n, channels, lights, views, out)
            else:
                self._fill_group(n, channels, lights, views, phi, square, out)

    def _fill_flat(self, n: float, channels: Any, lights: Any, views: Any, out: NDArray[np.floating]) -> None:
        """Fill the channels of one index without roughness: kappa T T/pi, and nothing aside of the mirror direction."""
        t_i, t_o = (np.array([transmission(n, c) for c in np.cos(side)]) for _, side in (lights, views))
        body = (t_i[:, None] * t_o)[:, :, None, None] * (self.kappa[channels] / math.pi)
        out[np.ix_(lights[0], views[0], range(out.shape[2]), channels)] = body

    def _fill_group(
        self, n: float, channels: Any, lights: Any, views: Any, phi: Array, square: bool, out: NDArray[np.floating]
    ) -> None:
        """Fill the channels of one index, block by block of lights."""
        ndf, sigma = self._setup.ndf, self._setup.alpha_x
        norm = gaussian_norm(sigma) if ndf == GAUSSIAN else 1.0
        kappa = self.kappa[channels] / math.pi
        waves = np.cos(0.5 * phi), np.sin(phi)
        surface = (self.masking, ndf, sigma, norm, n, *waves, kappa, 0.5 * self._tolerance)
        axes = tuple(axis(self.masking, ndf, sigma, side[1]) for side in (lights, views))
        places = lights[0], views[0]
        taken, ranges = _neighbours(phi.size)
        nodes = unit_gauss(next(count for least, count in PANELS if self._tolerance >= least))
        bodies = [
            Bodies(ndf, self.masking == V_CAVITY, sigma, n, lights[1], views[1], some, sizes, self._tolerance)
            for some, sizes in zip((phi, phi[taken]), self._level, strict=True)
            if kappa.any()
        ]
        # small blocks of a square grid waste little of the other half
        size = max(1, min(BLOCK // (views[0].size * phi.size), 16))
        for start in range(0, lights[0].size, size):
            stop = min(start + size, lights[0].size)
            columns = stop if square else views[0].size
            shape = (stop - start, columns, phi.size)
            flags = np.zeros(shape, np.bool_)
            if bodies:
                fine, coarse = (b.block(start, stop, columns, square) for b in bodies)
            else:
                fine = coarse = np.zeros(shape)
            write(fine, coarse, taken, ranges, *axes, places, start, surface, channels, square, flags, out)
            cells = np.argwhere(flags)
            cells[:, 0] += start
            self.mended += len(cells)
            mended = np.empty(len(cells))
            exact(cells, phi, *axes, nodes, surface, mended)
            rewrite(cells, mended, *axes, places, surface, channels, square, out)


def prepare(setup: Setup, tolerance: float, orders: int = 0, trial: bool = False) -> Any:
    """Return the fast tables of an isotropic setup, or None where only direct evaluation serves.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.resolve.resolve`.
    tolerance : float
        Relative error asked of every cell and channel; None is returned below 1e-6.
    orders : int
        0; components take points.
    trial : bool
        Prepared only to compile the kernels; nothing is cheaper for it here.
    """
    if orders:
        return None
    if setup.max_bounces != 1:
        return prepare_cavity(setup, prepare, tolerance, trial)
    if not setup.isotropic or tolerance < REACH:
        return None
    return BodyEvaluator(setup, tolerance)
