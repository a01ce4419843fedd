"""The registry: what a model declares about itself, found by walking this folder."""

from __future__ import annotations

import functools
import importlib
import os
import pkgutil
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from brdftab.errors import ParameterError, proposal

PIECES = "_shared"


@dataclass(frozen=True)
class Param:
    """One parameter of a model, declared once and used by the API, the command line and the docs.

    Attributes
    ----------
    name : str
        Name in the API; the option is ``--name`` with dashes.
    unit : str
        ``""`` for pure numbers, ``"rad"`` for angles (degrees on the command line).
    default : object
        Value taken when the user gives none; ``None`` means not set.
    bounds : tuple of float or None
        Inclusive lower and upper bound of every entry.
    doc : str
        One line for ``--help`` and ``brdftab models``.
    kind : {"float", "channels", "choice", "int", "text"}
        ``channels`` takes one value or one a channel; ``choice`` takes one of `choices`; ``text`` is read by the
        model's own ``validate_setup``.
    choices : tuple of str
        Allowed words of a ``choice``.
    remark : str
        What an error about this parameter adds: why a value is left out, or what to do instead.
    role : {"", "albedo", "bounces", "optics", "paths", "roughness", "tilt"}
        What it is to all that serves models without knowing them: the albedo of a matte body; a cap of the bounces;
        what facets reflect; how an estimator draws its paths; the distribution of facets and its width; the deviation
        of facets' tilt (radians). Without a role a name means nothing but the model's own.
    """

    name: str
    unit: str
    default: Any
    bounds: tuple[float, float] | None
    doc: str
    kind: str = "float"
    choices: tuple[str, ...] = ()
    remark: str = ""
    role: str = ""


@dataclass(frozen=True)
class Model:
    """What a model says of itself.

    Attributes
    ----------
    name, title, summary : str
        Registry name, full name, one line.
    params : tuple of Param
        Its parameters.
    components : tuple of str
        Named components; ``("order",)`` means one a bounce order.
    singular : bool
        True where the density is infinite at the mirror direction, so that a cell there holds an average.
    kinked : bool
        True where the masking of a V-cavity sets in with an edge (with ``masking = smith`` it does not), so that tables
        to be interpolated are looked at more closely.
    multibounce : bool
        True where ``max_bounces`` applies.
    citation, doi : str
        The paper.
    variant, errata : str
        Which formula was chosen and which misprints were mended, and why.
    ndfs : tuple of str
        Normal distributions that the model takes; empty for models without facets.
    reciprocal : bool
        False where swapping light and view changes the value, so that no half of a grid follows from the other.
    transmits : bool
        True where a dielectric (ior) sends light through the surface, so that directions below it count.
    grain : bool
        True where the surface has a direction of its own, azimuth 0, so that azimuths count one by one.
    forms : tuple of str
        Files of its own kind that ``tabulate --form`` writes, the first by default; empty for tables alone.
    roughness : str
        Name of the roughness parameter; its anisotropic pair ends in ``_x`` and ``_y``.
    """

    name: str
    title: str
    summary: str
    params: tuple[Param, ...]
    components: tuple[str, ...]
    citation: str
    doi: str
    variant: str
    errata: str = ""
    singular: bool = False
    kinked: bool = False
    multibounce: bool = False
    transmits: bool = False
    reciprocal: bool = True
    grain: bool = False
    ndfs: tuple[str, ...] = field(default=())
    forms: tuple[str, ...] = field(default=())
    roughness: str = "alpha"

    def __post_init__(self) -> None:
        """Refuse names that a twin's numbers have: ``a`` and ``b`` of a reflectance, both roughnesses, nodes."""
        taken = {"nodes", "prepared"}
        taken |= {"a", "b"} if self.of_role("optics") else set()
        taken |= {"alpha_x", "alpha_y"} if self.ndfs else set()
        clash = [p.name for p in self.params if p.name in taken and not p.role]
        if clash:
            raise ValueError(f"{clash[0]} of model {self.name} is what twins call something else; choose another name")

    def __repr__(self) -> str:
        return f"Model({self.name}: {self.title}, {len(self.params)} parameters)"

    def has(self, name: str) -> bool:
        """Tell whether the model declares a parameter of that name."""
        return any(p.name == name for p in self.params)

    def shares(self, name: str) -> bool:
        """Tell whether the model declares a parameter of that name with the meaning that all models give to it."""
        return any(p.name == name and p.role for p in self.params)

    def of_role(self, role: str) -> tuple[str, ...]:
        """Return the names of the parameters of one role."""
        return tuple(p.name for p in self.params if p.role == role)

    def param(self, name: str) -> Param:
        """Return the declaration of one parameter, or raise `ParameterError`."""
        for p in self.params:
            if p.name == name:
                return p
        known = [p.name for p in self.params]
        near = proposal(name, known)
        raise ParameterError(
            f"{name} is not a parameter of {self.name}; {near}{'I' if near else 'i'}t takes {', '.join(known)}"
        )


def _folders() -> dict[str, str]:
    """Map registry names (with dashes) to the folders that hold them."""
    return _listed(tuple(__path__))


@functools.cache
def _listed(paths: tuple[str, ...]) -> dict[str, str]:
    found = (m.name for m in pkgutil.iter_modules(paths) if m.ispkg and m.name != PIECES)
    return {name.replace("_", "-"): name for name in sorted(found)}


def names() -> list[str]:
    """Return the names of all models, sorted; imports none of them."""
    return list(_folders())


def list_models() -> list[Model]:
    """Return the declarations of all models, sorted by name; loads no kernel."""
    return [spec(name) for name in names()]


def _module(name: str, part: str) -> ModuleType:
    folders = _folders()
    if name not in folders:
        raise ParameterError.not_known("model", name, folders)
    return importlib.import_module(f"{__name__}.{folders[name]}{part}")


def spec(name: str) -> Model:
    """Return the declaration of one model without loading its kernel.

    Raises
    ------
    ParameterError
        If there is no such model.
    """
    return _module(name, "").SPEC


def _part(name: str, part: str, called: str) -> ModuleType:
    """Import and return a module that not every model has; `called` is what users call it."""
    folders = _folders()
    if name in folders and not _has(folders[name], part):
        having = ", ".join(n for n, folder in folders.items() if _has(folder, part))
        raise ParameterError(f"model = {name} has no {called}; choose one of {having}")
    return _module(name, f".{part}")


def kernel(name: str) -> ModuleType:
    """Import and return a model's Numba kernel module (it compiles on first use): ``points``, and what helps it.

    Some have more: ``prepare`` (a fast path of tables), ``albedo``, ``smooth_albedo`` with ``specular_points``, and
    ``split_albedo`` (albedos that the model integrates itself), ``singular_setup``, ``energy_left_out``, ``stochastic``
    with ``estimates`` and ``estimate_table``, and ``mirror_reflectance`` (setup, theta_i (N,)): the share (N, C) of
    light that is reflected into the mirror direction alone, a delta of the first component that no value holds; the
    sampler then has ``mirror_mass``, the probability (N,) with which to draw that direction.
    """
    return _module(name, ".kernel")


def sampler(name: str) -> ModuleType:
    """Import and return a model's sampling module: ``sample`` and ``pdf``.

    Raises
    ------
    ParameterError
        If there is no such model, or it has no sampler.
    """
    return _part(name, "sample", "sampler")


def _has(folder: str, module: str) -> bool:
    """Tell whether a model's folder holds a module or package, without importing it."""
    places = (os.path.join(root, folder, module) for root in __path__)
    return any(os.path.isfile(f"{place}.py") or os.path.isfile(os.path.join(place, "__init__.py")) for place in places)


def has(name: str, part: str) -> bool:
    """Tell whether a model's folder has a module, as ``twin`` or ``sample``, without importing it."""
    return name in _folders() and _has(_folders()[name], part)


def validated(setup: Any) -> Any:
    """Return a setup after the model's own ``validate_setup`` has checked what hangs on several parameters, if any."""
    folder = _folders()[setup.model.name]
    if not _has(folder, "validate_setup"):
        return setup
    return importlib.import_module(f"{__name__}.{folder}.validate_setup").validate_setup(setup)


def has_twin(name: str) -> bool:
    """Tell whether a model has a twin in JAX."""
    return _has(_folders()[name], "twin")


def declared(name: str, attribute: str, otherwise: Any) -> Any:
    """Return what a model's folder says beside its `SPEC` under a name such as ``METHODS``, or `otherwise`.

    ``METHODS`` maps a parameter to values that compute the same more roughly; ``APPROXIMATES`` maps a model that this
    one stands for to those of its parameters that this one does without.
    """
    return getattr(_module(name, ""), attribute, otherwise)


def mitsuba(name: str) -> ModuleType | None:
    """Return a model's module on Mitsuba 3, whose ``plugin`` names what computes the same there; None without one."""
    return _module(name, ".mitsuba") if _has(_folders()[name], "mitsuba") else None


def shader(name: str) -> str:
    """Return the GLSL source of a model.

    Raises
    ------
    ParameterError
        If there is no such model, or it has no shader.
    """
    return str(_part(name, "glsl", "shader in GLSL").source())


def twin(name: str) -> ModuleType:
    """Import and return a model's JAX twin: ``shapes``, ``value`` and ``SHAPE_PARAMS``.

    Some have more: ``rule_nodes`` (nodes of a tolerance as numbers), ``nodes`` (numbers that follow from the data's
    angles), ``prepare`` (the costly part that no single point enters), ``check`` (refuses choices that have no twin),
    ``roughness_bounds`` (of a fit, narrower than declared, by the word for the distribution).

    Raises
    ------
    ParameterError
        If there is no such model, or it has no twin.
    """
    return _part(name, "twin", "twin in JAX")


def checks(name: str) -> ModuleType | None:
    """Import and return what a model's folder says to `brdftab check` of itself, or None where it is silent.

    A module ``checks`` may have: ``TOLERANCE`` (at which the checks evaluate), ``CHEAP`` (settings that keep it
    quick), ``SETTINGS`` (extremes that no bound tells), ``FURNACE`` (settings that must return all light),
    ``SWITCHES`` (where it changes formula), ``SKIP`` and ``SKIP_FAST`` (why a property is not measured),
    ``NO_SCAN`` (parameters along which jumps are not looked for), ``UNCAPPED`` (False where bounces end even if no cap
    is given), ``CONE`` (the parameter that is the half width of a cone), ``RECIPROCITY`` (what swapped pairs may differ
    by), ``TWIN_TOLERANCE`` (what the twin may differ by), ``UNRESOLVED`` (ranges of a conductor's numbers that a limit
    of the tolerance names); and how much is enough where it is expensive, by "fast" and "full": ``THIN`` (every n-th
    setting, bounds apart), ``DIRECTIONS`` (every n-th), ``SCANS``, ``VARIANTS``, ``BOX`` (how many), and for both
    ``TWIN_DIRECTIONS``, ``SWITCH_DIRECTIONS`` (how many) and ``TWIN_THIN`` (every n-th setting of the twin).

    Raises
    ------
    ParameterError
        If there is no such model.
    """
    folders = _folders()
    if name in folders and not _has(folders[name], "checks"):
        return None
    return _module(name, ".checks")
