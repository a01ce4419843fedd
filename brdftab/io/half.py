"""One half of a table in a file: where light and view may be exchanged, pairs with theta_o <= theta_i tell the rest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab.table import HALF, STORED, Header, Table


def is_half(table: Table) -> bool:
    """Tell whether a file holds one half: the table's plan says so, and both halves are the same in every bit."""
    items = table.provenance.get("plan", {}).get("items", [])
    if not any(item.get("name") == "reciprocity" for item in items) or not (table.grid.isotropic and table.grid.square):
        return False
    arrays = [table.values, *table.components.values(), *([] if table.mask is None else [table.mask])]
    return all(np.array_equal(a, a.swapaxes(0, 1)) for a in arrays)


def metadata(table: Table, half: bool) -> dict[str, Any]:
    """Return the metadata of a file that holds all or one half."""
    return table.metadata() | ({STORED: HALF} if half else {})


def packed(array: NDArray[Any], half: bool) -> NDArray[Any]:
    """Return an array as it is stored: (I, O, P, C), or (I (I + 1)/2, P, C) of one half."""
    return array[np.tril_indices(array.shape[0])] if half else array


def unpacked(array: NDArray[Any], head: Header) -> NDArray[Any]:
    """Return the whole of a stored array."""
    if not head.half:
        return array
    whole = np.empty(head.shape, array.dtype)
    i, o = np.tril_indices(head.shape[0])
    whole[i, o] = array
    whole[o, i] = array
    return whole
