"""The machine: its kind, and how much memory a computation may take."""

from __future__ import annotations

import hashlib
import math
import os
import platform
from functools import cache
from pathlib import Path
from typing import Any

# what is left to the system and to other programs
SHARE = 0.8


def offered() -> float:
    """Return the bytes that this machine offers to one computation; inf where the system does not tell."""
    try:
        return SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return math.inf


def machine() -> dict[str, Any]:
    """Return versions and the kind of machine."""
    import numba
    import numpy as np

    return {
        "python": platform.python_version(),
        "numba": numba.__version__,
        "numpy": np.__version__,
        "cpus": os.cpu_count() or 1,
        "system": platform.system(),
        "architecture": platform.machine(),
    }


def cache_folder() -> Path:
    """Return the folder below which compiled programs are kept: NUMBA_CACHE_DIR, or the user's cache."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(given) if given else user_cache()


def user_cache() -> Path:
    """Return this program's folder below the user's cache."""
    import platformdirs

    return Path(platformdirs.user_cache_path("brdftab", appauthor=False))


@cache
def source_hash() -> str:
    """Return a hash of this package's Python sources and of the Numba version: what every number may depend on."""
    import numba

    digest = hashlib.sha256(numba.__version__.encode())
    root = Path(__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
