"""Models against the contract of `brdftab.models.protocols`: no name that nothing reads, no signature of its own."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

from brdftab import models
from brdftab.models import protocols
from brdftab.models.protocols import Checks

PARTS = {
    "kernel": protocols.Kernel,
    "sample": protocols.Sampler,
    "twin": protocols.Twin,
    "validate_setup": protocols.ValidatesSetup,
    "mitsuba": protocols.MitsubaModule,
    "glsl": protocols.ShaderModule,
}
# aliases of types say nothing
ALIASES = {"Array", "__all__"}


def of(base):
    """Return a protocol and its optional capabilities."""
    every = [v for v in vars(protocols).values() if inspect.isclass(v) and v.__module__ == protocols.__name__]
    return [p for p in every if p is base or base in p.__mro__]


def members(base):
    """Return what a part of a model may be asked for: name -> parameters of a function, None for a constant."""
    found = {}
    for protocol in of(base):
        for name in vars(protocol).get("__annotations__", {}):
            found[name] = None
        for name, value in vars(protocol).items():
            if inspect.isfunction(value) and not name.startswith("_"):
                found[name] = list(inspect.signature(value).parameters)[1:]
    return found


def file_of(folder, part):
    return next((p for p in (folder / f"{part}.py", folder / part / "__init__.py") if p.is_file()), None)


def public(path):
    """Return the names that a module defines, or lists in __all__, for others."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign):
            names = {x.id for target in node.targets for x in ast.walk(target) if isinstance(x, ast.Name)}
            found |= {e.value for e in node.value.elts} if "__all__" in names else names
        elif isinstance(node, ast.AnnAssign):
            found.add(node.target.id)
    return {name for name in found if not name.startswith("_")} - ALIASES


def unknown(folder, part):
    """Return the public names of a part that no protocol knows."""
    path = file_of(folder, part)
    return set() if path is None else public(path) - set(members(PARTS[part]))


@pytest.mark.parametrize("name", models.names())
def test_models_offer_what_the_contract_knows_and_nothing_else(name):
    package = importlib.import_module(f"brdftab.models.{name.replace('-', '_')}")
    folder = Path(package.__file__).parent
    assert file_of(folder, "kernel")
    for part, base in PARTS.items():
        assert not unknown(folder, part), part
        if file_of(folder, part) is None:
            continue
        module, required = importlib.import_module(f"{package.__name__}.{part}"), vars(base)
        for member, parameters in members(base).items():
            found = getattr(module, member, None)
            # the base is what every model has
            assert found is not None or member not in {*required, *required.get("__annotations__", {})}, member
            if found is not None and parameters is not None:
                own = inspect.signature(found).parameters
                loose = any(p.kind in (p.VAR_KEYWORD, p.VAR_POSITIONAL) for p in own.values())
                assert loose or list(own) == parameters, f"{part}.{member}"
    assert public(folder / "__init__.py") == {"SPEC"}
    if file_of(folder, "checks"):
        assert public(folder / "checks.py") == {"CHECKS"}
        assert isinstance(models.checks(name), Checks)


def test_a_misspelt_name_is_found(tmp_path):
    (tmp_path / "kernel.py").write_text("def points():\n    pass\n\n\ndef albdeo():\n    pass\n")
    assert unknown(tmp_path, "kernel") == {"albdeo"}
    with pytest.raises(TypeError, match="furnaces"):
        Checks(furnaces=())


def test_nothing_asks_modules_by_bare_names():
    """What is asked of a model's module is asked by its protocol, which the type checker sees."""
    root = Path(models.__file__).parents[1]
    wrong = []
    for path in sorted(root.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("getattr", "hasattr"):
                asked = ast.unparse(node.args[0])
                if "module" in asked or "models." in asked or "twin(" in asked or "kernel(" in asked:
                    wrong.append(f"{path.relative_to(root)}: {ast.unparse(node)}")
    # properties of the checks may skip themselves; the cache looks into modules of any kind
    others = ("validate/run.py", "kernel_cache.py")
    assert [w for w in wrong if not w.startswith(others) and "importlib" not in w] == []
