"""Fit the polynomials of approximation.py to the body integral of ilm, and map what error remains.

python -m brdftab.models.ilm_approx.fit_coefficients          # write coefficients.py
python -m brdftab.models.ilm_approx.fit_coefficients --map    # print the error map of docs/ilm-approx.md
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.models.setup import resolve

Array = NDArray[np.float64]
Term = tuple[int, int, int, int]
SIGMAS = tuple(float(round(s, 4)) for s in np.geomspace(0.02, 2.0, 40))
INDICES = (1.02, 1.1, 1.25, 1.4, 1.5, 1.7, 2.0, 2.5, 3.0)
PAIRS = 300
# directions below STEEP are what the fit is for; the others count less
STEEP, LESS = np.radians(75.0), 0.3
LOWEST = np.radians(85.0)
STEPS = 30
HEAD = '''"""Terms (p, q, m, k, coefficient) of x_i^p x_o^q cos(phi)^m y^k; written by fit_coefficients.py.

LAMBERT, of ln L, is symmetric: p >= q, and terms with p > q stand for both orders. COSINE is Q of direction i.
"""
'''


def lambert_terms() -> list[Term]:
    """Return the powers of ln L: degree 4, the second harmonic of the azimuth, y^2 where the degree is at most 2."""
    found = []
    for p in range(5):
        for q in range(min(p, 4 - p) + 1):
            for m in range(min(2, q) + 1):
                for k in range(3 if p + q <= 2 else 2):
                    if p + k > 0:
                        found.append((p, q, m, k))
    return found


def cosine_terms() -> list[Term]:
    """Return the powers of Q: degree 2 and the first harmonic."""
    found = []
    for p in range(3):
        for q in range(3 - p):
            for m in range(min(p, q, 1) + 1):
                for k in range(2):
                    if p + q + k > 0:
                        found.append((p, q, m, k))
    return found


class Data:
    """Random pairs of directions with their body integral times pi: sigma, n, angles and value, (N,) each."""

    def __init__(self, indices: tuple[float, ...], seed: int, sigmas: tuple[float, ...] = SIGMAS) -> None:
        rng = np.random.default_rng(seed)
        parts = []
        for sigma in sigmas:
            for n in indices:
                below = rng.random((2, PAIRS)) < 0.8
                theta = np.where(
                    below, rng.random((2, PAIRS)) * STEEP, STEEP + rng.random((2, PAIRS)) * (LOWEST - STEEP)
                )
                phi = np.pi * rng.random(PAIRS)
                setup = resolve("ilm", sigma=sigma, ior=n, kd=1.0)
                layers = models.kernel("ilm").points(setup, *theta, phi, 0.0 * phi, orders=1, tolerance=1e-4)
                # kappa is known, so it is divided out
                flat = resolve("ilm", sigma=0.0, ior=n, kd=1.0)
                zero = np.zeros(1)
                normal = models.kernel("ilm").points(flat, zero, zero, zero, zero, orders=1, tolerance=1e-4)[0, 1, 0]
                passed = 1.0 - ((n - 1.0) / (n + 1.0)) ** 2
                value = layers[:, 1, 0] * passed**2 / normal
                parts.append(np.stack([np.full(PAIRS, sigma), np.full(PAIRS, n), *theta, phi, value]))
        self.sigma, self.n, self.theta_i, self.theta_o, self.phi, self.value = np.concatenate(parts, axis=1)

    @property
    def steepest(self) -> Array:
        """Return the larger polar angle (N,)."""
        return np.maximum(self.theta_i, self.theta_o)

    def weight(self) -> Array:
        """Return how much each pair counts (N,)."""
        return np.where(self.steepest > STEEP, LESS, 1.0)

    def start(self, theta: Array) -> Array:
        """Return cos theta + sigma sin theta."""
        return np.cos(theta) + self.sigma * np.sin(theta)

    def terms(self, powers: list[Term], swapped: bool = False) -> Array:
        """Return the terms (N, K) of a polynomial without their coefficients."""
        x, z = (self.sigma * np.sin(t) / self.start(t) for t in (self.theta_i, self.theta_o))
        if swapped:
            x, z = z, x
        c, y = np.cos(self.phi), self.sigma**2 / (1.0 + self.sigma**2)
        return np.stack([x**p * z**q * c**m * y**k for p, q, m, k in powers], axis=1)


def _transmission(n: Array, c: Array) -> Array:
    """Return T as `microfacet.interface.transmission` does, for arrays."""
    g = np.sqrt((n - 1.0) * (n + 1.0) + c * c)
    return 2.0 * g * c * (1.0 / (g + c) ** 2 + n * n / (n * n * c + g) ** 2)


def fit_lambert(data: Data) -> Array:
    """Fit ln L to facets without interface; returns the coefficients of `lambert_terms`."""
    powers = lambert_terms()
    both = np.array([1.0 if p == q else 2.0 for p, q, _, _ in powers])
    terms = 0.5 * both * (data.terms(powers) + data.terms(powers, swapped=True))
    weight = data.weight()
    return np.linalg.lstsq(terms * weight[:, None], np.log(data.value) * weight, rcond=None)[0]


def log_lambert(data: Data, coefficients: Array) -> Array:
    """Return ln L (N,)."""
    powers = lambert_terms()
    both = np.array([1.0 if p == q else 2.0 for p, q, _, _ in powers])
    return 0.5 * (data.terms(powers) + data.terms(powers, swapped=True)) @ (both * coefficients)


def fit_cosine(data: Data, lambert: Array) -> Array:
    """Fit Q to what remains of the integral once L is divided out, by damped Gauss-Newton steps."""
    powers = cosine_terms()
    sides = [(data.terms(powers, k == 1), data.start(t)) for k, t in enumerate((data.theta_i, data.theta_o))]
    target, weight = np.log(data.value) - log_lambert(data, lambert), data.weight()

    def residual(found: Array) -> tuple[Array, Array]:
        rest, slope = -target, np.zeros((target.size, len(powers)))
        for terms, start in sides:
            c = start * np.exp(terms @ found)
            inside = np.minimum(c, 1.0)
            passed, step = _transmission(data.n, inside), 1e-6
            change = _transmission(data.n, inside * (1 + step)) - _transmission(data.n, inside * (1 - step))
            rest = rest + np.log(passed)
            slope += (change / (2.0 * step * passed) * (c < 1.0))[:, None] * terms
        return rest * weight, slope * weight[:, None]

    found, damping = np.zeros(len(powers)), 1e-6
    rest, slope = residual(found)
    for _ in range(STEPS):
        hessian = slope.T @ slope + 1e-3 * damping * target.size * np.eye(len(powers))
        trial = found - np.linalg.solve(hessian, slope.T @ rest)
        new = residual(trial)
        if new[0] @ new[0] < rest @ rest:
            found, (rest, slope), damping = trial, new, max(0.3 * damping, 1e-9)
        else:
            damping *= 10.0
    return found


def source(lambert: Array, cosine: Array) -> str:
    """Return the text of coefficients.py."""
    text = HEAD
    for name, powers, values in (("LAMBERT", lambert_terms(), lambert), ("COSINE", cosine_terms(), cosine)):
        rows = "".join(f"    ({p}, {q}, {m}, {k}, {v:.9g}),\n" for (p, q, m, k), v in zip(powers, values, strict=True))
        text += f"\n{name} = (\n{rows})\n"
    return text


def write() -> None:
    """Fit both polynomials and write coefficients.py beside this file."""
    lambert = fit_lambert(Data((1.0,), 1))
    cosine = fit_cosine(Data(INDICES, 2), lambert)
    Path(__file__).with_name("coefficients.py").write_text(source(lambert, cosine))


if __name__ == "__main__":
    if sys.argv[1:] == ["--map"]:
        from brdftab.models.ilm_approx.error_map import page

        print(page(), end="")
    else:
        write()
