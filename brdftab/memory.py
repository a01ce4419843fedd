"""How much memory a computation may take."""

from __future__ import annotations

import math
import os

# what is left to the system and to other programs
SHARE = 0.8


def offered() -> float:
    """Return the bytes that this machine offers to one computation; inf where the system does not tell."""
    try:
        return SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return math.inf
