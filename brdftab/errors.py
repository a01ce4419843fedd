"""The few kinds of error that brdftab raises; every message is one line that names the remedy."""

from __future__ import annotations


class BrdftabError(Exception):
    """Base of all errors that a user's input can cause; the command line turns it into one line and exit status 2."""


class ParameterError(BrdftabError, ValueError):
    """A parameter is unknown, malformed, out of range, or does not go with another one."""

    @classmethod
    def out_of_range(cls, name: str, value: object, valid: str, remedy: str = "") -> ParameterError:
        """Build the standard line: name, value, valid range, remedy."""
        return cls(f"{name} = {value} is outside {valid}" + (f"; {remedy}" if remedy else ""))


class GridError(ParameterError):
    """A grid or an axis is malformed."""


class SingularDirectionError(ParameterError):
    """A point value was asked for where the model's density is infinite."""


class ToleranceError(BrdftabError):
    """The asked tolerance cannot be reached by any rule that the model has."""


class FileFormatError(BrdftabError, ValueError):
    """A file is truncated, foreign, hostile or lacks what a brdftab table must state."""


class OutputExistsError(BrdftabError, FileExistsError):
    """An output file exists and overwriting was not asked for."""
