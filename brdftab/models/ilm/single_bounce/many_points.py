"""The body integral of blocks of a product grid at one resolution: rings.py, and in V-cavities wedges.py on top."""

from __future__ import annotations

import math

import numpy as np

from brdftab.models._shared.codes import GGX
from brdftab.models.ilm.single_bounce.azimuth_modes import azimuth_basis, block, modes
from brdftab.models.ilm.single_bounce.masking_corrections import add_wedges, wedge_rule
from brdftab.typing import Array

# looser tolerances, and polar angles farther from the horizon, allow wedges in float32
SINGLE_TOLERANCE, SINGLE_COSINE = 9e-6, 1e-5


class Bodies:
    """pi I of a product grid without Smith's masking, block by block of lights.

    Parameters
    ----------
    ndf : int
        0 Beckmann, 1 GGX, 3 Gaussian in the tilt.
    cavity : bool
        V-cavity masking.
    sigma, n : float
        Roughness, positive, and refractive index.
    theta_i, theta_o, phi : ndarray
        Axes in radians, below the horizon nothing; the same object twice is computed once.
    sizes : tuple of int
        Rings, modes, and radii and angles of the wedges.
    tolerance : float
        Relative error asked of the table: wedges that cannot matter to it are left out.
    """

    def __init__(
        self,
        ndf: int,
        cavity: bool,
        sigma: float,
        n: float,
        theta_i: Array,
        theta_o: Array,
        phi: Array,
        sizes: tuple[int, int, int, int],
        tolerance: float,
    ) -> None:
        self._modes = modes(ndf, sigma, n, cavity, theta_i, theta_o, sizes[:2])
        self._basis = azimuth_basis(phi, sizes[1])
        # the share of GGX facets beyond a stretched slope d is 1/d^2
        reach = 100.0 / tolerance if ndf == GGX else 10.0 - math.log(tolerance)
        self._rule = wedge_rule(ndf, sigma, reach, *sizes[2:]) if cavity else None
        nearest = min(float(np.cos(axis).min()) for axis in (theta_i, theta_o))
        single = tolerance >= SINGLE_TOLERANCE and nearest >= SINGLE_COSINE
        self._type = np.zeros(1, np.float32 if single else np.float64)
        self._surface = (ndf, sigma, (n - 1.0) * (n + 1.0))
        self._axes = (theta_i, theta_o, np.cos(phi), np.sin(phi))

    def block(self, start: int, stop: int, columns: int, triangle: bool) -> Array:
        """Return pi I (stop - start, columns, phi) of the first `columns` views; o <= i only where `triangle`."""
        out = block(self._modes, self._basis, start, stop, columns)
        if self._rule is not None:
            add_wedges(*self._surface, self._rule, self._type, *self._axes, start, triangle, out)
        return out
