"""Which roughnesses count as flat."""

from __future__ import annotations

from brdftab.models._shared.facets.flat import resolvable
from brdftab.models.resolve import Setup


def validate_setup(setup: Setup) -> Setup:
    """Return the setup with roughnesses that float64 resolves; what is narrower is flat."""
    return resolvable(setup)
