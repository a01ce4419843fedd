"""How finely the further orders of the nonsymmetric groove are summed; kernel and twin follow the same rule."""

from __future__ import annotations

import math

# tolerance from which on: explicit orders, tail nodes, nodes a panel, fine cuts; dim facets take the nodes, mirrors the
# orders: (16, 3, 5) left 1e-3 of both; beside the mirror direction 32 orders leave 6e-6 of GGX facets at alpha = 1, 64
# 4e-7, 128 3e-8, 256 2e-9
RULES = (
    (5e-4, (16, 3, 6, False)),
    (1e-4, (32, 6, 7, False)),
    (1e-5, (32, 6, 8, True)),
    (1e-6, (64, 6, 10, True)),
    (1e-7, (128, 10, 12, True)),
    (0.0, (256, 12, 14, True)),
)
# opposite facets of Phong's distribution have no mean from this alpha on
MOST_PHONG = math.sqrt(2.0)
# far orders weigh more on rough facets: the power of alpha by which they grow, and the class from which on nodes are
# those of a tenth of the tolerance
MORE, ROUGH = 0.8, 2.0


# beside the mirror direction the sum differs from its integral by up to HARDEST k^-(2 n + 4) where Phong's n < 0; the
# most orders that are summed for it leave 1e-6 as n nears -1
HARDEST, MOST = 10.0, 3200


def steep_orders(exponent: float, tolerance: float) -> int:
    """Return how many orders a Phong lobe of negative exponent wants to be summed one by one."""
    return math.ceil(min((HARDEST / max(tolerance, 1e-12)) ** (1.0 / (2.0 * exponent + 4.0)), MOST))


def rule(tolerance: float, rough: float = 1.0) -> tuple[int, int, int, bool]:
    """Return explicit orders, tail nodes, nodes a panel, fine scale cuts, for a tolerance and a class of roughness."""
    orders, tail, *rest = next(found for least, found in RULES if tolerance >= least)
    if rough >= ROUGH:
        _, tail, *rest = next(found for least, found in RULES if 0.1 * tolerance >= least)
    return math.ceil(orders * rough**MORE), tail, *rest
