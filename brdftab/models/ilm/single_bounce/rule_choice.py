"""Which rule the body integral takes for an asked relative error, and what error that rule is known to have.

The curves were measured against the split rule with 48 nodes, over random settings: roughness 1e-6 to 10 in both
directions, index 1 to 100 with 1 + 1e-6 to 1.1 among them, polar angles to 89.999 degrees, phi to 180 degrees.

Split rule, largest (95th percentile) relative error by nodes a piece: 4 nodes 1e-2 (3e-3), 6 nodes 4e-4 (6e-5), 8 nodes
2e-5 (1e-6), 12 nodes 4e-7 (7e-10), 16 nodes 4e-8 (4e-12). As the spread is so wide, errors below 3e-5 are not left to
a count: successive levels are compared until their relative difference d says that the finer one is good, its error
taken as 4 d^1.15.

Plain rule: `PLAIN`, by the largest stretched slope x = sigma max(1, tan theta) of both directions.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.models._shared.codes import GAUSSIAN, GGX
from brdftab.models.ilm.single_bounce.body import plain_integral, split_integral
from brdftab.quadrature import unit_gauss

LEVELS = (4, 6, 8, 12, 16, 24, 32)
# nodes in radius and azimuth of the plain rules
PLAIN_COUNTS = ((2, 6), (3, 8), (4, 10), (6, 14))
# number of the plain rule, up to which x, and twice the largest relative error measured there; cheapest first
PLAIN = np.array(
    [
        (0, 0.05, 2e-9), (0, 0.1, 6e-8), (0, 0.2, 8e-6), (0, 0.3, 1e-4), (0, 0.35, 4e-4),
        (1, 0.05, 2e-12), (1, 0.1, 3e-10), (1, 0.2, 4e-8), (1, 0.25, 3e-7), (1, 0.3, 8e-6),
        (2, 0.05, 4e-15), (2, 0.1, 1e-12), (2, 0.16, 3e-10), (2, 0.25, 2e-8),
        (3, 0.13, 4e-15), (3, 0.16, 1e-13), (3, 0.2, 1e-10),
    ]
)  # fmt: skip
ROUNDING = 4e-15


def _packed(rules: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return rules (2, m) side by side, and where each starts, the end included: constants of the kernels."""
    starts = np.cumsum([0, *(rule.shape[1] for rule in rules)])
    return np.concatenate(rules, axis=1), starts


_GAUSS, _GAUSS_AT = _packed([unit_gauss(m) for m in LEVELS])
_LAGUERRE, _LAGUERRE_AT = _packed([np.stack(np.polynomial.laguerre.laggauss(k)) for k, _ in PLAIN_COUNTS])


@kernel
def plain_choice(ndf, slope, tolerance):
    """Return the number of the cheapest plain rule for stretched slopes up to `slope` and its error; -1 if none."""
    if ndf != GGX:
        for k in range(PLAIN.shape[0]):
            if slope <= PLAIN[k, 1] and PLAIN[k, 2] <= max(tolerance, ROUNDING):
                return int(PLAIN[k, 0]), PLAIN[k, 2]
    return -1, 0.0


@kernel
def first_level(tolerance):
    """Return the level to start with, the error it is known to have, and whether that settles it."""
    if tolerance >= 1.5e-2:
        return 0, 1.2e-2, True
    if tolerance >= 5e-4:
        return 1, 5e-4, True
    if tolerance >= 3e-5:
        return 2, 3e-5, True
    if tolerance >= 1e-7:
        return 1, 5e-4, False
    if tolerance >= 1e-10:
        return 2, 3e-5, False
    return 3, 1e-6, False


@kernel
def _split(level, ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, tolerance):
    """Return I by the split rule of one level."""
    gauss = _GAUSS[:, _GAUSS_AT[level] : _GAUSS_AT[level + 1]]
    return split_integral(ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, gauss, tolerance)


@kernel
def body_integral(ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, tolerance):
    """Return I (1/sr), unmasked with Smith, and its estimated relative error; arguments as in `split_integral`."""
    unit = math.sqrt(2.0) if ndf == GAUSSIAN else 1.0
    slope = unit * max(max(sx, sy), math.hypot(sx * ix, sy * iy), math.hypot(sx * ox, sy * oy))
    rule, error = plain_choice(ndf, slope, tolerance)
    if rule >= 0:
        laguerre = _LAGUERRE[:, _LAGUERRE_AT[rule] : _LAGUERRE_AT[rule + 1]]
        steps = PLAIN_COUNTS[rule][1]
        return plain_integral(ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, laguerre, steps), error
    level, error, settled = first_level(tolerance)
    found = _split(level, ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, tolerance)
    while not settled and level + 1 < len(LEVELS):
        level += 1
        finer = _split(level, ndf, cavity, sx, sy, norm, n, ix, iy, iz, ox, oy, oz, tolerance)
        error = max(4.0 * (abs(finer - found) / max(abs(finer), 1e-300)) ** 1.15, ROUNDING)
        found = finer
        settled = error <= tolerance
    return found, error
