"""Numba decorators of the project, and a disk cache that cannot serve stale kernels."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

# Contraction and reciprocals only: reassociation would undo the cancellation-free sums near the mirror direction.
_FAST = {"contract", "arcp", "nsz"}
# all kernels let go of the interpreter while they run (nogil), so that another thread can answer Ctrl-C meanwhile


# modules and folders that kernels are made from: those that hold a kernel, and all that these import from
KERNEL_SOURCES = frozenset({"bench", "errors", "jit", "materials", "memory", "models", "scratches"})


def source_hash(only: frozenset[str] | None = KERNEL_SOURCES) -> str:
    """Return a hash of this package's Python sources, of some modules and folders alone, and of the Numba version.

    Numba looks at the time stamp of the file that holds the cached function only, so an edit of a helper in another
    file would leave a stale caller behind; keying the folder on all sources of kernels closes that hole.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    root = Path(__file__).parent
    for path in sorted(root.rglob("*.py")):
        relative = path.relative_to(root)
        if only is not None and relative.with_suffix("").parts[0] not in only:
            continue
        digest.update(str(relative).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """Return the folder of this version's compiled kernels, below NUMBA_CACHE_DIR or the user's cache."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache"), "brdftab"
    )
    return Path(base) / f"kernels-{source_hash()}"


CACHE_FOLDER = _cache_folder()
numba.config.CACHE_DIR = str(CACHE_FOLDER)  # type: ignore[attr-defined]  # set at run time


def has_compiled(part: str) -> bool:
    """Tell whether the disk cache already holds a kernel of a module or folder whose dotted name ends with `part`."""
    stem = part.rsplit(".", 1)[-1]
    return any(CACHE_FOLDER.glob(f"*/{stem}.*.nbi")) or any(CACHE_FOLDER.glob(f"{stem}_*/*.nbi"))


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a scalar kernel: bare floats in, bare floats out."""
    return numba.njit(cache=True, error_model="numpy", fastmath=_FAST, nogil=True)(function)


def parallel_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that loops over cells on all threads."""
    return numba.njit(cache=True, error_model="numpy", fastmath=_FAST, parallel=True, nogil=True)(function)
