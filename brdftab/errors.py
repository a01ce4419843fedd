"""The few kinds of error that brdftab raises; every message is one line that names the remedy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Self

# how alike two words must be for one to be proposed in place of the other (difflib's ratio)
ALIKE = 0.6


def nearest(word: object, known: Iterable[str], called: Mapping[str, str] | None = None) -> str | None:
    """Return the known name that a mistyped one most likely means, or None.

    Case, dashes and underscores do not count; `called` maps what else people call things to their names.
    """
    from difflib import get_close_matches

    names = {_plain(other): name for other, name in (called or {}).items()} | {_plain(name): name for name in known}
    found = get_close_matches(_plain(str(word)), names, n=1, cutoff=ALIKE)
    return names[found[0]] if found else None


def _plain(word: str) -> str:
    return word.strip(" '\"").lower().replace("_", "-")


def proposal(word: object, known: Iterable[str], called: Mapping[str, str] | None = None) -> str:
    """Return ``did you mean NAME? `` for a word that is close to a known one, else nothing."""
    near = nearest(word, known, called)
    return f"did you mean {near}? " if near else ""


class BrdftabError(Exception):
    """Base of all errors that a user's input can cause; the command line turns it into one line and exit status 2."""


class ParameterError(BrdftabError, ValueError):
    """A parameter is unknown, malformed, out of range, or does not go with another one."""

    @classmethod
    def out_of_range(cls, name: str, value: object, valid: str, remedy: str = "") -> ParameterError:
        """Build the standard line: name, value, valid range, remedy."""
        return cls(f"{name} = {value} is outside {valid}" + (f"; {remedy}" if remedy else ""))

    @classmethod
    def not_known(
        cls, name: str, value: object, known: Iterable[str], more: str = "", called: Mapping[str, str] | None = None
    ) -> Self:
        """Build the standard line of a word that is none of the known ones: the nearest is proposed, all are listed.

        `more` is put after the list; `called` maps what else people call things to their names.
        """
        known = list(known)
        near = proposal(value, known, called)
        return cls(f"{name} = {value} is not known; {near}{'C' if near else 'c'}hoose one of {', '.join(known)}{more}")


class GridError(ParameterError):
    """A grid or an axis is malformed."""


class SingularDirectionError(ParameterError):
    """A point value was asked for where the model's density is infinite."""


class FileFormatError(BrdftabError, ValueError):
    """A file is truncated, foreign, hostile or lacks what a brdftab table must state."""


class OutputExistsError(BrdftabError, FileExistsError):
    """An output file exists and overwriting was not asked for."""
