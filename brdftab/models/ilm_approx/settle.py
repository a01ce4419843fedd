"""Which roughnesses count as flat."""

from __future__ import annotations

from brdftab.models.microfacet.flat import resolvable
from brdftab.models.setup import Setup


def settle(setup: Setup) -> Setup:
    """Return the setup with roughnesses that float64 resolves; what is narrower is flat."""
    return resolvable(setup)
