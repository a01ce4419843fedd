"""What programs hold on to: public names, parameters, exit statuses disappear only with a word in CHANGELOG.md."""

import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import brdftab

ROOT = Path(__file__).resolve().parents[1]
KNOWN = Path(__file__).with_name("api.json")
STATUSES = {"success": 0, "differs": 1, "error": 2}


def public():
    """Return each public name with its parameters, or with the public attributes of a class."""
    found = {}
    for name in sorted(brdftab.__all__):
        value = getattr(brdftab, name)
        if inspect.isclass(value):
            fields = set(getattr(value, "__dataclass_fields__", {}))
            found[name] = sorted({m for m in dir(value) if not m.startswith("_")} | fields)
        elif callable(value):
            found[name] = list(inspect.signature(value).parameters)
        else:
            found[name] = []
    return found


def gone(old, new):
    """Return what was there and is no more, as ``name`` or ``name.part``."""
    lost = [name for name in old if name not in new]
    return lost + [f"{name}.{part}" for name in old if name in new for part in old[name] if part not in new[name]]


def test_nothing_disappears_without_a_word():
    text = (ROOT / "CHANGELOG.md").read_text()
    told = set(re.findall(r"Removed: `([\w.]+)`", text))
    lost = gone(json.loads(KNOWN.read_text()), public())
    assert set(lost) <= told, f"{', '.join(lost)}: say Removed: `name` in CHANGELOG.md, then python {__file__}"


def test_what_is_new_is_recorded():
    fresh = gone(public(), json.loads(KNOWN.read_text()))
    assert fresh == [], f"{', '.join(fresh)}: run python {__file__}"


def test_a_loss_is_found():
    assert gone({"a": ["x", "y"], "b": []}, {"a": ["y"]}) == ["b", "a.x"]


def test_dir_stub_and_docs_agree():
    stub = (ROOT / "brdftab" / "__init__.pyi").read_text()
    names = set(re.findall(r" as (\w+)$", stub, re.M))
    assert names == set(brdftab.__all__) == set(dir(brdftab))
    page = (ROOT / "docs" / "api.md").read_text()
    for name in names - {"__version__"}:
        assert re.search(rf"^(### {name}$|- module `{name}`)", page, re.M), name


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["models"], STATUSES["success"]),
        (["eval", "--model", "nonesuch", "--theta-i", "0", "--theta-o", "0", "--phi", "0"], STATUSES["error"]),
        (["compare", "a.npz", "b.npz"], STATUSES["differs"]),
    ],
    ids=["success", "error", "differs"],
)
def test_exit_statuses_are_kept(words, status, tmp_path):
    for name, kd in (("a.npz", 0.2), ("b.npz", 0.3)):
        brdftab.write(brdftab.tabulate("lambert", "2x2x2", kd=kd), tmp_path / name)
    done = subprocess.run([sys.executable, "-m", "brdftab", *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == status


USER = """
import numpy as np

import brdftab

table = brdftab.tabulate("smith", "4x4x8", alpha=0.3)
values: np.ndarray = np.asarray(table.values)
f = brdftab.evaluate("smith", 0.3, 0.4, 2.0)
result = brdftab.fit_model(table, "smith+lambert", "alpha,kd")
best = brdftab.rank_models(table, ["smith", "lambert"])[0]
print(values.shape, f, result.values["alpha"], best.model, [m.name for m in brdftab.list_models()])
brdftab.write(table, "a.npz", overwrite=True)
reveal_type(brdftab.read("a.npz"))
"""


def test_a_users_lines_pass_the_strict_type_checker(tmp_path):
    """The stub and py.typed ship: what a user writes is checked, and a wrong argument is found."""
    (tmp_path / "user.py").write_text(USER)
    # as installed, not as mypy's own configuration of this project
    call = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--follow-imports=silent", "user.py"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert "Table" in done.stdout
    (tmp_path / "user.py").write_text('import brdftab\n\nbrdftab.tabulate("smith", grid=3.0)\n')
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True)
    assert 'incompatible type "float"' in done.stdout


if __name__ == "__main__":
    KNOWN.write_text(json.dumps(public(), indent=1) + "\n")
