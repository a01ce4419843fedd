"""How many orders of the symmetric groove are summed one by one, and the nodes that stand for the others."""

from __future__ import annotations

import math

# tolerance from which on: orders summed one by one, nodes of the tail
RULES = (
    (5e-4, (24, 4)),
    (5e-5, (96, 6)),
    (2e-5, (96, 12)),
    (2e-6, (256, 24)),
    (2e-7, (512, 48)),
    (0.0, (512, 96)),
)
# far orders weigh more on rough facets: powers of alpha by which both grow
MORE, CLOSER = 0.8, 0.5


def rule(tolerance: float, rough: float = 1.0) -> tuple[int, int]:
    """Return how many orders are summed one by one and the nodes of the tail, for a tolerance and a class of roughness.

    Beside the mirror direction these leave, at alpha = 1: 1e-4, 3e-5, 1.1e-5, 8e-7, 1.1e-7 and 1e-8.
    """
    orders, nodes = next(found for least, found in RULES if tolerance >= least)
    return math.ceil(orders * rough**MORE), math.ceil(nodes * rough**CLOSER)
