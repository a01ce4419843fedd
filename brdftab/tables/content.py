"""What objects that hold arrays have in common: equality by content, and a few words in place of all their numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from brdftab.errors import ParameterError

# columns of a line, and names that are listed one by one
WIDTH, MOST = 100, 6


def same(a: Any, b: Any) -> bool:
    """Tell whether two values are the same: arrays number by number, NaN like NaN, and types aside."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        a, b = np.asarray(a), np.asarray(b)
        # only numbers that may be NaN can be asked for it
        return np.array_equal(a, b, equal_nan=all(x.dtype.kind in "fc" for x in (a, b)))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b) or bool(a != a and b != b)


def same_fields(a: Any, b: object, names: Iterable[str]) -> bool:
    """Tell whether two objects of one class have the same content in some attributes; `NotImplemented` for others."""
    if type(a) is not type(b):
        return NotImplemented
    return all(same(getattr(a, name), getattr(b, name)) for name in names)


def listed(names: Iterable[Any], most: int = MOST) -> str:
    """Return names in a row, the middle of many left out."""
    words = [str(name) for name in names]
    if len(words) <= most:
        return " ".join(words)
    return f"{' '.join(words[: most - 2])} ... {words[-1]} ({len(words):,})"


def told(owner: object, *parts: str) -> str:
    """Return what a class's `repr` says: its name and some facts, wrapped to the width of a terminal."""
    text = f"{type(owner).__name__}({', '.join(part for part in parts if part)})"
    return "\n".join(textwrap.wrap(text, WIDTH, subsequent_indent="    ", break_on_hyphens=False))


class SeveralArrays:
    """Base of what is no single array: NumPy is told so, instead of wrapping the object in an array of objects."""

    # what to take instead, for the message
    _arrays: ClassVar[str] = ""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        """Refuse with a line that names the arrays."""
        raise ParameterError(f"{type(self).__name__} holds several arrays; take one of {self._arrays}")
