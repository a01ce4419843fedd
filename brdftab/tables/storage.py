"""What of a table its file holds: one half where light and view may be exchanged, one of several equal channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import FileFormatError
from brdftab.tables.grid import Grid

# keys of the metadata; files that hold everything have neither
STORED, SAME = "stored", "same_channels"
HALF = "theta_o <= theta_i"


@dataclass(frozen=True)
class Layout:
    """What is stored.

    Attributes
    ----------
    half : bool
        Only pairs with theta_o <= theta_i; they are one dimension.
    same : dict of str to str
        Channels that are not stored, and the earlier ones that they are equal to.
    """

    half: bool = False
    same: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return what the metadata say of it."""
        return ({STORED: HALF} if self.half else {}) | ({SAME: self.same} if self.same else {})

    @classmethod
    def parse(cls, metadata: Mapping[str, Any], grid: Grid, channels: Sequence[str]) -> Layout:
        """Check what the metadata of a file say.

        Raises
        ------
        FileFormatError
            Where it goes with no such table.
        """
        half, same = STORED in metadata, metadata.get(SAME, {})
        if half and (metadata[STORED] != HALF or not (grid.isotropic and grid.square)):
            raise FileFormatError(f"the metadata's {STORED} is not {HALF!r} of a grid with equal polar angles")
        place = {name: n for n, name in enumerate(channels)}
        if not isinstance(same, dict) or not all(
            name in place and other in place and place[other] < place[name] and other not in same
            for name, other in same.items()
        ):
            raise FileFormatError(f"the metadata's {SAME} does not name stored channels before those left out")
        return cls(half, dict(same))

    def kept(self, channels: Sequence[str]) -> tuple[str, ...]:
        """Return the channels that are stored."""
        return tuple(name for name in channels if name not in self.same)

    def shape(self, shape: Sequence[int], channels: Sequence[str]) -> tuple[int, ...]:
        """Return the shape of a stored array of a table of some shape."""
        first = (shape[0] * (shape[0] + 1) // 2, *shape[2:-1]) if self.half else tuple(shape[:-1])
        return (*first, len(self.kept(channels)))

    def packed(self, array: NDArray[Any], channels: Sequence[str]) -> NDArray[Any]:
        """Return an array as it is stored."""
        if self.same:
            array = array[..., [list(channels).index(name) for name in self.kept(channels)]]
        return array[np.tril_indices(array.shape[0])] if self.half else array

    def unpacked(self, array: NDArray[Any], shape: Sequence[int], channels: Sequence[str]) -> NDArray[Any]:
        """Return the whole of a stored array."""
        if self.same:
            kept = self.kept(channels)
            array = array[..., [kept.index(self.same.get(name, name)) for name in channels]]
        if not self.half:
            return array
        whole = np.empty(shape, array.dtype)
        i, o = np.tril_indices(shape[0])
        whole[i, o] = array
        whole[o, i] = array
        return whole


def is_square(grid: Grid, arrays: Sequence[NDArray[Any]]) -> bool:
    """Tell whether light and view may be exchanged in every bit."""
    return grid.isotropic and grid.square and all(np.array_equal(a, a.swapaxes(0, 1)) for a in arrays)


def equal_channels(arrays: Sequence[NDArray[Any]], channels: Sequence[str]) -> dict[str, str]:
    """Return the channels that are equal to an earlier one in every bit, and which."""
    same: dict[str, str] = {}
    for n, name in enumerate(channels):
        for m, other in enumerate(channels[:n]):
            if other not in same and all(np.array_equal(a[..., n], a[..., m]) for a in arrays):
                same[name] = other
                break
    return same
