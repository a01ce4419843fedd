"""The pages that follow from the code itself: what imports what, and which Python names programs may rely on."""

from __future__ import annotations

import ast
import inspect
import tomllib
from pathlib import Path

import brdftab

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "brdftab"
NOTE = "<!-- written by docs/make.py; edit the sources instead -->"

ARCHITECTURE = f"""# The plan of the code

{NOTE}

A *model* declares its parameters once; its *kernel* (Numba) turns directions into numbers, its *twin* (JAX) does so
differentiably. *Tables* say where values lie and what came out, *tabulation* makes them with their error, *io* brings
data in and out, *fit* inverts, *scene* leaves out what is not needed, *validate*, *golden* and *bench* say how far to
trust it and what it cost. Words: [glossary.md](glossary.md).

Imports point downwards, those inside functions counted: a contract of import-linter in pyproject.toml, checked by the
tests, as that there are no circles. Kernels take floats and return floats; validation, units and shapes are settled
where the user enters. Nothing below `commands` prints. Outside `models/` no line knows a model's name, and what a
parameter means stands on its declaration."""

API = f"""# Names that programs may rely on

{NOTE}

Everything that `dir(brdftab)` shows. A name, a parameter or an exit status that disappears stands in the changelog.
Angles are radians, values 1/sr without cosine. What each call takes, returns and raises: `help(brdftab.tabulate)`.

Exit statuses of the command line: 0 success; 1 tables differ, a property fails, or it was interrupted; 2 an error, told
in one line."""

ROOMS = {
    "cli": "the Click group: loads a command when it is named, turns expected errors into one line",
    "commands": "one thin module a command, and what they print alike",
    "bench": "error against run time of every way to compute a model",
    "golden": "numbers that must not move: recorded, checked",
    "validate": "what must hold of every model, measured at its extremes; known limits",
    "fit": "data, starts, stages, verdict: parameters from measured tables, with standard errors",
    "scene": "plan, execute, check: tables of what a scene needs",
    "scratch_layers": "layers of scratches: maps, pictures, files",
    "plotting": "figures",
    "tabulation": "tables with their error: filling, cell averages, estimates, provenance",
    "io": "files in and out, by content; one module a format",
    "evaluation": "values of any model: points, bulk, samples, albedos",
    "tables": "what values lie on: axes, grids, tables, measurements, comparisons",
    "models": "one folder a model; `protocols.py` says what it provides, `_shared/` what several use",
    "materials": "complex indices, spectra, and how they become RGB",
    "quadrature": "Gauss rules",
    "directions": "angles, vectors, the half-vector frame",
    "timing": "a clock that stands still while compilers work",
    "jit": "Numba's decorators",
    "kernel_cache": "compiled kernels on disk, stamped with what they are made from",
    "system": "memory, machine, folders",
    "errors": "the errors that users see",
}


def _modules() -> dict[str, ast.Module]:
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = ast.parse(path.read_text())
    return found


def imports() -> dict[str, dict[str, int]]:
    """Return how many imports lead from each room to each other; those for type checkers are left out."""
    modules, found = _modules(), {}
    for name, tree in modules.items():
        queue, here = list(ast.iter_child_nodes(tree)), name.split(".")[0]
        while queue:
            node = queue.pop()
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
                continue
            queue += ast.iter_child_nodes(node)
            if not (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "brdftab"):
                continue
            for alias in node.names:
                there = f"{node.module}.{alias.name}".split(".")[1]
                if there in ROOMS and here in ROOMS and there != here:
                    found.setdefault(here, {}).setdefault(there, 0)
                    found[here][there] += 1
    return found


def architecture_page() -> str:
    """Return docs/architecture.md: layers, diagram and table of imports."""
    layers = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0]["layers"]
    rows = [[x.strip().removeprefix("brdftab.") for x in line.replace(":", "|").split("|")] for line in layers]
    edges = imports()
    lines = [
        *ARCHITECTURE.splitlines(),
        "",
        "```mermaid",
        "flowchart TD",
    ]
    shown = [[name for name in row if name in ROOMS and name != "errors"] for row in rows]
    for number, row in enumerate(shown):
        if row:
            lines.append(f'  subgraph L{number}[" "]')
            lines += [f"    {name}" for name in row]
            lines.append("  end")
    # an arrow to the nearest layers alone, for a picture that can be read
    level = {name: n for n, row in enumerate(shown) for name in row}
    for here, others in sorted(edges.items()):
        near = sorted((level[o] - level[here], o) for o in others if o in level and here in level)
        lines += [f"  {here} --> {other}" for gap, other in near if gap <= max(2, near[0][0])]
    lines += ["```", "", "| room | what it holds | imports from |", "| --- | --- | --- |"]
    for row in rows:
        for name in row:
            if name in ROOMS:
                told = ", ".join(f"{other} {count}" for other, count in sorted(edges.get(name, {}).items()))
                lines.append(f"| `{name}` | {ROOMS[name]} | {told or '-'} |")
    return "\n".join([*lines, ""])


def _entry(name: str, value: object) -> list[str]:
    """Return a public name with its signature and first line."""
    told = (inspect.getdoc(value) or "").split("\n\n")[0].replace("\n", " ")
    if inspect.ismodule(value):
        return [f"- module `{name}`: {told}"]
    if not callable(value):
        return [f"- `{name}`"]
    shown = str(inspect.signature(value)).replace(" -> None", "") if not inspect.isclass(value) else ""
    lines = [f"### {name}", "", "```text", f"{name}{shown}", "```", "", told, ""]
    if inspect.isclass(value):
        members = [m for m in dir(value) if not m.startswith("_")]
        fields = list(getattr(value, "__dataclass_fields__", {}))
        lines[2:6] = [f"Attributes and methods: {', '.join(f'`{m}`' for m in sorted({*members, *fields}))}.", ""]
    return lines


def api_page() -> str:
    """Return docs/api.md: every name of `brdftab` that programs may rely on."""
    public = {name: getattr(brdftab, name) for name in sorted(brdftab.__all__) if not name.startswith("__")}
    lines = [*API.splitlines(), ""]
    for name, value in public.items():
        lines += _entry(name, value)
    return "\n".join([*lines, ""]).replace("\n\n\n", "\n\n")
