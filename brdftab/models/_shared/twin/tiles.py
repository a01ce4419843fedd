"""Work on few points at a time, points of like length of the bounce sum together.

A vectorised loop over orders runs as long as its longest point needs. Points sorted by where their sum ends and cut
into tiles make that waste small: next to the mirror direction a sum has hundreds of terms, elsewhere a handful.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax

TILE = 256


def ranking(key: Array) -> Array:
    """Return the indices (N,) that sort points by descending key, as floats so that they may pass a derivative."""
    return lax.stop_gradient(jnp.argsort(-key)).astype(jnp.float64)


def by_tiles(body: Callable[[Any], Array], ranks: Array, points: Any, tile: int = TILE) -> Array:
    """Apply `body` to tiles of the points in the order of `ranks` and return its values (N,) in the points' order.

    Parameters
    ----------
    body : callable
        Maps a pytree of arrays (T,) to one array (T,).
    ranks : Array (N,)
        From `ranking`.
    points : pytree of arrays (N,)
        The last tile is filled up with its last point.
    """
    size = ranks.shape[0]
    if size <= tile:
        return body(points)
    order = ranks.astype(jnp.int32)
    count = -(-size // tile)
    padded = jnp.concatenate([order, jnp.full(count * tile - size, order[-1])])
    cut = jax.tree.map(lambda x: x[padded].reshape(count, tile), points)
    values = lax.map(body, cut).reshape(-1)[:size]
    return jnp.zeros(size, values.dtype).at[order].set(values, unique_indices=True)
