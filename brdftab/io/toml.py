"""TOML files of the user's: what is unknown, missing or out of range is told in one line with file, table and key.

By hand, for libraries of validation tell neither the remedy nor the nearest key, and models have keys of their own.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from brdftab.errors import BrdftabError, FileFormatError, ParameterError, proposal
from brdftab.io.atomic import show
from brdftab.io.own import own_kind


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises
    ------
    FileFormatError
        If it is no TOML.
    ParameterError
        If it cannot be opened.
    """
    try:
        with open(path, "rb") as file:
            return tomllib.load(file)
    except (OSError, ValueError) as error:
        held = own_kind(path)
        if held or isinstance(error, UnicodeDecodeError):
            raise FileFormatError(f"{show(path)}: holds {held or 'no text'}; give a TOML file") from error
        if isinstance(error, tomllib.TOMLDecodeError):
            raise FileFormatError(f"{show(path)}: is not valid TOML ({error}); mend it") from error
        reason = getattr(error, "strerror", None) or str(error)
        raise ParameterError(f"{show(path)}: cannot be opened ({reason}); check the path") from error


class Entry:
    """One table of the file: takes keys out of it and tells what is wrong with them in one line."""

    def __init__(self, source: str, where: str, table: Any, known: tuple[str, ...] | None) -> None:
        self.head = f"{show(source)}: {where}" if where else show(source)
        if not isinstance(table, dict):
            raise FileFormatError(
                f"{self.head} is not a table of keys; write it as [{where.split()[0]}] and keys below"
            )
        self.table = dict(table)
        for key in self.table:
            if known is not None and key not in known:
                near = proposal(key, known)
                raise ParameterError(
                    f"{self.head}: {key} = {self.table[key]!r} is no key; {near}{'K' if near else 'k'}nown are "
                    f"{', '.join(known)}"
                )

    def number(
        self, key: str, default: float | None, low: float, high: float, remedy: str, *, open_low: bool = False
    ) -> float:
        """Return a number in [low, high], or (low, high]."""
        value = self.table.get(key, default)
        valid = f"{'(' if open_low else '['}{low:g}, {high:g}]"
        if value is None:
            raise ParameterError(f"{self.head}: {key} is missing; give a number in {valid}: {remedy}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError(f"{self.head}: {key} = {value!r} is not a number in {valid}; {remedy}")
        if not (low < value if open_low else low <= value) or not value <= high:
            raise ParameterError.out_of_range(f"{self.head}: {key}", f"{value:g}", valid, remedy)
        return float(value)

    def whole(self, key: str, default: int, low: int, high: int, remedy: str) -> int:
        """Return a whole number in [low, high]."""
        value = self.table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            shown = value if isinstance(value, int | float) else repr(value)
            raise ParameterError.out_of_range(
                f"{self.head}: {key}", shown, f"the whole numbers in [{low}, {high}]", remedy
            )
        return value

    @contextmanager
    def named(self) -> Iterator[None]:
        """Put this entry's name in front of errors raised inside."""
        try:
            yield
        except BrdftabError as error:
            raise type(error)(f"{self.head}: {error}") from None
