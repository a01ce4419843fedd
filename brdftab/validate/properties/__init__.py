"""One property a module: ``NAME``, ``MEANING``, ``reason`` (why it does not apply, or nothing) and ``findings``."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType


def names() -> list[str]:
    """Return the names of all properties, which are those of the modules here."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__))


def module(name: str) -> ModuleType:
    """Import one property."""
    return importlib.import_module(f"{__name__}.{name}")
