"""Gauss rules, each made once, and the polynomials of their nodes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from brdftab.typing import Array


@lru_cache
def _gauss(count: int) -> tuple[Array, Array]:
    x, w = np.polynomial.legendre.leggauss(count)
    return x, w


def gauss(count: int) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights on (-1, 1), (count,) each."""
    x, w = _gauss(count)
    return x.copy(), w.copy()


@lru_cache
def unit_gauss(count: int) -> Array:
    """Return Gauss-Legendre nodes and weights on (0, 1), shape (2, count)."""
    x, w = gauss(count)
    return np.stack([0.5 * (1.0 + x), 0.5 * w])


@lru_cache
def unit_jacobi(count: int, exponent: float) -> Array:
    """Return nodes and weights on (0, 1), shape (2, count), for x^exponent times what is smooth; exponent > -1.

    From the three-term recurrence of Jacobi's polynomials (Golub and Welsch 1969). The weights are those of
    Gauss-Jacobi over x^exponent: what is summed is the whole integrand.
    """
    j = np.arange(1.0, count)
    total = 2.0 * j + exponent
    side = 2.0 * j * (j + exponent) / (total * np.sqrt((total + 1.0) * (total - 1.0)))
    middle = np.concatenate([[exponent / (exponent + 2.0)], exponent**2 / (total * (total + 2.0))])
    found, vectors = np.linalg.eigh(np.diag(middle) + np.diag(side, 1) + np.diag(side, -1))
    x = 0.5 * (1.0 + found)
    return np.stack([x, vectors[0] ** 2 / (exponent + 1.0) * x**-exponent])


def lagrange(nodes: Array, points: Array) -> Array:
    """Return the Lagrange polynomials of nodes (Q,) at points (...), shape (..., Q)."""
    found = np.ones((*points.shape, nodes.size))
    for k in range(nodes.size):
        for j in range(nodes.size):
            if j != k:
                # factors of order one each, so that products neither overflow nor vanish
                found[..., k] *= (points - nodes[j]) / (nodes[k] - nodes[j])
    return found
