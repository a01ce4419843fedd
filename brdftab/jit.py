"""Numba decorators of the project: kernels that let go of the interpreter and are kept on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

from brdftab.kernel_cache import KernelCache

# Contraction and reciprocals only: reassociation would undo the cancellation-free sums near the mirror direction.
_FAST = {"contract", "arcp", "nsz"}
# all kernels let go of the interpreter while they run (nogil), so that another thread can answer Ctrl-C meanwhile


def _kept(dispatcher: Any) -> Any:
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # then it is the Python function
        return dispatcher
    dispatcher._cache = KernelCache(dispatcher.py_func)
    return dispatcher


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a scalar kernel: bare floats in, bare floats out."""
    return _kept(numba.njit(error_model="numpy", fastmath=_FAST, nogil=True)(function))


def parallel_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that loops over cells on all threads."""
    return _kept(numba.njit(error_model="numpy", fastmath=_FAST, parallel=True, nogil=True)(function))


def exact_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that loops on all threads, without contraction, and divides as Python does."""
    return _kept(numba.njit(parallel=True, nogil=True)(function))
