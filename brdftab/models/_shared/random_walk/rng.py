"""Counter-based random numbers: Philox4x32-10 (Salmon, Moraes, Dror, Shaw: Parallel Random Numbers, SC 2011).

What is drawn depends on the seed and on (cell, path, block) alone, not on who draws it when.
"""

from __future__ import annotations

import numpy as np

from brdftab.jit import kernel

_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_M0, _M1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_W0, _W1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
# centres of 2^32 equal intervals: never 0 or 1
_STEP = 2.0**-32


@kernel
def philox(c0, c1, c2, c3, k0, k1):
    """Return four words of 32 bits from a counter of four and a key of two, each in a uint64."""
    for _ in range(10):
        p, q = _M0 * c0, _M1 * c2
        c0, c1, c2, c3 = (q >> _HALF) ^ c1 ^ k0, q & _LOW, (p >> _HALF) ^ c3 ^ k1, p & _LOW
        k0, k1 = (k0 + _W0) & _LOW, (k1 + _W1) & _LOW
    return c0, c1, c2, c3


@kernel
def uniforms(seed, cell, path, block):
    """Return four uniforms in (0, 1).

    Parameters
    ----------
    seed, cell : int
        In [0, 2^63).
    path, block : int
        In [0, 2^32): which path of the cell, and which four of its numbers.
    """
    key, where = np.uint64(seed), np.uint64(cell)
    a, b, c, d = philox(np.uint64(block), np.uint64(path), where & _LOW, where >> _HALF, key & _LOW, key >> _HALF)
    return (a + 0.5) * _STEP, (b + 0.5) * _STEP, (c + 0.5) * _STEP, (d + 0.5) * _STEP
