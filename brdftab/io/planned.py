"""How the file of a planned table is laid out: what its plan leaves out, and only what the values bear out."""

from __future__ import annotations

from brdftab.tables.storage import Layout, equal_channels, is_square
from brdftab.tables.table import Table


def layout_of(table: Table) -> Layout:
    """Return what a file of a table holds: everything, unless a plan says that halves or channels are equal."""
    left_out = {item.get("name") for item in table.provenance.get("plan", {}).get("items", [])}
    arrays = [table.values, *table.components.values(), *([] if table.mask is None else [table.mask])]
    half = "reciprocity" in left_out and is_square(table.grid, arrays)
    return Layout(half, equal_channels(arrays, table.channels) if "channels" in left_out else {})
