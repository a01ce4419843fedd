"""The traced surface of a setup, traced once."""

from __future__ import annotations

from brdftab.models.resolve import Setup
from brdftab.models.scratch.trace import CAP, Traced, rays_for, traced


def surface(setup: Setup, tolerance: float) -> Traced:
    """Return the traced scratch of a setup; it is kept for the next call."""
    rays = setup.values["rays"] or rays_for(tolerance)
    return traced(setup.values["profile"], int(setup.values["bins"]), int(rays), setup.max_bounces or CAP)
