"""The disk cache of kernels: an edit compiles what it touches, nothing stale is served, nothing else is changed."""

import ast
import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic

import brdftab
from brdftab.jit import kernel
from brdftab.kernel_cache import ORIGIN, PACKAGE, _tokens, fingerprint, folder, prepare_folder
from brdftab.models._shared.single_bounce import streaming

# prints a value, which kernels of the cache were read and which compiled
PROBE = """
import numba.core.caching as caching
from brdftab import kernel_cache
read, made = set(), set()
class Told(kernel_cache.KernelCache):
    def _load_overload(self, sig, context):
        found = super()._load_overload(sig, context)
        (made if found is None else read).add(self._py_func.__module__ + "." + self._py_func.__name__)
        return found
kernel_cache.KernelCache = Told
import brdftab
value = brdftab.evaluate({model!r}, .5, .7, 2., tolerance=1e-2, {given})[0]
print(repr(float(value)), "READ", *sorted(read), "MADE", *sorted(made))
"""


def kernels():
    """Return every kernel of the package by module and name."""
    for package in ("brdftab.models", "brdftab.scratch_layers"):
        home = importlib.import_module(package)
        for found in pkgutil.walk_packages(home.__path__, f"{package}."):
            if "twin" not in found.name and "mitsuba" not in found.name:
                importlib.import_module(found.name)
    return {
        (value.py_func.__module__, value.py_func.__qualname__): value
        for name, module in list(sys.modules.items())
        if name.startswith("brdftab")
        for value in vars(module).values()
        if isinstance(value, Dispatcher)
    }


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """Return a copy of the package that can be edited, and a function that evaluates there in a fresh process."""
    place = tmp_path_factory.mktemp("edited")
    shutil.copytree(PACKAGE, place / "brdftab", ignore=shutil.ignore_patterns("__pycache__"))

    def run(model, given=""):
        environment = {**os.environ, "PYTHONPATH": str(place), "NUMBA_CACHE_DIR": str(place / "cache")}
        done = subprocess.run(
            [sys.executable, "-c", PROBE.format(model=model, given=given)],
            capture_output=True, text=True, check=True, cwd=place, env=environment,
        )  # fmt: skip
        words = done.stdout.split()
        read, made = words.index("READ"), words.index("MADE")
        return float(words[0]), set(words[read + 1 : made]), set(words[made + 1 :])

    return place / "brdftab", run


def edit(path, old, new):
    """Change a file and leave its time stamp and size as they were, so that neither tells."""
    stamp, text = path.stat(), path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))


def test_every_kernel_has_a_fingerprint_and_a_name_of_its_own():
    found = kernels()
    assert len(found) > 300
    assert len({fingerprint(value) for value in found.values()}) == len(found)
    # two functions of one name in a module would share a file
    for path in sorted((PACKAGE / "models").rglob("*.py")):
        names = [n.name for n in ast.parse(path.read_text()).body if isinstance(n, ast.FunctionDef) and n.name != "_"]
        assert len(names) == len(set(names)), path


def test_an_edit_compiles_what_it_touches_and_nothing_else(copy):
    package, run = copy
    value, _, made = run("smith")
    lambert, _, own = run("lambert")
    assert made
    assert own
    assert run("smith")[2] == set()
    # comments, docstrings and lines that move change no kernel
    ndf = package / "models" / "_shared" / "facets" / "ndf.py"
    ndf.write_text("# a comment\n" + ndf.read_text())
    again, read, made = run("smith")
    assert (again, made) == (value, set())
    assert read
    # two imports away from the kernel that is called, and with the same size and time stamp
    value = run("smith", "ndf='ggx'")[0]
    edit(ndf, "return a2 / (PI * d * d)", "return a2 / (PI + d * d)")
    changed, _, made = run("smith", "ndf='ggx'")
    assert changed != value
    assert "brdftab.models._shared.facets.ndf.density" in made
    assert any(name.startswith("brdftab.models._shared.single_bounce") for name in made)
    assert run("lambert")[::2] == (lambert, set())
    edit(ndf, "return a2 / (PI + d * d)", "return a2 / (PI * d * d)")
    assert run("smith", "ndf='ggx'")[0] == value


def test_an_edited_constant_is_not_served_stale(copy):
    """The value follows a constant of a module that holds no kernel itself."""
    package, run = copy
    value, _, _ = run("smith")
    constant = package / "directions.py"
    edit(constant, "HORIZON = 1e-15", "HORIZON = 1e-00")
    assert run("smith")[0] == 0.0 != value
    edit(constant, "HORIZON = 1e-00", "HORIZON = 1e-15")
    assert run("smith")[0] == value


def test_folders_of_installations_that_are_gone_are_removed(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    old, gone, other = (tmp_path / f"kernels-{n}" for n in ("0123456789abcdef", "gone", "other"))
    for place in (old, gone, other):
        place.mkdir()
    (gone / ORIGIN).write_text(str(tmp_path / "nowhere"))
    (other / ORIGIN).write_text(str(tmp_path))
    (tmp_path / "mine").mkdir()
    prepare_folder()
    assert {p.name for p in tmp_path.iterdir()} == {other.name, folder().name, "mine"}
    assert Path((folder() / ORIGIN).read_text()) == PACKAGE


def test_closures_are_refused():
    """Numba's index tells closures apart by their cells, a fingerprint does not."""
    factor = 2.0

    def scaled(x):
        return factor * x

    with pytest.raises(TypeError, match="is a closure"):
        kernel(scaled)


def test_what_has_no_fingerprint_is_told():
    scope = {"__name__": "brdftab.test", "odd": object()}
    exec("def uses(x):\n    return odd", scope)
    with pytest.raises(TypeError, match="has no fingerprint"):
        fingerprint(scope["uses"])


def test_an_import_changes_nothing_for_others(tmp_path):
    """A float32 function of JAX and a cached function of Numba work beside brdftab as without it."""
    (tmp_path / "others.py").write_text("import numba\n@numba.njit(cache=True)\ndef twice(x):\n    return 2 * x\n")
    code = """
import numba, jax, jax.numpy as jnp
before = numba.config.CACHE_DIR
import brdftab
brdftab.evaluate("smith", .3, .4, 2.)
brdftab.tabulate("lambert", "2x2x2")
from others import twice
assert twice(3) == 6
print(jax.jit(lambda x: x + 1)(jnp.ones(2)).dtype, numba.config.CACHE_DIR == before, jax.config.jax_enable_x64)
"""
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path, env=environment
    )
    assert done.stdout.split() == ["float32", "True", "False"]
    assert list((tmp_path / "__pycache__").glob("others.twice-*.nbi"))


def test_kernels_are_kept_below_the_folder_that_is_asked():
    assert str(folder()).startswith(os.environ.get("NUMBA_CACHE_DIR", str(Path.home())))
    assert numba.config.CACHE_DIR in ("", os.environ.get("NUMBA_CACHE_DIR", ""))
    assert brdftab.__version__


def test_the_definition_of_an_intrinsic_counts():
    """What an intrinsic writes into a program is made by a function that no kernel calls."""
    found = [v for v in vars(streaming).values() if isinstance(v, _Intrinsic)]
    assert found
    for one in found:
        told = list(_tokens(one, set()))
        assert told[0] == f"function {streaming.__name__}.{one._defn.__qualname__}"
        assert len(told) > 5
