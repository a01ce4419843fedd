"""A chi-square test of samples on the hemisphere against the density that they should follow.

Bins are quantile boxes in polar angle and azimuth, of the outgoing direction or of the half vector. Half-vector space
suits densities that grow like 1/sin(theta_h) at the mirror direction: do = 4 (i.h) sin(theta_h) dtheta_h dphi_h
cancels it. What a bin should hold is integrated adaptively, so that kinks and the horizon cost points, not accuracy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

Density = Callable[[np.ndarray, np.ndarray], np.ndarray]
_X, _W = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True)
class Verdict:
    """The statistic, its degrees of freedom and p-value, and the integral of the density over all bins."""

    statistic: float
    freedom: int
    p_value: float
    integral: float


def sidak(level: float, tests: int) -> float:
    """Return the p-value below which one of `tests` independent tests fails, at that level for all of them together."""
    return -np.expm1(np.log1p(-level) / tests)


def half_angles(theta_i: float, phi_i: float, theta_o: np.ndarray, phi_o: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return polar angle and azimuth in [0, 2 pi) of the half vectors."""
    x = np.sin(theta_i) * np.cos(phi_i) + np.sin(theta_o) * np.cos(phi_o)
    y = np.sin(theta_i) * np.sin(phi_i) + np.sin(theta_o) * np.sin(phi_o)
    z = np.cos(theta_i) + np.cos(theta_o)
    return np.arctan2(np.hypot(x, y), z), np.mod(np.arctan2(y, x), 2 * np.pi)


def in_half_space(density: Density, theta_i: float, phi_i: float) -> Density:
    """Turn a density of (theta_o, phi_o) into that of (theta_h, phi_h), both per solid angle."""
    i = np.array([np.sin(theta_i) * np.cos(phi_i), np.sin(theta_i) * np.sin(phi_i), np.cos(theta_i)])

    def transformed(theta_h: np.ndarray, phi_h: np.ndarray) -> np.ndarray:
        s = np.sin(theta_h)
        h = np.stack([s * np.cos(phi_h), s * np.sin(phi_h), np.cos(theta_h)], axis=-1)
        i_h = h @ i
        o = 2 * i_h[:, None] * h - i
        up = (i_h > 0) & (o[:, 2] > 0)
        out = np.zeros(theta_h.shape)
        v = o[up]
        out[up] = 4 * i_h[up] * density(np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2]), np.arctan2(v[:, 1], v[:, 0]))
        return out

    return transformed


def grain_angles(theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle to azimuth 0, in [0, pi], and twice the angle around that axis, in [0, 2 pi].

    Surfaces with a grain send light along cones around azimuth 0, on which the first angle is constant.
    """
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    return np.arctan2(np.hypot(y, z), x), 2 * np.arctan2(z, -y)


def in_grain_space(density: Density) -> Density:
    """Turn a density of (theta, phi) into that of `grain_angles`, both per solid angle."""

    def transformed(cone: np.ndarray, twice: np.ndarray) -> np.ndarray:
        x, y, z = np.cos(cone), -np.sin(cone) * np.cos(0.5 * twice), np.sin(cone) * np.sin(0.5 * twice)
        return 0.5 * density(np.arctan2(np.hypot(x, y), z), np.arctan2(y, x))

    return transformed


def _gauss(density: Density, boxes: np.ndarray) -> np.ndarray:
    """Integrate over boxes (M, 4) of polar angle and azimuth by 3 x 3 Gauss points each."""
    polar = 0.5 * (boxes[:, [0]] + boxes[:, [1]] + _X * (boxes[:, [1]] - boxes[:, [0]]))
    azimuth = 0.5 * (boxes[:, [2]] + boxes[:, [3]] + _X * (boxes[:, [3]] - boxes[:, [2]]))
    t = np.repeat(polar, 3, axis=1)
    f = density(t.reshape(-1), np.tile(azimuth, (1, 3)).reshape(-1)).reshape(t.shape) * np.sin(t)
    area = 0.25 * (boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2])
    return area * (f @ np.outer(_W, _W).reshape(-1))


def integrate(density: Density, boxes: np.ndarray, tolerance: float, rounds: int = 7) -> np.ndarray:
    """Integrate over boxes (M, 4); halve both sides where a box and its quarters differ by more than `tolerance`."""
    total = np.zeros(len(boxes))
    owner, coarse = np.arange(len(boxes)), _gauss(density, boxes)
    for k in range(rounds):
        a, c = 0.5 * (boxes[:, 0] + boxes[:, 1]), 0.5 * (boxes[:, 2] + boxes[:, 3])
        quarters = np.stack(
            [
                np.stack([lo, hi, left, right], axis=-1)
                for lo, hi in ((boxes[:, 0], a), (a, boxes[:, 1]))
                for left, right in ((boxes[:, 2], c), (c, boxes[:, 3]))
            ],
            axis=1,
        )
        fine = _gauss(density, quarters.reshape(-1, 4)).reshape(-1, 4)
        rough = (np.abs(fine.sum(axis=1) - coarse) > tolerance) & (k < rounds - 1)
        np.add.at(total, owner[~rough], fine[~rough].sum(axis=1))
        boxes, coarse = quarters[rough].reshape(-1, 4), fine[rough].reshape(-1)
        owner = np.repeat(owner[rough], 4)
        if not len(owner):
            break
    return total


def edges(values: np.ndarray, bins: int, top: float) -> np.ndarray:
    """Return `bins` + 1 edges from 0 to `top`, at the quantiles of a pilot sample in between."""
    inner = np.quantile(values, np.arange(1, bins) / bins)
    return np.concatenate([[0.0], inner, [top]])


def graded(marks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split bins that are wide beside a narrow neighbour, at distances doubling from the common edge.

    The peak beside a wide bin reaches into it, thinner than three Gauss points would notice. Returns the finer edges
    and the bin that each finer interval belongs to.
    """
    widths = np.diff(marks)
    splits = list(marks)
    for j, width in enumerate(widths):
        for neighbour, start, sign in ((j - 1, marks[j], 1), (j + 1, marks[j + 1], -1)):
            step = widths[neighbour] if 0 <= neighbour < len(widths) else width
            while step < 0.5 * width:
                splits.append(start + sign * step)
                step *= 2
    fine = np.unique(splits)
    return fine, np.searchsorted(marks, 0.5 * (fine[1:] + fine[:-1])) - 1


def chi_square(observed: np.ndarray, share: np.ndarray, least: float = 5.0) -> tuple[float, int, float]:
    """Compare counts with the shares expected of them; bins below `least` expected counts are pooled.

    Returns the statistic, the degrees of freedom and the p-value.
    """
    expected = observed.sum() * share
    order = np.argsort(expected)
    observed, expected = observed[order], expected[order]
    # as many of the smallest as it takes for the pool itself to reach `least`
    pooled = int(np.sum(expected < least))
    while pooled and expected[:pooled].sum() < least:
        pooled += 1
    if pooled:
        observed = np.concatenate([[observed[:pooled].sum()], observed[pooled:]])
        expected = np.concatenate([[expected[:pooled].sum()], expected[pooled:]])
    statistic = float(np.sum((observed - expected) ** 2 / expected))
    freedom = len(expected) - 1
    return statistic, freedom, float(chi2.sf(statistic, freedom))


def check(
    pilot: tuple[np.ndarray, np.ndarray],
    points: tuple[np.ndarray, np.ndarray],
    invalid: int,
    density: Density,
    top: float = 0.5 * np.pi,
    bins: tuple[int, int] = (20, 20),
    jumps: int = 1,
) -> Verdict:
    """Test `points` (polar, azimuth) and the count of invalid samples against a density per solid angle.

    The bins come from the independent `pilot`; no polar angle exceeds `top`, which for half vectors is halfway from
    the light to the horizon. A density may jump at so many equal steps of the azimuth, `jumps`. The
    share left over by the density belongs to the invalid samples.
    """
    polar, azimuth = edges(pilot[0], bins[0], top), edges(pilot[1], bins[1], 2 * np.pi)
    counts = np.histogram2d(*points, bins=(polar, azimuth))[0].reshape(-1)
    total = counts.sum() + invalid
    (fine_polar, row), (fine_azimuth, _) = graded(polar), graded(azimuth)
    fine_azimuth = np.unique(np.concatenate([fine_azimuth, 2 * np.pi * np.arange(1, jumps) / jumps]))
    column = np.searchsorted(azimuth, 0.5 * (fine_azimuth[1:] + fine_azimuth[:-1])) - 1
    lo, left = np.meshgrid(fine_polar[:-1], fine_azimuth[:-1], indexing="ij")
    hi, right = np.meshgrid(fine_polar[1:], fine_azimuth[1:], indexing="ij")
    boxes = np.stack([lo, hi, left, right], axis=-1).reshape(-1, 4)
    owner = (row[:, None] * bins[1] + column).reshape(-1)
    # a tenth of the standard deviation of a typical count, and the finer estimate is the one that is kept
    parts = integrate(density, boxes, 0.1 / np.sqrt(total * len(counts)))
    share = np.bincount(owner, parts, len(counts))
    observed = np.concatenate([counts, [invalid]])
    expected = np.concatenate([share, [1 - share.sum()]])
    return Verdict(*chi_square(observed, expected), integral=float(share.sum()))
