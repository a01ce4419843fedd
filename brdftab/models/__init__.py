"""The registry: what a model declares about itself, found by walking this folder."""

from __future__ import annotations

import functools
import importlib
import os
import pkgutil
from types import ModuleType
from typing import Any, cast

from brdftab.errors import ParameterError
from brdftab.models.declaration import Model
from brdftab.models.protocols import Checks, Kernel, MitsubaModule, Sampler, Stochastic, Twin

PIECES = "_shared"


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


def kernel(name: str) -> Kernel:
    """Import and return a model's Numba kernel module (it compiles on first use)."""
    return cast(Kernel, _module(name, ".kernel"))


def estimator(name: str) -> Stochastic:
    """Return the kernel module of a model some of whose setups are estimated by drawing paths."""
    return cast(Stochastic, kernel(name))


def sampler(name: str) -> Sampler:
    """Import and return a model's sampling module.

    Raises
    ------
    ParameterError
        If there is no such model, or it has no sampler.
    """
    return cast(Sampler, _part(name, "sample", "sampler"))


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


def mitsuba(name: str) -> MitsubaModule | None:
    """Return a model's module on Mitsuba 3, whose ``plugin`` names what computes the same there; None without one."""
    return cast(MitsubaModule, _module(name, ".mitsuba")) if _has(_folders()[name], "mitsuba") else None


def shader(name: str) -> str:
    """Return the GLSL source of a model.

    Raises
    ------
    ParameterError
        If there is no such model, or it has no shader.
    """
    return str(_part(name, "glsl", "shader in GLSL").source())


def twin(name: str) -> Twin:
    """Import and return a model's JAX twin.

    Raises
    ------
    ParameterError
        If there is no such model, or it has no twin.
    """
    return cast(Twin, _part(name, "twin", "twin in JAX"))


def checks(name: str) -> Checks:
    """Return what a model's folder says to `brdftab check` of itself; the defaults where it is silent.

    Raises
    ------
    ParameterError
        If there is no such model.
    """
    folders = _folders()
    if name in folders and not _has(folders[name], "checks"):
        return Checks()
    return cast(Checks, _module(name, ".checks").CHECKS)
