"""The registry: what a model declares about itself, found by walking this folder."""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
import os
import pkgutil
import warnings
from types import ModuleType
from typing import TYPE_CHECKING, cast

from brdftab.errors import ParameterError
from brdftab.models.declaration import Model
from brdftab.models.protocols import Checks, Kernel, MitsubaModule, Sampler, Stochastic, Twin, ValidatesSetup

if TYPE_CHECKING:
    from brdftab.models.resolve import Setup

PIECES = "_shared"
# packages outside brdftab name their models in this group of entry points
GROUP = "brdftab.models"


def _packages() -> dict[str, str]:
    """Map registry names (with dashes) to the packages that hold them."""
    return _listed(tuple(__path__)) | _installed()


@functools.cache
def _listed(paths: tuple[str, ...]) -> dict[str, str]:
    found = (m.name for m in pkgutil.iter_modules(paths) if m.ispkg and m.name != PIECES)
    return {name.replace("_", "-"): f"{__name__}.{name}" for name in sorted(found)}


@functools.cache
def _installed() -> dict[str, str]:
    """Map names of models in other distributions to their packages."""
    found, own = {}, _listed(tuple(__path__))
    for point in sorted(importlib.metadata.entry_points(group=GROUP), key=lambda point: point.name):
        if point.name in own:
            warnings.warn(f"{point.value} names a model {point.name}, which brdftab has itself; left out", stacklevel=2)
        elif importlib.util.find_spec(point.module.partition(".")[0]) is None:
            warnings.warn(f"{point.value}, the package of model {point.name}, is not there; left out", stacklevel=2)
        else:
            # an object behind a colon is not asked for
            found[point.name] = point.module
    return found


def names() -> list[str]:
    """Return the names of all models, sorted; imports none of them."""
    return sorted(_packages())


def list_models() -> list[Model]:
    """Return the declarations of all models, sorted by name; loads no kernel."""
    return [spec(name) for name in names()]


def package(name: str) -> str:
    """Return the dotted name of a model's package.

    Raises
    ------
    ParameterError
        If there is no such model.
    """
    packages = _packages()
    # what cannot be a name, as a list, has no hash either
    if not isinstance(name, str) or name not in packages:
        raise ParameterError.not_known("model", name, packages)
    return packages[name]


def _module(name: str, part: str) -> ModuleType:
    home = package(name)
    try:
        return importlib.import_module(f"{home}{part}")
    except ImportError as error:
        if home.startswith(f"{__name__}."):
            raise
        raise ParameterError(
            f"model = {name}: its package {home}{part} cannot be imported ({error}); install it again, or remove it"
        ) from error


def spec(name: str) -> Model:
    """Return the declaration of one model without loading its kernel.

    Raises
    ------
    ParameterError
        If there is no such model.
    """
    found = vars(_module(name, "")).get("SPEC")
    if not isinstance(found, Model):
        raise ParameterError(f"model = {name}: its package {package(name)} has no SPEC, a Model; declare one there")
    if found.name != name:
        raise ParameterError(f"model = {name}: its package {package(name)} declares {found.name}; give both one name")
    return found


def _part(name: str, part: str, called: str) -> ModuleType:
    """Import and return a module that not every model has; `called` is what users call it."""
    if name in names() and not has(name, part):
        having = ", ".join(n for n in names() if has(n, part))
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


def has(name: str, part: str) -> bool:
    """Tell whether a model's package has a module, as ``twin`` or ``sample``, without importing it."""
    packages = _packages()
    if name not in packages:
        return False
    home = packages[name]
    if home.startswith(f"{__name__}."):
        places = (os.path.join(root, home.rpartition(".")[2], part) for root in __path__)
        return any(os.path.isfile(f"{p}.py") or os.path.isfile(os.path.join(p, "__init__.py")) for p in places)
    # finding a module imports the package that holds it, which need not be there
    _module(name, "")
    return importlib.util.find_spec(f"{home}.{part}") is not None


def has_twin(name: str) -> bool:
    """Tell whether a model has a twin in JAX."""
    return has(name, "twin")


def validated(setup: Setup) -> Setup:
    """Return a setup after the model's own ``validate_setup`` has checked what hangs on several parameters, if any."""
    name = setup.model.name
    if not has(name, "validate_setup"):
        return setup
    return cast(ValidatesSetup, _module(name, ".validate_setup")).validate_setup(setup)


def mitsuba(name: str) -> MitsubaModule | None:
    """Return a model's module on Mitsuba 3, whose ``plugin`` names what computes the same there; None without one."""
    return cast(MitsubaModule, _module(name, ".mitsuba")) if has(name, "mitsuba") else None


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
    if name in names() and not has(name, "checks"):
        return Checks()
    return cast(Checks, _module(name, ".checks").CHECKS)
