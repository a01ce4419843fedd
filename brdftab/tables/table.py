"""The table: values over a grid together with all that is needed to read them rightly."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab._version import __version__
from brdftab.errors import FileFormatError, GridError, ParameterError
from brdftab.tables.content import listed, same_fields, told
from brdftab.tables.grid import Grid
from brdftab.tables.storage import Layout

FORMAT = "brdftab-table"
FORMAT_VERSION = 1
DTYPES = ("float32", "float64")

_CHANNEL = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}|[0-9]{1,9}(\.[0-9]{1,9})?nm")
_COMPONENT = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")
# these name the layers that carry the mask and the bits of float64 values in an EXR
RESERVED = ("mask", "bits_hi", "bits_lo", "values")

_CELL_MEANING = {
    "center": "value at the position; cells that hold the mirror direction of a singular model: the cell's average",
    "average": "average over the cell, weighted by cos(theta_i) sin(theta_i) cos(theta_o) sin(theta_o)",
    "point": "value at the position",
}


_BELOW = (
    "theta above 90 degrees points into the material below; f(i, o)/n_o^2 = f(o, i)/n_i^2, and f |cos(theta_o)| over "
    "all directions o adds up to the share of the light that is not absorbed; straight through is phi = pi"
)


@dataclass(repr=False, eq=False)
class Table:
    """Values of a BRDF over a grid; NumPy takes it as the array of its values.

    Tables are equal (``==``) where values, grid, channels, components and mask are: NaN equals NaN, and what made them
    and how long it took does not count. Like arrays they can change, so that they have no hash.

    Attributes
    ----------
    values : ndarray of float32 or float64
        f in 1/sr without cosine, shape (theta_i, theta_o, phi, channel) on an isotropic grid, (theta_i, phi_i,
        theta_o, phi_o, channel) on an anisotropic one.
    grid : Grid
        Axes in radians, edges, and what a cell's value means.
    channels : tuple of str
        ``("R", "G", "B")`` (linear sRGB, may exceed 1), ``("Y",)``, or wavelengths such as ``"450nm"``.
    components : dict of str to ndarray
        Named parts of `values`, same shape and dtype.
    mask : ndarray of bool or None
        Same shape as `values`; True where the value is valid.
    provenance : dict
        JSON-able: model, parameters, error, run time and the like. Numpy numbers in it become plain ones, tuples lists.
    version : str
        Version of brdftab that made the values.

    Raises
    ------
    ParameterError
        Where shapes, dtypes or names do not fit, or the provenance is not JSON-able.
    """

    values: NDArray[Any]
    grid: Grid
    channels: tuple[str, ...]
    components: dict[str, NDArray[Any]] = field(default_factory=dict)
    mask: NDArray[np.bool_] | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    version: str = __version__

    def __post_init__(self) -> None:
        self.channels = _names("channel", self.channels, _CHANNEL)
        if not self.channels:
            raise ParameterError("channels is empty; name at least one, such as Y")
        _names("component", list(self.components), _COMPONENT)
        shape = (*self.grid.shape, len(self.channels))
        self.values = _array("values", self.values, shape, DTYPES)
        same = (self.values.dtype.name,)
        self.components = {name: _array(f"component {name}", v, shape, same) for name, v in self.components.items()}
        if self.mask is not None:
            self.mask = _array("mask", self.mask, shape, ("bool",))
        self.provenance = _plain(self.provenance)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return `values`, a view of them unless `dtype` or `copy` asks for more; the mask is left out."""
        return np.array(self.values, dtype=dtype, copy=copy)

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other, ("values", "grid", "channels", "components", "mask"))

    __hash__ = None  # type: ignore[assignment]  # its content can change

    def __repr__(self) -> str:
        error = self.provenance.get("error")
        return told(
            self,
            str(self.provenance.get("model", "")),
            " x ".join(f"{name} {axis.size}" for name, axis in self.grid.axes.items()),
            f"channels {listed(self.channels)}",
            f"{self.dtype.name} in 1/sr",
            f"cell = {self.grid.cell}",
            f"components {listed(self.components)}" if self.components else "",
            "" if self.mask is None else f"{int((~self.mask).sum()):,} numbers masked out",
            f"error {error['estimate']:.1e}" if isinstance(error, dict) and _is_number(error.get("estimate")) else "",
        )

    @property
    def theta_i(self) -> NDArray[np.float64]:
        """Polar angles of the light, radians."""
        return self.grid.theta_i

    @property
    def theta_o(self) -> NDArray[np.float64]:
        """Polar angles of the view, radians."""
        return self.grid.theta_o

    @property
    def phi(self) -> NDArray[np.float64] | None:
        """Relative azimuth phi_o - phi_i in radians, None on an anisotropic grid."""
        return self.grid.phi

    @property
    def phi_i(self) -> NDArray[np.float64] | None:
        """Azimuth of the light in radians, None on an isotropic grid."""
        return self.grid.phi_i

    @property
    def phi_o(self) -> NDArray[np.float64] | None:
        """Azimuth of the view in radians, None on an isotropic grid."""
        return self.grid.phi_o

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of `values`."""
        return self.values.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of `values`, float32 or float64."""
        return self.values.dtype

    @property
    def convention(self) -> dict[str, str]:
        """What the numbers mean, in words that are stored with the table."""
        below = {"below": _BELOW} if self.grid.below else {}
        return {
            "quantity": "f",
            "quantity_meaning": f"{'BSDF' if below else 'BRDF'} value without the cosine of theta_i",
            "unit": "1/sr",
            "angle_unit": "radians",
            "theta": "measured from the surface normal; both directions point away from the surface",
            "direction_i": "towards the light",
            "direction_o": "towards the viewer",
            "phi": "phi = phi_o - phi_i: the mirror direction is at pi, the retro direction at 0",
            **below,
            "azimuth_zero": "x axis, the direction of alpha_x",
            "alpha": "parameters named alpha are the roughness itself, not its square root or square",
            "channels": _colour(self.channels),
            "cell": self.grid.cell,
            "cell_meaning": _CELL_MEANING[self.grid.cell],
            "produced_by": f"brdftab {self.version}; model, parameters and seed (where one was used) are in provenance",
        }

    def metadata(self) -> dict[str, Any]:
        """Return everything but the arrays of values as a JSON-able dict; floats keep every bit."""
        grid = self.grid.to_json()
        return {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "version": self.version,
            "dtype": self.dtype.name,
            "shape": list(self.shape),
            "cell": grid["cell"],
            "axes": grid["axes"],
            "edges": grid["edges"],
            "channels": list(self.channels),
            "components": list(self.components),
            "mask": self.mask is not None,
            "convention": self.convention,
            "provenance": _plain(self.provenance),
        }

    @classmethod
    def from_parts(
        cls,
        values: NDArray[Any],
        components: Mapping[str, NDArray[Any]],
        mask: NDArray[np.bool_] | None,
        metadata: Mapping[str, Any],
    ) -> Table:
        """Build a table from arrays and the dict of `metadata`.

        Raises
        ------
        FileFormatError
            Where the metadata is not that of a brdftab table or disagrees with the arrays.
        """
        head = Header.parse(metadata)
        if list(components) != list(head.components) or (mask is not None) != head.mask:
            raise FileFormatError("the components or the mask disagree with what the metadata names")
        try:
            if values.dtype.name != head.dtype:
                raise ParameterError(f"values has the type {values.dtype}, the metadata says {head.dtype}")
            return cls(values, head.grid, head.channels, dict(components), mask, head.provenance, head.version)
        except ParameterError as error:
            raise FileFormatError(str(error)) from error


@dataclass(frozen=True)
class Header:
    """The checked metadata of a table: known before any array is read."""

    grid: Grid
    channels: tuple[str, ...]
    components: tuple[str, ...]
    mask: bool
    dtype: str
    version: str
    provenance: dict[str, Any]
    layout: Layout

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values that the metadata declares."""
        return (*self.grid.shape, len(self.channels))

    @property
    def stored_shape(self) -> tuple[int, ...]:
        """Shape of the arrays in the file."""
        return self.layout.shape(self.shape, self.channels)

    @classmethod
    def parse(cls, metadata: object) -> Header:
        """Check the metadata of a table.

        Parameters
        ----------
        metadata : object
            What a file's JSON held.

        Returns
        -------
        Header

        Raises
        ------
        FileFormatError
            One line on the first thing that is missing or wrong.
        """
        if not isinstance(metadata, Mapping) or metadata.get("format") != FORMAT:
            raise FileFormatError(f'the metadata does not say "format": "{FORMAT}"')
        number = metadata.get("format_version")
        if type(number) is not int or number < 1:
            raise FileFormatError(f"format_version must be a whole number from 1 to {FORMAT_VERSION}")
        if number > FORMAT_VERSION:
            raise FileFormatError(
                f"format_version = {number} is newer than {FORMAT_VERSION}, which brdftab {__version__} reads; "
                "update brdftab"
            )
        wanted = {"version": str, "dtype": str, "shape": list, "channels": list, "components": list, "mask": bool}
        wanted |= {"convention": dict, "provenance": dict}
        for key, kind in wanted.items():
            if not isinstance(metadata.get(key), kind):
                raise FileFormatError(f"the metadata's {key} is missing or not of type {kind.__name__}")
        if metadata["dtype"] not in DTYPES:
            raise FileFormatError(f"the metadata's dtype is not one of {', '.join(DTYPES)}")
        for key, ours in (("quantity", "f"), ("unit", "1/sr"), ("angle_unit", "radians")):
            if metadata["convention"].get(key) != ours:
                raise FileFormatError(f"the metadata's convention does not state {key} = {ours}")
        try:
            grid = Grid.from_json(metadata)
            channels = _names("channel", metadata["channels"], _CHANNEL)
            components = _names("component", metadata["components"], _COMPONENT)
            provenance = _plain(metadata["provenance"])
        except (GridError, ParameterError) as error:
            raise FileFormatError(str(error)) from error
        plain = (metadata["mask"], metadata["dtype"], metadata["version"], provenance)
        head = cls(grid, channels, components, *plain, Layout.parse(metadata, grid, channels))
        if not channels or metadata["shape"] != list(head.shape):
            raise FileFormatError("the metadata's shape disagrees with its axes and channels")
        return head


def _names(what: str, names: Sequence[Any], pattern: re.Pattern[str]) -> tuple[str, ...]:
    """Check channel or component names: well formed and unique."""
    for name in names:
        if not isinstance(name, str) or not pattern.fullmatch(name) or (what == "component" and name in RESERVED):
            raise ParameterError(
                f"{what} name {str(name)[:40]!r} is not valid; use letters, digits and _, as in R or order1"
            )
    if len(set(names)) != len(names):
        raise ParameterError(f"a {what} name occurs twice; make them unique")
    return tuple(names)


def _array(name: str, array: NDArray[Any], shape: tuple[int, ...], dtypes: tuple[str, ...]) -> NDArray[Any]:
    """Check an array's type and shape."""
    array = np.asarray(array)
    if array.dtype.name not in dtypes or not array.dtype.isnative:
        raise ParameterError(f"{name} has the type {array.dtype}; it must be {' or '.join(dtypes)}")
    if array.shape != shape:
        raise ParameterError(f"{name} has the shape {array.shape}; the grid and channels need {shape}")
    return array


def _is_number(value: object) -> bool:
    """Tell whether a value of a file's provenance can be shown as a number."""
    return isinstance(value, int | float)


def _plain(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the provenance as it will come back from JSON; numpy numbers and arrays become plain ones."""
    if not isinstance(provenance, dict):
        raise ParameterError("the provenance must be a dict")
    try:
        return _walked(provenance)
    except (TypeError, ValueError, RecursionError) as error:
        raise ParameterError(f"the provenance cannot be stored as JSON: {error}") from error


def _walked(value: Any) -> Any:
    """Return plain Python of what JSON can hold; many times faster than writing and reading it."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not finite")
        return value
    if value is None or isinstance(value, str | int):
        return value
    if isinstance(value, list | tuple):
        return [_walked(v) for v in value]
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            raise TypeError("the name of an entry is no text")
        return {key: _walked(v) for key, v in value.items()}
    raise TypeError(f"{type(value).__name__} is not JSON-able")


def _colour(channels: tuple[str, ...]) -> str:
    """Say what the channels are."""
    if channels == ("R", "G", "B"):
        return "linear sRGB, from spectra where the material is spectral; values above 1 are legitimate"
    if channels == ("Y",):
        return "one achromatic channel"
    if all(name.endswith("nm") for name in channels):
        return "one a named wavelength"
    return "named channels"
