"""Nodes for the far tail of the bounce sum, an integral over x = 1/k that Phong's broad lobes make singular at 0."""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.codes import PHONG

# widest panel in log x where the exponent is negative: a factor of 5 in the order
SPAN = 1.6


@kernel
def tail_power(ndf, shape):
    """Return q of x = low + (high - low) s^q, or 0 for a logarithmic scale.

    Terms fall like k^-2 (Beckmann faster, GGX exactly), which is smooth in x; Phong's go like x^n or x^(2 n + 1), and
    q (n + 1) is made a whole number. For n < 0 every decade of orders counts.
    """
    if ndf != PHONG or shape >= 1.0:
        return 1.0
    if shape < 0.0:
        return 0.0
    return math.ceil(shape + 1.0) / (shape + 1.0)


@kernel
def tail_panels(power, low, high):
    """Return how many panels the tail over x in (low, high) takes: one, or of a logarithmic scale equal ones."""
    if power > 0.0:
        return 1
    return max(math.ceil(math.log(high / low) / SPAN), 1)


@kernel
def tail_panel(number, panels, low, high):
    """Return the ends in x of one of the panels."""
    if panels == 1:
        return low, high
    step = math.log(high / low) / panels
    return low * math.exp(number * step), low * math.exp((number + 1.0) * step)


@kernel
def tail_node(power, low, high, s):
    """Return x and dx/ds at s in (0, 1)."""
    if power == 0.0:
        span = math.log(high / low)
        x = low * math.exp(span * s)
        return x, x * span
    if power == 1.0 or low > 0.5 * high:
        return low + (high - low) * s, high - low
    part = s**power
    return low + (high - low) * part, (high - low) * power * part / s
