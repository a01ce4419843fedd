"""Fast tables of isotropic single-bounce setups on product grids, with an error held in every cell.

A cell is F D G/(4 i_z o_z) + kappa I. The body integral I of all cells comes from bulk.py, twice: at two resolutions,
the coarser one at some azimuths only. `SAFETY` times their difference, the largest of the neighbouring azimuths, stands
for the error. Cells where kappa times it exceeds half the tolerance, relative to the cell's value in any channel, are
made again by the split rule of body.py: grazing cells whose I is tiny against that of other azimuths.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.jit import kernel, parallel_kernel
from brdftab.models.ilm.body import split_integral
from brdftab.models.ilm.bulk import Bodies
from brdftab.models.ilm.cavity_table import prepare_cavity
from brdftab.models.ilm.rings import gauss
from brdftab.models.microfacet.fresnel import reflectance
from brdftab.models.microfacet.gaussian import gaussian_density, gaussian_norm
from brdftab.models.microfacet.interface import body_factor, transmission
from brdftab.models.microfacet.masking import smith_lambda, v_cavity
from brdftab.models.microfacet.ndf import density
from brdftab.models.microfacet.single import HORIZON, V_CAVITY
from brdftab.models.setup import Setup

Array = NDArray[np.float64]
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
# the error of the finer resolution falls at least like the square of the number of rings and modes
SAFETY = 0.5
# nodes a panel of the split rule, by tolerance
PANELS = ((1e-3, 10), (1e-4, 12), (0.0, 16))
# every so many azimuths are made coarsely, too, and the first and last of them all
STRIDE, ENDS = 3, 6
# numbers of a block of pairs of polar angles that are made at a time
BLOCK = 1 << 21
# tighter tolerances are left to the direct rules
REACH = 1e-6


@kernel
def specular(surface, angles, half, sine):
    """Return D G/(4 i_z o_z) in 1/sr and i.h; angles is from `_pair`, half and sine are cos(phi/2) and sin(phi)."""
    masking, ndf, sigma, norm = surface[0], surface[1], surface[2], surface[3]
    difference, _, ci, so, co, g = angles
    x, y, up = difference + 2.0 * so * half * half, so * sine, ci + co
    flat = math.sqrt(x * x + y * y)
    full = math.sqrt(flat * flat + up * up)
    c, s, i_h = up / full, flat / full, 0.5 * full
    d = gaussian_density(sigma, norm, c, s) if ndf == 3 else density(ndf, sigma, c, s)
    if masking == 10:
        g = v_cavity(c, ci, co, i_h)
    return d * g / (4.0 * ci * co), i_h


@kernel
def _pair(light, view):
    """Return what `specular` takes of two polar angles; light and view are rows of `_axis`."""
    ti, to = light[0], view[0]
    difference = 2.0 * math.cos(0.5 * (ti + to)) * math.sin(0.5 * (ti - to))
    return difference, light[1], light[2], view[1], view[2], light[3] * view[3]


@kernel
def _put(i, o, p, angles, body, error, surface, channels, square, out):
    """Write cell (i, o, p) and its mirror image; return whether the error exceeds its share of the tolerance.

    surface: masking, ndf, sigma, norm, n, cos(phi/2), sin(phi), kappa/pi (C,), share of the tolerance.
    """
    base, i_h = specular(surface, angles, surface[5][p], surface[6][p])
    base *= reflectance(2, surface[4], 0.0, i_h)
    kappa = surface[7]
    bad = False
    for k in range(channels.size):
        value = base + kappa[k] * body
        out[i, o, p, channels[k]] = value
        if square:
            out[o, i, p, channels[k]] = value
        bad = bad or kappa[k] * error > surface[8] * value
    return bad


@parallel_kernel
def _write(body, coarse, taken, ranges, lights, views, places, first, surface, channels, square, flags, out):
    """Write a block of cells from pi I, and flag those to be made again.

    body (lights, views, phi), coarse (lights, views, S): pi I without Smith's masking at all azimuths and at those
    `taken`; ranges (2, phi): which of these are next to an azimuth; lights, views: from `_axis`; places: their indices
    in out.
    """
    rows, columns, steps = body.shape
    for index in numba.prange(rows * columns):
        i, o = index // columns, index % columns
        if square and o > first + i:
            continue
        angles = _pair(lights[first + i], views[o])
        g = angles[5]
        gaps = np.zeros(taken.size)
        for s in range(taken.size):
            gaps[s] = abs(body[i, o, taken[s]] - coarse[i, o, s])
        row, column = places[0][first + i], places[1][o]
        for p in range(steps):
            error = 0.0
            for s in range(ranges[0, p], ranges[1, p]):
                error = max(error, gaps[s])
            value, error = g * max(body[i, o, p], 0.0), SAFETY * g * error
            flags[i, o, p] = _put(row, column, p, angles, value, error, surface, channels, square, out)


@parallel_kernel
def _exact(cells, phi, lights, views, nodes, surface, bodies):
    """Fill bodies (N,) with pi I of the cells (N, 3) by the split rule."""
    masking, ndf, sigma, norm, n = surface[0], surface[1], surface[2], surface[3], surface[4]
    for m in numba.prange(len(cells)):
        i, o, p = cells[m, 0], cells[m, 1], cells[m, 2]
        ci, co = lights[i, 2], views[o, 2]
        a, b = lights[i, 1] / ci, views[o, 1] / co
        x, y = b * math.cos(phi[p]), b * math.sin(phi[p])
        # a tighter tolerance keeps the far facets of GGX, which grazing cells of smooth surfaces are made of
        body = split_integral(ndf, masking == 10, sigma, sigma, norm, n, a, 0.0, ci, x, y, co, nodes, 0.02 * surface[8])
        bodies[m] = math.pi * lights[i, 3] * views[o, 3] * body


@kernel
def _rewrite(cells, bodies, lights, views, places, surface, channels, square, out):
    """Write the cells (N, 3) again from pi I."""
    for m in range(len(cells)):
        i, o, p = cells[m, 0], cells[m, 1], cells[m, 2]
        angles = _pair(lights[i], views[o])
        _put(places[0][i], places[1][o], p, angles, bodies[m], 0.0, surface, channels, square, out)


@kernel
def _axis(masking, ndf, sigma, theta):
    """Return theta, its sine and cosine, and Smith's G1 (1 with V-cavities, which mask inside the integral), (N, 4)."""
    axis = np.ones((theta.size, 4))
    for k in range(theta.size):
        axis[k, 0], axis[k, 1], axis[k, 2] = theta[k], math.sin(theta[k]), math.cos(theta[k])
        if masking == 0:
            axis[k, 3] = 1.0 / (1.0 + smith_lambda(ndf, sigma, axis[k, 1] / axis[k, 2], False))
    return axis


def _neighbours(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the azimuths that are made coarsely, too (S,), and the range of them next to each azimuth (2, count)."""
    index = np.arange(count)
    taken = index[(index % STRIDE == 0) | (index < ENDS) | (index >= count - ENDS)]
    low = np.searchsorted(taken, index - STRIDE, side="left")
    high = np.searchsorted(taken, index + STRIDE, side="right")
    return taken, np.stack([low, high])


def _above(theta: Array) -> tuple[Array, Array]:
    """Return index and angle of the polar angles above the horizon."""
    index = np.flatnonzero(np.cos(theta) > HORIZON)
    return index, np.ascontiguousarray(theta[index], dtype=np.float64)


class Prepared:
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
        levels: Any = SMITH_LEVELS if self.masking == 0 else CAVITY_LEVELS
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
        """Fill out (I, O, P, C), float32 or float64, on a product grid of radians, in 1/sr.

        A square grid (both polar axes identical) is computed half and mirrored; at the horizon and below it is 0.
        """
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
        t_i, t_o = (np.array([transmission(n, c) for c in np.cos(axis)]) for _, axis in (lights, views))
        body = (t_i[:, None] * t_o)[:, :, None, None] * (self.kappa[channels] / math.pi)
        out[np.ix_(lights[0], views[0], range(out.shape[2]), channels)] = body

    def _fill_group(
        self, n: float, channels: Any, lights: Any, views: Any, phi: Array, square: bool, out: NDArray[np.floating]
    ) -> None:
        """Fill the channels of one index, block by block of lights."""
        ndf, sigma = self._setup.ndf, self._setup.alpha_x
        norm = gaussian_norm(sigma) if ndf == 3 else 1.0
        kappa = self.kappa[channels] / math.pi
        waves = np.cos(0.5 * phi), np.sin(phi)
        surface = (self.masking, ndf, sigma, norm, n, *waves, kappa, 0.5 * self._tolerance)
        axes = tuple(_axis(self.masking, ndf, sigma, axis[1]) for axis in (lights, views))
        places = lights[0], views[0]
        taken, ranges = _neighbours(phi.size)
        nodes = np.stack(gauss(next(count for least, count in PANELS if self._tolerance >= least)))
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
            _write(fine, coarse, taken, ranges, *axes, places, start, surface, channels, square, flags, out)
            cells = np.argwhere(flags)
            cells[:, 0] += start
            self.mended += len(cells)
            exact = np.empty(len(cells))
            _exact(cells, phi, *axes, nodes, surface, exact)
            _rewrite(cells, exact, *axes, places, surface, channels, square, out)


def prepare(setup: Setup, tolerance: float, trial: bool = False) -> Prepared | None:
    """Return the fast tables of an isotropic setup, or None where only direct evaluation serves.

    Parameters
    ----------
    setup : Setup
        From `brdftab.models.setup.resolve`.
    tolerance : float
        Relative error asked of every cell and channel; None is returned below 1e-6.
    trial : bool
        Prepared only to compile the kernels; nothing is cheaper for it here.
    """
    if setup.max_bounces != 1:
        return prepare_cavity(setup, prepare, tolerance, trial)
    if not setup.isotropic or tolerance < REACH:
        return None
    return Prepared(setup, tolerance)
