"""The plan of the code, held by tests: what may import what, what the command line loads, how long a module may be."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "brdftab"
LONGEST = 400


def modules():
    """Return every module of the package: dotted name below it ("" for the package itself) -> parsed source."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = ast.parse(path.read_text())
    return found


MODULES = modules()


def is_typing(node):
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)


def imports(tree, deep=True):
    """Return the dotted names below brdftab that a module imports, leaving out what only type checkers see."""
    found, queue = set(), list(ast.iter_child_nodes(tree))
    while queue:
        node = queue.pop()
        if is_typing(node):
            continue
        if isinstance(node, ast.Import):
            found |= {a.name.partition(".")[2] for a in node.names if a.name.split(".")[0] == "brdftab"}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "brdftab":
            base = node.module.partition(".")[2]
            for alias in node.names:
                full = f"{base}.{alias.name}".lstrip(".")
                found.add(full if full in MODULES else base)
        elif deep or not isinstance(node, ast.FunctionDef | ast.ClassDef):
            queue += ast.iter_child_nodes(node)
    return found - {""}


def test_arrows_point_one_way():
    """The layers of pyproject.toml; imports inside functions count, those for type checkers do not."""
    done = subprocess.run(["lint-imports", "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_no_relative_imports():
    assert not [n for n, tree in MODULES.items() for x in ast.walk(tree) if isinstance(x, ast.ImportFrom) and x.level]


def test_modules_form_no_circle():
    graph = {name: imports(tree) & set(MODULES) for name, tree in MODULES.items() if name}
    done, path = set(), []

    def visit(name):
        assert name not in path, " -> ".join([*path[path.index(name) :], name])
        if name in done or name not in graph:
            return
        path.append(name)
        for other in sorted(graph[name]):
            visit(other)
        path.pop()
        done.add(name)

    for name in graph:
        visit(name)
    assert len(done) == len(graph)


def test_models_do_not_import_each_other():
    folders = {n.split(".")[1] for n in MODULES if n.startswith("models.") and n.count(".") >= 1} - {
        "declaration",
        "protocols",
        "resolve",
        "twins",
        "common_params",
        "_shared",
    }
    assert len(folders) >= 6
    for name, tree in MODULES.items():
        own = name.split(".")[1] if name.startswith("models.") else ""
        if name.split(".")[0] == "scratch_layers":
            # what users do with traced scratches needs more than values: flux, cones, profiles
            own = "scratch"
        for other in imports(tree):
            parts = other.split(".")
            if parts[0] == "models" and len(parts) > 1 and parts[1] in folders:
                assert parts[1] == own, f"{name} imports {other}; models are reached through the registry"


def test_nothing_below_the_command_line_prints():
    wrong = []
    for name, tree in MODULES.items():
        if name.split(".")[0] in {"cli", "commands"}:
            continue
        # modules that can be run with python -m may print from there
        runs = any(isinstance(n, ast.If) and "__main__" in ast.dump(n.test) for n in tree.body)
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print" and not runs:
                wrong.append(f"{name} prints in line {node.lineno}")
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            wrong += [f"{name} imports {n}" for n in names if n.split(".")[0] in {"click", "rich"}]
    assert not wrong


@pytest.mark.parametrize("name", MODULES)
def test_module_is_documented_and_short(name):
    tree = MODULES[name]
    assert ast.get_docstring(tree) or not tree.body, f"brdftab.{name} has no docstring"
    path = PACKAGE.joinpath(*name.split(".")) if name else PACKAGE
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    assert len(path.read_text().splitlines()) <= LONGEST, f"brdftab.{name} is too long; split it by idea"


# ---------------------------------------------------------------- what the command line loads

LOADED = """
import sys
before = set(sys.modules)
from brdftab.cli import main
main({words!r}, standalone_mode=False)
new = {{name.split(".")[0] for name in set(sys.modules) - before}}
print("LOADED", *sorted(new - set(sys.stdlib_module_names)), file=sys.stderr)
"""


@pytest.mark.parametrize(
    "words",
    [
        ["--help"], ["--version"], ["tabulate", "--help"], ["eval", "--help"], ["models"], ["models", "--json"],
        ["models", "vgroove-nonsym"], ["info", "--help"], ["compare", "--help"], ["verify", "--help"],
        ["bench", "--help"], ["check", "--help"], ["golden", "--help"], ["plan", "--help"], ["cache", "--help"],
        ["scratch", "--help"], ["scratch", "maps", "--help"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_light_commands_load_click_alone(words):
    code = LOADED.format(words=words)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stderr.split("LOADED")[1].split())
    assert loaded <= {"brdftab", "click", "colorama", "lazy_loader"}
    assert done.stdout


def test_import_loads_nothing_heavy():
    code = "import sys, brdftab; brdftab.list_models(); "
    code += "print(*{'numpy', 'numba', 'jax', 'OpenEXR', 'rich'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_public_names_exist_and_are_documented():
    import brdftab

    assert set(brdftab.__all__) >= {
        "evaluate",
        "tabulate",
        "albedo",
        "sample",
        "pdf",
        "read",
        "write",
        "models",
        "compare",
    }
    for name in brdftab.__all__:
        assert getattr(brdftab, name) is not None
        assert name.startswith("__") or getattr(brdftab, name).__doc__, name
    with pytest.raises(AttributeError, match="nonsense"):
        brdftab.nonsense  # noqa: B018  # the access itself is tested


# ---------------------------------------------------------------- the tree


def tree_files():
    """Return the project's text files."""
    tops = ["brdftab", "tests", "docs", "benchmarks", ".ci", ".github"]
    found = [p for top in tops for p in (ROOT / top).rglob("*") if p.is_file() and "__pycache__" not in p.parts]
    found += [p for p in ROOT.iterdir() if p.is_file() and p.name != ".coverage"]
    return [p for p in found if p.suffix not in {".exr", ".npz", ".png", ".nbi", ".nbc", ".pyc"}]


def test_no_machine_paths_in_the_tree():
    marks = [
        r"/wo" + r"rk/",
        r"/op" + r"t/venv",
        r"\.\./sha" + r"red",
        r"/tm" + r"p/\w",
        r"/ho" + r"me/\w",
        r"/ro" + r"ot/\w",
    ]
    pattern = re.compile(r"(?<![\w.])(?:" + "|".join(marks) + ")")
    files = tree_files()
    assert len(files) > 60
    wrong = [
        f"{p.relative_to(ROOT)}: {m.group()}" for p in files for m in pattern.finditer(p.read_text(errors="replace"))
    ]
    assert not wrong
