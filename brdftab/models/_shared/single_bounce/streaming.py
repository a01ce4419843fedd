"""Stores that bypass the cache, for tables far larger than it: without them every line is read before it is written.

On one core they write a square table row by row, each row twice, 2.5 times as fast as plain stores. A locked
instruction waits until they are all through, and Numba counts the references of a slice with one: no slices between
calls of `put`.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]  # ships no annotations
from numba import types
from numba.extending import intrinsic

from brdftab.jit import kernel

# numbers in the widest store
LANES = 4
# below this size a table stays in the cache, where plain stores are as fast and the reader finds them
WORTHWHILE = 1 << 20


def _copy(context: Any, builder: Any, signature: Any, args: Any, lanes: int) -> Any:
    """Emit out[at : at + lanes] = source[start : start + lanes] as one non-temporal store."""
    size = signature.args[0].dtype.bitwidth // 8
    # integers: only these have a scalar store of this kind on x86
    element = ir.IntType(8 * size)
    kind = (element if lanes == 1 else ir.VectorType(element, lanes)).as_pointer()
    out = context.make_array(signature.args[0])(context, builder, args[0]).data
    source = context.make_array(signature.args[2])(context, builder, args[2]).data
    value = builder.load(builder.bitcast(builder.gep(source, [args[3]]), kind), align=size)
    store = builder.store(value, builder.bitcast(builder.gep(out, [args[1]]), kind), align=size * lanes)
    store.set_metadata("nontemporal", builder.module.add_metadata([ir.IntType(32)(1)]))
    return context.get_dummy_value()


def _declare_one(typing_context: Any, out: Any, at: Any, source: Any, start: Any) -> Any:
    """Copy a number past the cache."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _copy(context, builder, signature, args, 1)

    return types.void(out, types.int64, source, types.int64), generate


def _declare_four(typing_context: Any, out: Any, at: Any, source: Any, start: Any) -> Any:
    """Copy four numbers past the cache, to a place that is aligned to their size."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _copy(context, builder, signature, args, LANES)

    return types.void(out, types.int64, source, types.int64), generate


def _declare_fence(typing_context: Any) -> Any:
    """Order the stores above before anything that follows: they are weakly ordered on x86."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate


_store_one: Any = intrinsic(_declare_one)
_store_four: Any = intrinsic(_declare_four)
_fence: Any = intrinsic(_declare_fence)
_config: Any = numba.config


@kernel
def finish(phase):
    """Make streamed stores of this thread visible to the others."""
    if phase >= 0:
        _fence()


@kernel
def put(phase, source, count, out, at):
    """Copy count numbers to out[at:], past the cache if `phase` (of `stream_phase`) is not negative.

    The ends, too: a plain store would wait for its line, and all later stores with it.
    """
    if phase < 0:
        for p in range(count):
            out[at + p] = source[p]
    else:
        head = min(count, 3 & -(at + phase))
        stop = head + ((count - head) & -4)
        for p in range(head):
            _store_one(out, at + p, source, p)
        for p in range(head, stop, 4):
            _store_four(out, at + p, source, p)
        for p in range(stop, count):
            _store_one(out, at + p, source, p)


def stream_phase(out: np.ndarray) -> int:
    """Return how many numbers before its start a C-ordered array is aligned for `put`; -1 where that does not pay."""
    if out.nbytes < WORTHWHILE or out.ctypes.data % out.itemsize or _config.DISABLE_JIT:
        return -1
    return int(out.ctypes.data // out.itemsize % LANES)
