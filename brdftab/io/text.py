"""The JSON that a table's file carries, as text and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from brdftab.errors import FileFormatError
from brdftab.tables.table import Header

# a million positions on each of two axes with their edges stay below this
MAX_TEXT = 2**27


def dump(metadata: Mapping[str, Any]) -> str:
    """Return the metadata as one line of ASCII JSON; Python's float repr keeps every bit."""
    return json.dumps(metadata, allow_nan=False)


def load(text: str) -> tuple[Header, dict[str, Any]]:
    """Parse and check the metadata.

    Parameters
    ----------
    text : str
        What `dump` returned.

    Returns
    -------
    header : Header
        The checked content.
    metadata : dict
        The JSON itself.

    Raises
    ------
    FileFormatError
        Where the text is no JSON, or not that of a brdftab table.
    """
    try:
        metadata = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise FileFormatError("the metadata is not valid JSON") from error
    return Header.parse(metadata), metadata


def _refuse(word: str) -> None:
    """Refuse NaN and infinities, which JSON does not have."""
    raise ValueError(f"{word} is not JSON")
