"""Fit the closed form of ilm-approx to the integral of ilm, and write coefficients.py.

    python tools/fit_ilm_approx.py [--map-only]

Needs SciPy and a minute or two. The draws are seeded: a second run writes the same digits but for the last ones. Then
the error map is printed, from directions that the fit has not seen; with --map-only nothing is fitted or written.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np

from brdftab import models
from brdftab.jit import parallel_kernel
from brdftab.models._shared.fresnel.interface import body_factor, external_reflectance
from brdftab.models.ilm_approx import coefficients
from brdftab.models.ilm_approx.approximation import body_with
from brdftab.models.ilm_approx.coefficients import FACET, LAMBERTIAN
from brdftab.models.resolve import resolve
from brdftab.typing import Array

SIGMAS = (0.05, 0.1, 0.2, 0.3, 0.45, 0.65, 0.85, 1.0, 1.25, 1.5)
INDICES = (1.1, 1.25, 1.5, 1.8, 2.1, 2.5)
MAP_SIGMAS, MAP_INDICES = (0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5), (1.0, 1.2, 1.5, 2.0, 2.5)
LIMITS = (60, 75, 85)
# relative error of the integral: small against that of the closed form
TOLERANCE = 5e-4
# directions beyond 75 degrees count less
GRAZING_WEIGHT = 0.35
# terms of r_e, measured error 2e-8
POWERS = 9
# parameters that enter denominators and square roots, by the size of the set
POSITIVE = {
    15: np.isin(np.arange(15), (0, 3, 11, 14)),
    11: np.isin(np.arange(11), (2, 6, 7, 8)),
}


def directions(seed: int, count: int, limit: float = 85.0) -> tuple[Array, Array, Array]:
    """Return theta_i, theta_o up to `limit` degrees and phi up to 180, each (count,) in radians, stratified."""
    rng = np.random.default_rng(seed)
    u = np.stack([(rng.permutation(count) + rng.random(count)) / count for _ in range(3)])
    return np.radians(limit) * u[0], np.radians(limit) * u[1], np.pi * u[2]


def exact(sigma: float, n: float, angles: tuple[Array, Array, Array]) -> Array:
    """Return the body integral I (N,), 1/sr, of the model ilm."""
    setup = resolve("ilm", kd=1.0, ior=n, sigma=sigma)
    kernel = models.kernel("ilm")
    values = kernel.points(setup, *angles, np.zeros_like(angles[0]), orders=2, tolerance=TOLERANCE)
    return np.asarray(values[:, 1, 0] / body_factor(1.0, n))


@parallel_kernel
def evaluate(lambert, facet, sigma, n, theta_i, theta_o, phi, out):
    """Fill out (N,) with I of trial coefficients (arrays)."""
    for k in numba.prange(out.size):
        si, ci = np.sin(theta_i[k]), np.cos(theta_i[k])
        so, co = np.sin(theta_o[k]), np.cos(theta_o[k])
        out[k] = body_with(lambert, facet, sigma, n, si, ci, so, co, np.cos(phi[k]))


def errors(
    lambert: Array, facet: Array, sigma: float, n: float, angles: tuple[Array, Array, Array], truth: Array
) -> Array:
    """Return the relative errors (N,) of trial coefficients."""
    out = np.empty(truth.size)
    evaluate(lambert, facet, sigma, n, *angles, out)
    return out / truth - 1.0


def fit(count: int = 1500) -> tuple[Array, Array]:
    """Return LAMBERTIAN and FACET by least squares on relative errors; smooth surfaces count more than rough ones."""
    from scipy.optimize import least_squares

    angles = directions(1, count)
    grazing = np.where(np.maximum(angles[0], angles[1]) > np.radians(75.0), GRAZING_WEIGHT, 1.0)
    weights = [grazing / (0.2 + sigma) for sigma in SIGMAS]
    facet = np.array(FACET)
    matte = [exact(sigma, 1.0, angles) for sigma in SIGMAS]

    def first(p: Array) -> Array:
        rows = zip(SIGMAS, weights, matte, strict=True)
        return np.concatenate([w * errors(p, facet, s, 1.0, angles, truth) for s, w, truth in rows])

    lambert = np.round(_solved(least_squares, first, np.array(LAMBERTIAN)), 5)
    cases = [(s, w, n, exact(s, n, angles)) for s, w in zip(SIGMAS, weights, strict=True) for n in INDICES]

    def second(p: Array) -> Array:
        return np.concatenate([w * errors(lambert, p, s, n, angles, truth) for s, w, n, truth in cases])

    return lambert, np.round(_solved(least_squares, second, facet), 5)


def _solved(least_squares: Any, residual: Any, start: Array) -> Array:
    """Return the least-squares parameters; those that enter denominators and square roots stay positive."""
    positive = POSITIVE[start.size]
    low = np.where(positive, 0.0, -np.inf)
    return np.asarray(least_squares(residual, np.maximum(start, low + 1e-6 * positive), bounds=(low, np.inf)).x)


def reflectance_powers() -> Array:
    """Return c (9,) with r_e = sum c_k y^(k+1) + n^2 (n^2 - 1)^2/(n^2 + 1)^3 ln y, y = (n - 1)/(n + 1), n <= 2.5."""
    y = 0.5 * (3.0 / 7.0) * (1.0 - np.cos(np.pi * (np.arange(80) + 0.5) / 80))
    n = (1.0 + y) / (1.0 - y)
    n2 = n * n
    rest = n2 * (n2 - 1.0) ** 2 / (n2 + 1.0) ** 3 * np.log(y)
    smooth = np.array([external_reflectance(float(x)) for x in n]) - rest
    return np.round(np.linalg.lstsq(y[:, None] ** np.arange(1, POWERS + 1), smooth, rcond=None)[0], 8)


def error_map(count: int = 1500) -> list[tuple[float, float, list[tuple[float, float]]]]:
    """Return rows sigma, n and (RMS, largest) relative error up to each of `LIMITS`, at `count` directions each."""
    rows = []
    sets = [(limit, directions(limit, count, float(limit))) for limit in LIMITS]
    for sigma in MAP_SIGMAS:
        for n in MAP_INDICES:
            pairs = []
            for _, angles in sets:
                e = errors(np.array(LAMBERTIAN), np.array(FACET), sigma, n, angles, exact(sigma, n, angles))
                pairs.append((float(np.sqrt(np.mean(e * e))), float(np.abs(e).max())))
            rows.append((sigma, n, pairs))
    return rows


def source(lambert: Array, facet: Array, powers: Array) -> str:
    """Return the text of coefficients.py."""
    lines = ['"""Coefficients of the closed form, written by tools/fit_ilm_approx.py; not to be edited by hand."""', ""]
    for name, values in (("LAMBERTIAN", lambert), ("FACET", facet), ("REFLECTANCE", powers)):
        lines += [f"{name} = (", *(f"    {float(x)!r}," for x in values), ")"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Fit and write, then print the error map as the table of docs/ilm-approx.md."""
    if "--map-only" not in sys.argv[1:]:
        text = source(*fit(), reflectance_powers())
        Path(coefficients.__file__).write_text(text)
        print(text)
        print("Run again with --map-only for the errors of these coefficients.")
        return
    print("| sigma | n_i | " + " | ".join(f"<= {limit} deg, RMS | max" for limit in LIMITS) + " |")
    print("| --- " * (2 + 2 * len(LIMITS)) + "|")
    for sigma, n, pairs in error_map():
        print(f"| {sigma:g} | {n:g} | " + " | ".join(f"{100 * r:.2f} % | {100 * m:.1f} %" for r, m in pairs) + " |")


if __name__ == "__main__":
    main()
