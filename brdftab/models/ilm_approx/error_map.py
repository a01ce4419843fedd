"""What the approximate body leaves against the integral: RMS and largest relative error by roughness, index, angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.models.setup import resolve

Array = NDArray[np.float64]
SIGMAS = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0)
INDICES = (1.0, 1.1, 1.3, 1.5, 2.0, 3.0)
# degrees; both polar angles are at most this
RANGES = (60.0, 75.0, 85.0)
STEP = 5.0
HEAD = """# The approximate body of ilm-approx

<!-- written by python -m brdftab.models.ilm_approx.fit_coefficients --map; edit the sources instead -->

`ilm-approx` is `ilm` (Beckmann, Torrance-Sparrow, single bounces) with its body integral replaced by a closed form of
45 coefficients. The specular part is exact. The body is exact for a flat surface (sigma = 0), reciprocal for every
roughness, and without interface (ior = 1) it is the fitted reflection of Lambertian facets itself. The coefficients
were fitted for sigma from 0.02 to 2, ior from 1 to 3 and polar angles to 75 degrees (to 85 degrees at a third of the
weight). Use `ilm` where the error matters: it is a tolerance there.

Relative error of the body in percent, RMS / largest, over directions every 5 degrees of both polar angles, up to the
angle given, and of phi.
"""


def grid() -> tuple[Array, Array, Array]:
    """Return theta_i, theta_o, phi (N,) in radians every STEP degrees, theta_o <= theta_i."""
    theta, phi = np.arange(0.0, RANGES[-1] + 0.5, STEP), np.arange(0.0, 180.5, STEP)
    ti, to, p = (np.radians(a).reshape(-1) for a in np.meshgrid(theta, theta, phi, indexing="ij"))
    keep = to <= ti
    return ti[keep], to[keep], p[keep]


def relative_errors(sigma: float, n: float, angles: tuple[Array, Array, Array]) -> Array:
    """Return body/exact - 1 (N,)."""
    given = {"sigma": sigma, "ior": n, "kd": 1.0}
    found, exact = (
        models.kernel(name).points(resolve(name, **given), *angles, 0.0 * angles[0], orders=1, tolerance=1e-4)[:, 1, 0]
        for name in ("ilm-approx", "ilm")
    )
    return found / exact - 1.0


def table(sigmas: tuple[float, ...] = SIGMAS, indices: tuple[float, ...] = INDICES) -> Array:
    """Return RMS and largest error (ranges, sigmas, indices, 2)."""
    angles = grid()
    out = np.empty((len(RANGES), len(sigmas), len(indices), 2))
    for s, sigma in enumerate(sigmas):
        for k, n in enumerate(indices):
            error = relative_errors(sigma, n, angles)
            for r, top in enumerate(RANGES):
                part = error[angles[0] <= np.radians(top + 1e-6)]
                out[r, s, k] = np.sqrt(np.mean(part**2)), np.abs(part).max()
    return out


def page() -> str:
    """Return docs/ilm-approx.md."""
    found, text = table(), HEAD
    for r, top in enumerate(RANGES):
        text += f"\n## Up to {top:g} degrees\n\n"
        text += (
            "| sigma | " + " | ".join(f"ior {n:g}" for n in INDICES) + " |\n" + "| --- " * (len(INDICES) + 1) + "|\n"
        )
        for s, sigma in enumerate(SIGMAS):
            cells = (f"{100 * rms:.2g} / {100 * most:.2g}" for rms, most in found[r, s])
            text += f"| {sigma:g} | " + " | ".join(cells) + " |\n"
    return text
