"""Complex refractive indices by name, read from the small CSV files in ``data/indices``."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from brdftab.errors import ParameterError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

FOLDER = "indices"


def names() -> list[str]:
    """Return the names of all materials, sorted; found by walking the data folder, without loading numpy."""
    return list(_known())


@cache
def _known() -> tuple[str, ...]:
    folder = resources.files(__package__) / "data" / FOLDER
    return tuple(sorted(entry.name[:-4] for entry in folder.iterdir() if entry.name.endswith(".csv")))


@cache
def read_csv(folder: str, name: str) -> np.ndarray:
    """Read one data file: comment lines start with ``#``, then a header line, then numbers.

    Parameters
    ----------
    folder, name : str
        Folder below ``data`` and file name without ``.csv``.

    Returns
    -------
    float64 (rows, columns), read-only
    """
    import numpy as np

    text = (resources.files(__package__) / "data" / folder / f"{name}.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    rows = np.loadtxt(lines[1:], delimiter=",", ndmin=2)
    rows.setflags(write=False)
    return rows


def header(name: str, folder: str = FOLDER) -> dict[str, str]:
    """Return the ``key: value`` comment lines of a data file (title, source, licence, taken from, note)."""
    return dict(_header(check(name), folder))


@cache
def _header(name: str, folder: str) -> dict[str, str]:
    text = (resources.files(__package__) / "data" / folder / f"{name}.csv").read_text(encoding="utf-8")
    pairs = (line[2:].split(": ", 1) for line in text.splitlines() if line.startswith("# "))
    first, *rest = [pair for pair in pairs if len(pair) == 2]
    return {"title": first[0], **{key: value for key, value in rest}}


def check(name: str) -> str:
    """Return `name` where it is a known material, else raise `ParameterError` that lists the known ones."""
    known = names()
    if name not in known:
        raise ParameterError.not_known("metal", name, known, ", or give eta and k", called())
    return name


def called() -> dict[str, str]:
    """Return the materials by their names in English, as gold for Au."""
    return {header(name)["title"].partition(":")[0].strip(): name for name in names()}


def load(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the tabulated index of a material.

    Parameters
    ----------
    name : str
        One of `names`.

    Returns
    -------
    wavelength_nm, n, k : float64 (rows,)
        Vacuum wavelength in nm, increasing; real part; extinction coefficient (n + ik, k >= 0). Read-only views.

    Raises
    ------
    ParameterError
        If the name is not known.
    """
    wavelength, n, k = read_csv(FOLDER, check(name)).T
    return wavelength, n, k


def at(name: str, wavelengths: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate n and k linearly in the wavelength.

    Parameters
    ----------
    name : str
        One of `names`.
    wavelengths : array_like (...)
        Wavelengths in nm, inside the data; there is no extrapolation.

    Returns
    -------
    n, k : float64 (...)

    Raises
    ------
    ParameterError
        If the name is not known or a wavelength is not finite or outside the data.
    """
    import numpy as np

    table, n, k = load(name)
    wavelengths = np.asarray(wavelengths, dtype=np.float64)
    wrong = ~((wavelengths >= table[0]) & (wavelengths <= table[-1]))  # also true for NaN
    if wrong.any():
        value = f"{wavelengths[wrong].flat[0]:g} nm"
        valid = f"the data of {name}, {table[0]:g} to {table[-1]:g} nm"
        raise ParameterError.out_of_range("wavelengths", value, valid, "choose wavelengths inside it or give eta and k")
    return np.interp(wavelengths, table, n), np.interp(wavelengths, table, k)
