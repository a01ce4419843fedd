"""From wavelengths to channels, and the tuple in which a setup's reflectance enters a kernel."""

from __future__ import annotations

from typing import Any

import numpy as np

from brdftab.jit import kernel
from brdftab.materials import quadrature
from brdftab.materials.fresnel import CONDUCTOR, MIRROR, Fresnel, metal
from brdftab.models._shared.fresnel.fresnel import fill_table
from brdftab.models.resolve import Setup

# a linear look-up of this many cells is good to 2e-7 for metals
CELLS = 4096
EXACT = np.empty((1, 0))


def arguments(fresnel: Fresnel, tolerance: float) -> tuple[Any, ...]:
    """Return (kind, a, b, table) for the kernels; the table is empty (exact values) where it would cost digits.

    Parameters
    ----------
    fresnel : Fresnel
        The reflectance.
    tolerance : float
        Relative error asked of the result.
    """
    a = np.ascontiguousarray(fresnel.a, dtype=np.float64)
    b = np.ascontiguousarray(fresnel.b, dtype=np.float64)
    table = EXACT
    if fresnel.kind != MIRROR and tolerance > 1e-5:
        filled, error = fill_table(fresnel.kind, a, b, CELLS)
        if error <= 0.01 * tolerance:
            table = filled
    return fresnel.kind, a, b, table


def thinned(setup: Setup, tolerance: float) -> Fresnel:
    """Return the reflectance with as few wavelengths as the relative tolerance allows, for orders two and above.

    Only a metal by name at its default count is thinned; what the user chose is kept.
    """
    assert setup.fresnel is not None
    name = setup.parameters.get("material")
    if setup.fresnel.kind != CONDUCTOR or name is None or {"wavelengths", "spectral_samples"} & setup.parameters.keys():
        return setup.fresnel
    for count in quadrature.counts(name):
        if quadrature.rule(name, count).error <= tolerance and count < setup.fresnel.a.size:
            return metal(name, samples=count)
    return setup.fresnel


@kernel
def project(acc, weights, out):
    """Write out[p, c] = sum_w acc[p, w] weights[w, c]."""
    for p in range(acc.shape[0]):
        for c in range(weights.shape[1]):
            total = 0.0
            for w in range(weights.shape[0]):
                total += acc[p, w] * weights[w, c]
            out[p, c] = total
