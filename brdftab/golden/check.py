"""Golden tables held against what the library gives today."""

from __future__ import annotations

import itertools
import multiprocessing
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from brdftab.errors import BrdftabError, ParameterError
from brdftab.evaluation.engine import Progress
from brdftab.golden.differences import Differences, compare_points
from brdftab.golden.differences import compare_tables as worst_of_tables
from brdftab.golden.points import SUFFIX, Held, measure, read_points
from brdftab.golden.record import existing_folder, files_of
from brdftab.golden.settings import settings
from brdftab.io import read
from brdftab.io.atomic import check_target
from brdftab.models.resolve import resolve
from brdftab.tables.comparison import compare, tolerances
from brdftab.tables.content import told
from brdftab.tables.table import Table
from brdftab.timing import Clock
from brdftab.validate.reproduce import retabulate

# path, model or entry of tables.toml, figure, whether a figure may be replaced
_Task = tuple[Path, Any, Path | None, bool]
EQUAL, DIFFERS, MISSING, BROKEN = "equal", "differs", "missing", "error"


@dataclass(repr=False)
class Checked:
    """How one golden file compares.

    Attributes
    ----------
    file : str
    status : {"equal", "differs", "missing", "error"}
        `missing`: the file is not there, or lacks settings that the registry has by now.
    found : Differences
        Numbers compared and the worst ones.
    rtol : float
        Relative tolerance.
    message : str
        What is missing or wrong, in one line; "" otherwise.
    figure : str or None
        Where the differences were drawn.
    seconds : float
        Run time, kernels compiled on the way included.
    """

    file: str
    status: str = EQUAL
    found: Differences = field(default_factory=Differences)
    rtol: float = 0.0
    message: str = ""
    figure: str | None = None
    seconds: float = 0.0

    def __repr__(self) -> str:
        found = f"{self.found.differing:,} of {self.found.total:,} numbers differ"
        return told(self, self.file, self.status, self.message or found)

    def to_json(self) -> dict[str, Any]:
        """Return it as a JSON-able dict."""
        return {
            "file": self.file,
            "status": self.status,
            "numbers": self.found.total,
            "differing": self.found.differing,
            "largest_relative": self.found.largest if self.found.largest < float("inf") else "inf",
            "rtol": self.rtol,
            "worst": [cell.to_json() for cell in self.found.worst],
            "message": self.message,
            "figure": self.figure,
            "seconds": round(self.seconds, 3),
        }


def check_golden(
    folder: str | os.PathLike[str],
    *,
    only: Sequence[str] = (),
    figure_dir: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    stop: bool = False,
    jobs: int = 1,
    progress: Progress | None = None,
) -> list[Checked]:
    """Compute again what a folder's golden tables hold, and compare.

    Parameters
    ----------
    folder : str or path-like
        Written by `record_golden`.
    only : sequence of str, optional
        File names or patterns to confine it to.
    figure_dir : str or path-like, optional
        Existing folder for a figure of each file that differs.
    overwrite : bool, optional
        Whether figures may replace existing ones.
    stop : bool, optional
        End with the first file that is not equal.
    jobs : int, optional
        Processes, at least 1; the files of one model stay together, so that its kernels are compiled once.
    progress : callable, optional
        Called with the finished share of the files.

    Returns
    -------
    list of Checked
        One a file; the folder must hold a file for every model of the registry and all that tables.toml lists.

    Raises
    ------
    BrdftabError
        If there is no such folder, or a figure cannot be written.
    FileFormatError, ParameterError
        If tables.toml is malformed, or a pattern fits no file.
    """
    home = existing_folder(folder)
    drawings = None if figure_dir is None else existing_folder(figure_dir)
    if not (isinstance(jobs, int) and jobs >= 1):
        raise ParameterError.out_of_range("jobs", jobs, "the whole numbers >= 1", "processes that share the files")
    tasks: list[_Task] = []
    for name, what in files_of(home, only).items():
        picture = None if drawings is None else drawings / f"{name.removesuffix('.npz').removesuffix('.exr')}.png"
        if picture is not None and picture.exists():
            check_target(picture, overwrite=overwrite)
        tasks.append((home / name, what, picture, overwrite))
    results = []
    for number, result in enumerate(_in_turn(tasks) if jobs == 1 else _shared(tasks, jobs)):
        results.append(result)
        if progress is not None:
            progress((number + 1.0) / len(tasks))
        if stop and result.status != EQUAL:
            break
    order = {path.name: number for number, (path, *_) in enumerate(tasks)}
    return sorted(results, key=lambda result: order[result.file])


def _in_turn(tasks: Sequence[_Task]) -> Iterator[Checked]:
    """Check one file after the other."""
    for task in tasks:
        clock = Clock()
        result = _one(*task)
        result.seconds = clock.seconds
        yield result


def _shared(tasks: Sequence[_Task], jobs: int) -> Iterator[Checked]:
    """Check in several processes, model by model, those with the largest files first."""
    groups: dict[str, list[_Task]] = {}
    for task in tasks:
        groups.setdefault(task[1] if isinstance(task[1], str) else task[1].model, []).append(task)
    size = {model: sum(t[0].stat().st_size for t in mine if t[0].exists()) for model, mine in groups.items()}
    ordered = sorted(groups, key=lambda model: -size[model])
    # threads of Numba do not survive a fork
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_share_threads, initargs=(jobs,)) as pool:
        yield from itertools.chain.from_iterable(pool.map(_group, [groups[model] for model in ordered]))


def _share_threads(jobs: int) -> None:
    """Give each process its part of the threads."""
    import numba

    numba.set_num_threads(max(1, numba.get_num_threads() // jobs))


def _group(tasks: Sequence[_Task]) -> list[Checked]:
    """Check the files of one model."""
    return list(_in_turn(tasks))


def _one(path: Path, what: Any, picture: Path | None, overwrite: bool) -> Checked:
    """Check one file; an error is a result like another, so that the remaining files are still done."""
    if not path.exists():
        return Checked(path.name, MISSING, message=f"is not there; run brdftab golden record {path.parent}")
    try:
        return _points(path, what, picture, overwrite) if isinstance(what, str) else _table(path, picture, overwrite)
    except BrdftabError as error:
        return Checked(path.name, BROKEN, message=str(error).removeprefix(f"{path}: "))


def _points(path: Path, model: str, picture: Path | None, overwrite: bool) -> Checked:
    """Check a model's point values, and that its settings are those of the registry."""
    head, held = read_points(path)
    result = Checked(path.name, rtol=head["rtol"])
    pairs: list[tuple[Held, Held]] = []
    for golden in held:
        now = measure(golden.label, model, golden.parameters, golden.directions, golden.tolerance)
        compare_points(result.found, golden, now, result.rtol, head["atol_part"])
        pairs.append((golden, now))
    _judge(result)
    wanted = {label: resolve(model, **given).parameters for label, given in settings(model).items()}
    kept = {golden.label: golden.parameters for golden in held}
    stale = [label for label in {**wanted, **kept} if wanted.get(label) != kept.get(label)]
    if result.status == EQUAL and stale:
        result.status = MISSING
        result.message = (
            f"the registry's settings of {model} changed ({', '.join(stale)}); run brdftab golden record "
            f"{path.parent} --only {model}{SUFFIX} --overwrite"
        )
    if result.status == DIFFERS and picture is not None:
        from brdftab.golden.figure import draw_points

        draw_points(pairs, head["atol_part"], result.rtol, model, picture, overwrite=overwrite)
        result.figure = str(picture)
    return result


def _table(path: Path, picture: Path | None, overwrite: bool) -> Checked:
    """Check a table of tables.toml from its own provenance."""
    golden = read(path)
    if not isinstance(golden, Table):
        return Checked(path.name, BROKEN, message="holds a measurement; give a table that brdftab wrote")
    now = retabulate(golden)
    rtol, atol = tolerances(golden)
    outcome = compare(golden, now)
    result = Checked(path.name, rtol=rtol)
    worst_of_tables(result.found, golden, now, rtol, atol)
    _judge(result)
    if result.status == DIFFERS and picture is not None:
        from brdftab.plotting.difference import difference

        difference(golden, now, outcome, picture, overwrite=overwrite)
        result.figure = str(picture)
    return result


def _judge(result: Checked) -> None:
    """Sort the worst numbers and settle the status."""
    result.found.close()
    result.status = DIFFERS if result.found.differing else EQUAL
