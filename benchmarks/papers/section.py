"""One paper's part of the page: tables of ours beside theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from brdftab.models import spec

Cell = str | int | float


@dataclass(frozen=True)
class Sheet:
    """A table of the page.

    Attributes
    ----------
    title : str
        What is compared.
    columns : tuple of str
        Heads.
    rows : list of tuple
        Numbers and words, one a column.
    notes : tuple of str
        What has to be known to read it.
    """

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Section:
    """What a paper states and what we measure.

    Attributes
    ----------
    title, paper : str
        Name and citation.
    sheets : list of Sheet
        Its tables.
    missing : list of str
        What could not be measured here, a line each.
    """

    title: str
    paper: str
    sheets: list[Sheet] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Scale:
    """How much of the suite is run.

    Attributes
    ----------
    quick : bool
        A hundredth of the samples, few cells: for tests.
    repeats : int
        Most timed calls.
    peer : bool
        Other programs too.
    """

    quick: bool = False
    repeats: int = 9
    peer: bool = True

    def of(self, full: int, small: int) -> int:
        """Return a count: the full one, or a small one in a quick run."""
        return small if self.quick else full


Writer = Callable[[Scale], Section]


def cite(model: str) -> str:
    """Return a model's paper with its DOI."""
    declared = spec(model)
    return f"{declared.citation}, doi {declared.doi}"
