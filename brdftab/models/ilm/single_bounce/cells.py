"""Cells of a single-bounce table: specular and body together, their error judged, and single ones made again."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models._shared.codes import GAUSSIAN, SEPARABLE, V_CAVITY
from brdftab.models._shared.facets.gaussian import gaussian_density
from brdftab.models._shared.facets.masking import smith_lambda, v_cavity
from brdftab.models._shared.facets.ndf import density
from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models.ilm.single_bounce.body import split_integral

# the error of the finer resolution falls at least like the square of the number of rings and modes
SAFETY = 0.5


@kernel
def specular(surface, angles, half, sine):
    """Return D G/(4 i_z o_z) in 1/sr and i.h; angles is from `pair`, half and sine are cos(phi/2) and sin(phi)."""
    masking, ndf, sigma, norm = surface[0], surface[1], surface[2], surface[3]
    difference, _, ci, so, co, g = angles
    x, y, up = difference + 2.0 * so * half * half, so * sine, ci + co
    flat = math.sqrt(x * x + y * y)
    full = math.sqrt(flat * flat + up * up)
    c, s, i_h = up / full, flat / full, 0.5 * full
    d = gaussian_density(sigma, norm, c, s) if ndf == GAUSSIAN else density(ndf, sigma, c, s)
    if masking == V_CAVITY:
        g = v_cavity(c, ci, co, i_h)
    return d * g / (4.0 * ci * co), i_h


@kernel
def pair(light, view):
    """Return what `specular` takes of two polar angles; light and view are rows of `axis`."""
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
def write(body, coarse, taken, ranges, lights, views, places, first, surface, channels, square, flags, out):
    """Write a block of cells from pi I, and flag those to be made again.

    body (lights, views, phi), coarse (lights, views, S): pi I without Smith's masking at all azimuths and at those
    `taken`; ranges (2, phi): which of these are next to an azimuth; lights, views: from `axis`; places: their indices
    in out.
    """
    rows, columns, steps = body.shape
    for index in numba.prange(rows * columns):
        i, o = index // columns, index % columns
        if square and o > first + i:
            continue
        angles = pair(lights[first + i], views[o])
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
def exact(cells, phi, lights, views, nodes, surface, bodies):
    """Fill bodies (N,) with pi I of the cells (N, 3) by the split rule."""
    masking, ndf, sigma, norm, n = surface[0], surface[1], surface[2], surface[3], surface[4]
    for m in numba.prange(len(cells)):
        i, o, p = cells[m, 0], cells[m, 1], cells[m, 2]
        ci, co = lights[i, 2], views[o, 2]
        a, b = lights[i, 1] / ci, views[o, 1] / co
        x, y = b * math.cos(phi[p]), b * math.sin(phi[p])
        # a tighter tolerance keeps the far facets of GGX, which grazing cells of smooth surfaces are made of
        body = split_integral(
            ndf, masking == V_CAVITY, sigma, sigma, norm, n, a, 0.0, ci, x, y, co, nodes, 0.02 * surface[8]
        )
        bodies[m] = math.pi * lights[i, 3] * views[o, 3] * body


@kernel
def rewrite(cells, bodies, lights, views, places, surface, channels, square, out):
    """Write the cells (N, 3) again from pi I."""
    for m in range(len(cells)):
        i, o, p = cells[m, 0], cells[m, 1], cells[m, 2]
        angles = pair(lights[i], views[o])
        _put(places[0][i], places[1][o], p, angles, bodies[m], 0.0, surface, channels, square, out)


@kernel
def axis(masking, ndf, sigma, theta):
    """Return theta, its sine and cosine, and Smith's G1 (1 with V-cavities, which mask inside the integral), (N, 4)."""
    axis = np.ones((theta.size, 4))
    for k in range(theta.size):
        axis[k, 0], axis[k, 1], axis[k, 2] = theta[k], math.sin(theta[k]), math.cos(theta[k])
        if masking == SEPARABLE:
            axis[k, 3] = 1.0 / (1.0 + smith_lambda(ndf, sigma, axis[k, 1] / axis[k, 2], False))
    return axis
