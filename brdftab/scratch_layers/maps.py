"""Maps of the share of each texel that each layer covers, with their mip chains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdftab.errors import BrdftabError, ParameterError
from brdftab.scratch_layers import lattice
from brdftab.scratch_layers.combine import culled
from brdftab.scratch_layers.indicator import sampled
from brdftab.scratch_layers.layers import Layer, Layered
from brdftab.scratch_layers.splat import PARTS, splatted
from brdftab.system import offered
from brdftab.tables.content import SeveralArrays, told
from brdftab.timing import Clock
from brdftab.typing import Array

Map = NDArray[np.float32]
LARGEST = 4096
CULL = 1e-6
METHODS = ("auto", "sample", "splat")
# half widths in texels from which scratches are sampled
WIDE = 1.0


@dataclass(frozen=True, eq=False, repr=False)
class AlphaMaps(SeveralArrays):
    """Shares of area by level, layer and texel; the tile repeats.

    Attributes
    ----------
    levels : list of float32 (K, S, S)
        From the finest, each half the size of the one before, down to one texel. Rows run along v, columns along u.
    facts : dict
        What made them: layers with method, threshold and covered area, culling by level, run time.
    """

    levels: list[Map]
    facts: dict[str, Any]

    _arrays = "levels[0], levels[1] and so on"

    def __repr__(self) -> str:
        return told(self, f"{len(self.levels)} levels from {self.size}^2", f"{len(self.levels[0])} layers")

    @property
    def size(self) -> int:
        """Texels along a side of the finest level."""
        return self.levels[0].shape[1]

    def at(self, u: ArrayLike, v: ArrayLike, level: ArrayLike = 0.0) -> Array:
        """Return shares (..., K) at places of the tile, linear between texels' centres and between levels.

        Parameters
        ----------
        u, v : array_like (...)
            Places, in tiles; whole numbers apart they repeat.
        level : array_like (...)
            0 is the finest; a footprint of 2^level texels. Beyond the last level stands the mean.

        Raises
        ------
        ParameterError
            If a place is not finite or a level is negative.
        """
        given = {"u": u, "v": v, "level": level}
        x, y, z = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in given.values()))
        last = len(self.levels) - 1
        for name, places in (("u", x), ("v", y)):
            if not np.isfinite(places).all():
                raise ParameterError.out_of_range(name, "NaN or infinite", "the finite numbers", "it is a place")
        if not (z >= 0.0).all():
            wrong = z[~(z >= 0.0)].flat[0]
            raise ParameterError.out_of_range("level", f"{wrong:g}", f"[0, {last}]", "0 is the finest")
        z = np.minimum(z, last)
        found: Array = np.zeros((*x.shape, self.levels[0].shape[0]))
        for n in range(last + 1):
            # each level's weight is a tent around its number
            weight = np.maximum(1.0 - np.abs(z - n), 0.0)
            here = weight > 0.0
            if here.any():
                found[here] += weight[here][:, None] * self._bilinear(n, x[here], y[here])
        return found

    def _bilinear(self, level: int, u: Array, v: Array) -> Array:
        """Return shares (..., K) of one level, linear between the four nearest centres."""
        pixels = self.levels[level]
        size = pixels.shape[1]
        x, y = u * size - 0.5, v * size - 0.5
        i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        fx, fy = x - i, y - j
        total: Array = np.zeros((*x.shape, pixels.shape[0]))
        for dj, wy in ((0, 1.0 - fy), (1, fy)):
            for di, wx in ((0, 1.0 - fx), (1, fx)):
                texel = pixels[:, (j + dj) % size, (i + di) % size]
                total += np.moveaxis(texel, 0, -1) * np.asarray(wx * wy)[..., None]
        return total


def check_size(size: int) -> int:
    """Return the size of a map, or raise `ParameterError`: a power of two from 1 to 4096."""
    if isinstance(size, bool) or int(size) != size or size < 1 or size > LARGEST or int(size) & (int(size) - 1):
        raise ParameterError.out_of_range("size", size, f"the powers of two in [1, {LARGEST}]", "mip levels halve it")
    return int(size)


def method_of(layer: Layer, size: int) -> str:
    """Return how a layer is drawn: ``sample`` where half a scratch is at least a texel wide, else ``splat``.

    Half a scratch is density x width; a sparse layer's scratches are narrower than a dense one's of equal width.
    """
    return "sample" if layer.density * layer.width * size >= WIDE else "splat"


def layer_map(
    layer: Layer, size: int, *, method: str = "auto", samples: int | None = None
) -> tuple[Map, dict[str, Any]]:
    """Draw one layer.

    Parameters
    ----------
    layer : Layer
    size : int
        Texels along a side, a power of two.
    method : {"auto", "sample", "splat"}
        As `method_of` says, points, or ellipses laid down.
    samples : int, optional
        Points along a side of a texel, [1, 64]; by default 4, more on maps below 256 texels.

    Returns
    -------
    tuple
        Shares (size, size) and what was done: method, threshold, scratches, mean area.

    Raises
    ------
    ParameterError
        If an argument is out of range or the layer has too many scratches.
    """
    size = check_size(size)
    if method not in METHODS:
        raise ParameterError.not_known("method", method, METHODS)
    if samples is not None and not 1 <= samples <= 64:
        raise ParameterError.out_of_range("samples", samples, "[1, 64]", "points along a side of a texel")
    if layer.area <= 0.0 or layer.area >= 1.0:
        # nothing to draw
        full = layer.area >= 1.0
        facts = {"method": "full" if full else "empty", "threshold": layer.density, "scratches": 0, "mean": float(full)}
        return np.full((size, size), float(full), dtype=np.float32), facts
    chosen = method_of(layer, size) if method == "auto" else method
    rng = np.random.Generator(np.random.PCG64(list(layer.seed)))
    try:
        features = lattice.build(layer.length, layer.width, layer.angle, rng)
    except BrdftabError as error:
        raise ParameterError(f"layer {layer.name}: {error}") from None
    threshold = lattice.threshold(features, layer.density, layer.area)
    if chosen == "sample":
        count = samples or min(max(4, 1024 // size), 64)
        drawn = sampled(features, threshold, size, count)
    else:
        drawn = splatted(features, threshold, size, layer.length, layer.width, layer.angle)
    mean = float(drawn.mean(dtype=np.float64))
    return drawn, {"method": chosen, "threshold": threshold, "scratches": features.count, "mean": mean}


def halved(level: Map) -> Map:
    """Return the means of 2 x 2 texels of (K, S, S)."""
    half = level[:, 0::2, :] + level[:, 1::2, :]
    return (half[:, :, 0::2] + half[:, :, 1::2]) * np.float32(0.25)


def chain(finest: Map) -> list[Map]:
    """Return the mip chain of (K, S, S), down to one texel."""
    levels = [finest]
    while levels[-1].shape[1] > 1:
        levels.append(halved(levels[-1]))
    return levels


def alpha_maps(
    layered: Layered,
    size: int = 1024,
    *,
    method: str = "auto",
    samples: int | None = None,
    cull: float = CULL,
    progress: Callable[[float], None] | None = None,
) -> AlphaMaps:
    """Draw all layers and their mip chains.

    Parameters
    ----------
    layered : Layered
        Read from a file by `brdftab.scratch_layers.layers.read`.
    size : int
        Texels along a side, a power of two up to 4096.
    method, samples
        As in `layer_map`.
    cull : float
        Shares below it become 0 at every level, [0, 1]; see `brdftab.scratch_layers.combine.culled` for what it costs.
    progress : callable, optional
        Called with the share done.

    Raises
    ------
    ParameterError
        If an argument is out of range or the maps do not fit into memory.
    """
    size = check_size(size)
    if not 0.0 <= cull <= 1.0:
        raise ParameterError.out_of_range("cull", cull, "[0, 1]", "it is a share of area")
    count = len(layered.layers)
    # maps, chain, and culling's copy; parts of one layer
    needed = 4.0 * size * size * (count * 3.0 + 2 * PARTS)
    if needed > offered():
        raise ParameterError(
            f"size = {size} with {count} layers needs {needed / 2**30:.1f} GiB, more than this machine offers "
            f"({offered() / 2**30:.1f}); ask for a smaller size"
        )
    clock = Clock()
    finest = np.empty((count, size, size), dtype=np.float32)
    told = []
    for n, layer in enumerate(layered.layers):
        finest[n], facts = layer_map(layer, size, method=method, samples=samples)
        told.append(layer.to_json() | facts)
        if progress is not None:
            progress((n + 1) / count)
    levels, culls = [], []
    for level in chain(finest):
        kept, cost = culled(level, cull)
        levels.append(kept)
        culls.append(cost)
    return AlphaMaps(
        levels,
        {
            **layered.to_json(),
            "layers": told,
            "size": size,
            "cull": cull,
            "culling": culls,
            "run_time_s": clock.seconds,
        },
    )
