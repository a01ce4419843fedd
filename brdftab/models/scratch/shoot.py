"""Rays through a scratch, bin by bin of the incident angle: what leaves where, after how many bounces."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models.scratch.tracer import GROUPS, path

# orders kept apart; the last one holds all higher ones
ORDERS = 5
# paths of two bounces and more are kept apart by their smallest cosine of incidence, too: other walls, other colours
SMALL, LARGE = 0.15, 0.4
CLASSES = 3
LAYERS = 1 + (ORDERS - 1) * CLASSES
# what is kept of each layer: mass, and mass times number of bounces, representative cosines, square of the smallest one
# and its product with the mean of the others
KEPT = 4 + GROUPS
# rays whose exit angles are further apart (in bins) are looked at in between
APART = 3.0
# how often an interval between two rays is halved where their numbers of bounces differ, and where only angles do
HALVINGS, SMOOTH, FEW = 7, 3, 1
# edges of intervals a column that get all these halvings
EDGES = 16
# times as many angles in the two bins at the horizon
GRAZING = 8
END = 1e-9


@kernel
def _spread(out, before, after, mass, one, other):
    """Add mass evenly over the exit angles (in bins) between two rays of equal order; out (L, M, KEPT).

    Their incident angle stands for those from `before` below it to `after` above it; flat walls turn these round with
    every bounce, and curved ones not much otherwise from a given place.
    """
    size = out.shape[1]
    low, high = min(one[1], other[1]), max(one[1], other[1])
    if int(one[2]) % 2 == 1:
        before, after = after, before
    low -= before
    high += after
    order = min(int(one[2]), ORDERS)
    layer = 0
    if order > 1:
        least = 0.5 * (one[3] + other[3])
        layer = 1 + (order - 2) * CLASSES + (0 if least < SMALL else (1 if least < LARGE else 2))
    row = out[layer]
    squares = np.zeros(2)
    for ray in (one, other):
        rest = 0.0
        groups = min(order, GROUPS)
        for g in range(1, groups):
            rest += ray[3 + g] / (groups - 1)
        squares[0] += 0.5 * ray[3] * ray[3]
        squares[1] += 0.5 * ray[3] * rest
    # beyond the horizon by rounding or spreading
    a, b = min(max(low, 0.0), size - 1e-9), min(max(high, 0.0), size - 1e-9)
    first, last = int(a), int(b)
    for k in range(first, last + 1):
        share = mass
        if last > first:
            share *= (min(b, k + 1.0) - max(a, float(k))) / (b - a)
        row[k, 0] += share
        for m in range(1, 2 + GROUPS):
            row[k, m] += 0.5 * share * (one[m + 1] + other[m + 1])
        row[k, 2 + GROUPS] += share * squares[0]
        row[k, 3 + GROUPS] += share * squares[1]


@kernel
def _between(shape, tops, sine, cosine, before, after, begin, end, halvings, cosines, stack, out):
    """Deposit the rays between two of them; returns the mass cut off and 1 if their bounces differ.

    Intervals are halved where bounces differ or exit angles (ray[1], in bins) lie apart.
    """
    bins = out.shape[1]
    lost = 0.0
    depth = 0
    stack[0, 0, :], stack[0, 1, :] = begin, end
    stack[0, 2, 0] = 0.0
    while depth >= 0:
        one, other = stack[depth, 0], stack[depth, 1]
        level = stack[depth, 2, 0]
        same = one[2] == other[2]
        apart = abs(other[1] - one[1])
        if level < (SMOOTH if same else halvings) and (not same or apart > APART) and one[2] + other[2] > 0.0:
            # the upper half replaces the interval, the lower one goes on top
            above, middle = stack[depth + 1, 0], stack[depth + 1, 1]
            above[:] = one
            path(shape, tops, 0.5 * (one[0] + other[0]), sine, cosine, cosines, middle)
            middle[1] = (middle[1] / math.pi + 0.5) * bins
            one[:] = middle
            stack[depth, 2, 0] = stack[depth + 1, 2, 0] = level + 1.0
            depth += 1
            continue
        depth -= 1
        mass = 0.5 * (other[0] - one[0])
        if same and one[2] > 0.0 and apart <= 8.0 * APART:
            _spread(out, before, after, mass, one, other)
            continue
        for side in (one, other):
            if side[2] == 0.0:
                lost += 0.5 * mass
            else:
                _spread(out, before, after, 0.5 * mass, side, side)
    return lost, 0 if begin[2] == end[2] else 1


@parallel_kernel
def shoot(shape, tops, offsets, strata, cap, first, out, lost):
    """Fill out (M, LAYERS, M, KEPT) and lost (M,) for the columns of incident bins first .. M - 1.

    Parameters
    ----------
    shape, tops
        Pieces of the profile and the tops of their blocks.
    offsets : float64 (S,)
        Where in its stratum of the aperture the rays of each angle start, in (0, 1).
    strata : int
        Rays an angle.
    cap : int
        Largest number of bounces.
    first : int
        First column to fill.
    out : float64 (M, LAYERS, M, KEPT)
        (incident bin, layer, exit bin, kept).
    lost : float64 (M,)
        Share of a column that the cap cuts off.
    """
    bins = lost.size
    for column_number in numba.prange(bins - first):
        # steep and grazing columns take turns
        j = first + column_number // 2 if column_number % 2 == 0 else bins - 1 - column_number // 2
        low, high = math.sin(math.pi * (j / bins - 0.5)), math.sin(math.pi * ((j + 1.0) / bins - 0.5))
        # grazing light changes within its bin
        angles = offsets.size * (GRAZING if j == 0 or j == bins - 1 else 1)
        begin, end, cosines = np.empty(3 + GROUPS), np.empty(3 + GROUPS), np.empty(cap)
        stack = np.empty((HALVINGS + 3, 3, 3 + GROUPS))
        column = np.zeros((LAYERS, bins, KEPT))
        missed = 0.0
        for a in range(angles):
            sine = low + (high - low) * (a + 0.5) / angles
            cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
            # an angle stands for an equal share of the bin's flux
            middle = math.asin(sine)
            before = (middle - math.asin(low + (high - low) * a / angles)) * bins / math.pi
            after = (math.asin(min(low + (high - low) * (a + 1.0) / angles, 1.0)) - middle) * bins / math.pi
            edges = 0
            for n in range(strata + 2):
                x = -1.0 + 2.0 * (n - 1.0 + offsets[a % offsets.size]) / strata
                x = -1.0 + END if n == 0 else (1.0 - END if n == strata + 1 else x)
                path(shape, tops, x, sine, cosine, cosines, end)
                end[1] = (end[1] / math.pi + 0.5) * bins
                if n > 0:
                    halvings = HALVINGS if edges < EDGES else FEW
                    cut, met = _between(
                        shape, tops, sine, cosine, before, after, begin, end, halvings, cosines, stack, column
                    )
                    missed += cut / angles
                    edges += met
                begin[:] = end
        out[j] = column / angles
        lost[j] = missed
