"""The disk cache of compiled kernels: one entry a function, valid as long as nothing that it is compiled from changes.

Numba's own cache looks at the time stamp of the file that holds a function, so an edit of a helper in another file
would leave a stale caller behind. Here an entry carries a fingerprint of the function's byte code, of the constants
that it reads and of every kernel that it calls, so that an edit compiles what it touches and nothing else.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import types
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic

from brdftab.system import cache_folder

PACKAGE = Path(__file__).parent
# names the checkout or installation that a folder's kernels belong to
ORIGIN = "origin"


def folder(package: Path = PACKAGE) -> Path:
    """Return the folder of an installation's compiled kernels; others, as of a second checkout, keep their own."""
    return cache_folder() / f"kernels-{hashlib.sha256(str(package).encode()).hexdigest()[:16]}"


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a hash of all that a kernel is compiled from.

    Parameters
    ----------
    function : callable
        A compiled kernel, or the Python function that one is made from.

    Returns
    -------
    str
        Changes with the byte code, default values, options and constants of the function and of all kernels that it
        calls; not with comments, docstrings or line numbers.

    Raises
    ------
    TypeError
        If it depends on something that has no fingerprint.
    """
    digest = hashlib.sha256()
    for token in _tokens(function, set()):
        digest.update(token.encode())
        digest.update(b"\0")
    return digest.hexdigest()


def _tokens(value: Any, seen: set[int]) -> Iterator[str]:
    """Yield texts that tell a constant or a function from any other."""
    if isinstance(value, Dispatcher):
        for name, option in sorted(value.targetoptions.items()):
            yield f"option {name}"
            yield from _tokens(option, seen)
        yield from _tokens(value.py_func, seen)
    elif isinstance(value, types.FunctionType) and not _foreign(value.__module__):
        yield f"function {value.__module__}.{value.__qualname__}"
        if id(value) in seen:
            return
        seen.add(id(value))
        yield from _tokens(value.__defaults__, seen)
        yield from _code(value.__code__, value.__globals__, seen)
    elif isinstance(value, types.CodeType):
        yield from _code(value, {}, seen)
    elif isinstance(value, tuple | list | set | frozenset):
        yield f"{type(value).__name__} {len(value)}"
        # the order of a set of words differs from process to process
        for one in sorted(value, key=repr) if isinstance(value, set | frozenset) else value:
            yield from _tokens(one, seen)
    elif isinstance(value, np.ndarray):
        yield f"array {value.dtype.str} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    elif value is None or isinstance(value, bool | int | float | complex | str | bytes | np.generic | np.dtype):
        yield f"{type(value).__name__} {value!r}"
    elif isinstance(value, _Intrinsic):
        # what it writes into the program is made by a function within its definition
        yield from _tokens(value._defn, seen)
    elif isinstance(value, types.ModuleType):
        yield f"module {value.__name__}"
    elif hasattr(value, "__qualname__") and getattr(value, "__module__", None):
        # functions and types of other packages, whose versions the index holds
        yield f"name {value.__module__}.{value.__qualname__}"
    elif callable(value) and hasattr(value, "__name__"):
        yield f"name {value.__name__}"
    else:
        raise TypeError(f"a kernel depends on {value!r}, which has no fingerprint; give it a number or an array")


def _foreign(module: str) -> bool:
    """Tell whether a module is of Python or of Numba, whose versions the index holds, or of NumPy."""
    top = module.partition(".")[0]
    return top in {"numba", "numpy", "llvmlite"} or top in sys.stdlib_module_names


def _code(code: types.CodeType, scope: dict[str, Any], seen: set[int]) -> Iterator[str]:
    """Yield what a code object computes, and the globals that it names."""
    yield hashlib.sha256(code.co_code).hexdigest()
    yield f"{code.co_varnames} {code.co_argcount} {code.co_names}"
    # the docstring comes first among the constants, and computes nothing
    for constant in code.co_consts[1:] if code.co_consts[:1] and isinstance(code.co_consts[0], str) else code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _code(constant, scope, seen)
        else:
            yield from _tokens(constant, seen)
    modules = [scope[name] for name in code.co_names if isinstance(scope.get(name), types.ModuleType)]
    for name in code.co_names:
        if name in scope:
            yield name
            yield from _tokens(scope[name], seen)
        # modules that are attributes of modules join the list as they are met
        for module in modules:
            if not _foreign(module.__name__) and hasattr(module, name):
                found = getattr(module, name)
                if isinstance(found, types.ModuleType) and found not in modules:
                    modules.append(found)
                yield f"{module.__name__}.{name}"
                yield from _tokens(found, seen)


class _Impl(CompileResultCacheImpl):
    """What numba asks for to write compiled code and read it back."""

    def __init__(self, function: types.FunctionType) -> None:
        self._filename_base = self.get_filename_base(function.__qualname__, "")

    @property
    def locator(self) -> _Impl:
        """Return what numba asks for a part of the file's name."""
        return self

    def get_disambiguator(self) -> str:
        """Return that part, the same wherever in its file a function stands."""
        return "kernel"


class KernelCache(FunctionCache):
    """Numba's cache of one function, stamped with its `fingerprint` when it is first asked."""

    def __init__(self, function: types.FunctionType) -> None:
        if function.__closure__ is not None:
            raise TypeError(f"kernel {function.__qualname__} is a closure, which no cache can tell from another")
        self._name = repr(function)
        self._py_func = function
        self._impl = _Impl(function)
        self.enable()

    @property
    def cache_path(self) -> str:
        """Return the folder of the function's module."""
        return str(folder() / self._py_func.__module__)

    @cached_property
    def _cache_file(self) -> IndexDataCacheFile:  # type: ignore[override]  # made late, as the comment says
        # not before the first call: only then every function that this one calls is defined
        return IndexDataCacheFile(self.cache_path, self._impl.filename_base, fingerprint(self._py_func))

    def _save_overload(self, sig: Any, data: Any) -> None:
        if not self._enabled or not self._impl.check_cachable(data):
            return
        prepare_folder()
        os.makedirs(self.cache_path, exist_ok=True)
        self._cache_file.save(self._index_key(sig, data.codegen), self._impl.reduce(data))


def prepare_folder() -> None:
    """Make this installation's folder, and remove those of installations that are gone."""
    own = folder()
    if (own / ORIGIN).exists():
        return
    own.mkdir(parents=True, exist_ok=True)
    (own / ORIGIN).write_text(str(PACKAGE), encoding="utf-8")
    for other in own.parent.glob("kernels-*"):
        try:
            kept = Path((other / ORIGIN).read_text(encoding="utf-8")).is_dir()
        except (OSError, UnicodeDecodeError):
            kept = False
        if not kept:
            shutil.rmtree(other, ignore_errors=True)


def has_compiled(module: str) -> bool:
    """Tell whether kernels of a module or package, by its dotted name, were compiled before, maybe other versions."""
    return any(folder().glob(f"{module}/*.nbi")) or any(folder().glob(f"{module}.*/*.nbi"))
