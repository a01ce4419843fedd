"""Classes of roughness: rules that grow with alpha do so in steps, so that a twin is compiled once for each."""

from __future__ import annotations

from brdftab.models.resolve import Setup

# upper ends; the last is the largest roughness of any model
CLASSES = (1.0, 2.0, 4.0, 10.0)


def rough_class(setup: Setup) -> float:
    """Return the upper end of the class of a setup's larger roughness."""
    alpha = max(setup.alpha_x, setup.alpha_y)
    return next((end for end in CLASSES if alpha <= end), CLASSES[-1])
