"""Nodes for the far tail of the bounce sum, an integral over x = 1/k that Phong's broad lobes make singular at 0."""

from __future__ import annotations

import math

from brdftab.jit import kernel


@kernel
def tail_power(ndf, shape):
    """Return q of x = low + (high - low) s^q, or 0 for a logarithmic scale.

    Terms fall like k^-2 (Beckmann faster, GGX exactly), which is smooth in x; Phong's go like x^n, and q (n + 1) is
    made a whole number. For n <= -1 the integral lives at its lower end, and equal steps of log x serve.
    """
    if ndf != 2 or shape >= 1.0:
        return 1.0
    if shape <= -0.9:
        return 0.0
    return math.ceil(shape + 1.0) / (shape + 1.0)


@kernel
def tail_node(power, low, high, s):
    """Return x and dx/ds at s in (0, 1)."""
    if power == 1.0 or low > 0.5 * high:
        return low + (high - low) * s, high - low
    if power == 0.0:
        span = math.log(high / low)
        x = low * math.exp(span * s)
        return x, x * span
    part = s**power
    return low + (high - low) * part, (high - low) * power * part / s
