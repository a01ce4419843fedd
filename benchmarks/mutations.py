"""Mutation run: one token of a kernel is changed at a time, and the golden tables and tests must notice.

    python benchmarks/mutations.py --json mutants.jsonl              # 80 sites, seed 1; goes on where it was stopped
    python benchmarks/mutations.py --json mutants.jsonl --report     # only the table of what is there

Sites are constants and operators inside compiled functions, drawn with a seed, one module after the other, so that any
first part of the list spreads over all modules that hold kernels. Of a constant one of its first three significant
digits changes. Each mutant runs in a copy of the project against a ladder that ends with the first failure: some golden
values of the models that import the module, in plain Python, which needs no compiler; all golden values, compiled; the
models' cases, the test files that name the module, and the models' special tables. Models with the fewest kernels come
first, and compiled kernels that do not depend on the module are taken over.
"""

from __future__ import annotations

import argparse
import ast
import itertools
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path

from brdftab.kernel_cache import folder as kernel_folder

ROOT = Path(__file__).resolve().parents[1]
DECORATORS = {"kernel", "parallel_kernel"}
OPERATORS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.Lt: ("<", ">"), ast.Gt: (">", "<"), ast.LtE: ("<=", ">="), ast.GtE: (">=", "<="),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip
# longest that one rung of the ladder may take: a mutant that never ends is noticed
PATIENCE = 900
# of the rungs in plain Python, whose slow ones are left to the compiler
HASTE = 240
# pairs of directions that plain Python looks at: grazing, near the mirror side, anywhere, and near highlights
FEW = (1, 2, 3, 5, 7, 10, 15, 18)
EQUIVALENT: dict[tuple[str, str, str, str], str] = {
    (m["module"], m["line"], m["before"], m["after"]): m["why"]
    for m in tomllib.loads((ROOT / "benchmarks" / "equivalent_mutants.toml").read_text())["mutant"]
}


@dataclass(frozen=True)
class Site:
    """A token that can be changed."""

    module: str
    line: int
    column: int
    before: str
    after: str
    text: str


# ---------------------------------------------------------------- where


def compiled_functions(tree: ast.Module) -> list[ast.FunctionDef]:
    """Return the functions of a module that are compiled."""
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and any(isinstance(d, ast.Name) and d.id in DECORATORS for d in node.decorator_list)
    ]


def graph() -> dict[str, set[str]]:
    """Return the modules of the package, each with those that it imports."""
    files = {p.relative_to(ROOT).with_suffix(""): p for p in sorted((ROOT / "brdftab").rglob("*.py"))}
    names = {".".join(k.parts).removesuffix(".__init__"): p for k, p in files.items()}
    found = {}
    for name, path in names.items():
        mine = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                mine |= {a.name for a in node.names}
            elif isinstance(node, ast.ImportFrom):
                mine |= {node.module or "", *(f"{node.module}.{a.name}" for a in node.names)}
        found[name] = mine & set(names)
    return found


def reach(start: str, edges: dict[str, set[str]]) -> set[str]:
    """Return everything that can be reached from a module, itself included."""
    seen, queue = {start}, [start]
    while queue:
        for other in edges[queue.pop()] - seen:
            seen.add(other)
            queue.append(other)
    return seen


def path_of(module: str, root: Path = ROOT) -> Path:
    """Return the file of a module."""
    base = root.joinpath(*module.split("."))
    return base / "__init__.py" if base.is_dir() else base.with_suffix(".py")


def changed(node: ast.AST, lines: list[str], rng: random.Random) -> list[tuple[int, int, str, str]]:
    """Return the changes (line, column, before, after) that a node of the syntax tree offers."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        text = lines[node.lineno - 1][node.col_offset : node.end_col_offset]
        digits = [m.start() for m in re.finditer(r"\d", re.split("[eE]", text)[0])]
        while digits and text[digits[0]] == "0" and len(digits) > 1:
            digits.pop(0)
        at = rng.choice(digits[:3])
        other = rng.choice([d for d in "123456789" if d != text[at]])
        return [(node.lineno, node.col_offset, text, text[:at] + other + text[at + 1 :])]
    if isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare):
        if isinstance(node, ast.BinOp):
            parts, ops = [node.left, node.right], [node.op]
        elif isinstance(node, ast.BoolOp):
            parts, ops = node.values, [node.op] * (len(node.values) - 1)
        else:
            parts, ops = [node.left, *node.comparators], node.ops
        found = []
        for left, right, op in zip(parts, parts[1:], ops, strict=False):
            if type(op) not in OPERATORS or left.end_lineno != right.lineno:
                continue
            before, after = OPERATORS[type(op)]
            between = lines[left.end_lineno - 1][left.end_col_offset : right.col_offset]
            if between.count(before) == 1:
                found.append((left.end_lineno, left.end_col_offset + between.index(before), before, after))
        return found
    return []


def sites(rng: random.Random) -> dict[str, list[Site]]:
    """Return the sites of every module that holds kernels; those inside indices are left out, as no formula."""
    found: dict[str, list[Site]] = {}
    for module in sorted(graph()):
        source = path_of(module).read_text()
        lines = source.splitlines()
        mine = []
        for function in compiled_functions(ast.parse(source)):
            skipped = {id(n) for s in ast.walk(function) if isinstance(s, ast.Subscript) for n in ast.walk(s.slice)}
            for statement in function.body:
                for node in ast.walk(statement):
                    if id(node) not in skipped:
                        mine += [Site(module, *c, lines[c[0] - 1].strip()) for c in changed(node, lines, rng)]
        if mine:
            found[module] = mine
    return found


def drawn(count: int, seed: int) -> list[Site]:
    """Return so many sites: modules in random order, one site of each, then again."""
    rng = random.Random(seed)
    pools = sites(rng)
    for pool in pools.values():
        rng.shuffle(pool)
    chosen: list[Site] = []
    while len(chosen) < count and any(pools.values()):
        order = [m for m in pools if pools[m]]
        rng.shuffle(order)
        chosen += [pools[m].pop() for m in order]
    return chosen[:count]


# ---------------------------------------------------------------- the ladder


def ladder(module: str) -> list[list[str]]:
    """Return the commands that should notice a change of a module, most telling first."""
    edges = graph()
    folders = sorted(p.parent.name for p in (ROOT / "brdftab" / "models").glob("*/kernel.py"))
    users = []
    for folder in folders:
        own = {m for m in edges if m.startswith(f"brdftab.models.{folder}.") and ".twin" not in m}
        needed = set().union(*(reach(m, edges) for m in own))
        if module in needed:
            users.append((sum(bool(compiled_functions(ast.parse(path_of(m).read_text()))) for m in needed), folder))
    names = [folder.replace("_", "-") for _, folder in sorted(users)]
    python = sys.executable
    call = "from brdftab.cli import main; main()"
    check = [python, "-c", call, "golden", "check", "tests/golden", "--stop", "--only"]
    rungs = [[python, "benchmarks/mutations.py", "--plain", name] for name in names]
    rungs += [[*check, f"{name}.points.npz"] for name in names]
    listed = re.findall(r'file = "(\S+)"\nmodel = "(\S+)"', (ROOT / "tests/golden/tables.toml").read_text())
    tables = [[*check, file] for name in names for file, model in listed if model == name]
    test = [python, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    cases = [[*test, "tests/test_cases.py", "-k", f"api and ({' or '.join(names)})"]] if names else []
    last = module.rsplit(".", 1)
    telling = re.compile(rf"{re.escape(module)}\b|from {re.escape(last[0])} import [^\n]*\b{last[1]}\b")
    near = re.compile(rf"{re.escape(last[0])}\b")
    texts = {p: p.read_text() for p in sorted((ROOT / "tests").glob("test_*.py"))}
    ranked = sorted(texts, key=lambda p: (-len(telling.findall(texts[p])), -len(near.findall(texts[p]))))
    related = [p for p in ranked if telling.search(texts[p])][: 2 if names else 4]
    related = related or [p for p in ranked if near.search(texts[p])][: 1 if names else 4]
    return rungs + cases + [[*test, f"tests/{p.name}"] for p in related] + tables


def plain(model: str) -> int:
    """Compare some golden values of a model without the compiler; return how many differ."""
    from brdftab.golden.differences import relative
    from brdftab.golden.points import SUFFIX, read_points
    from brdftab.golden.quantities import components, pdf
    from brdftab.models.resolve import resolve

    head, held = read_points(ROOT / "tests" / "golden" / f"{model}{SUFFIX}")
    differing = 0
    for golden in held:
        setup, some = resolve(model, **golden.parameters), list(FEW)
        at = golden.directions[:, some].copy()
        for name, function in (("components", components), ("pdf", pdf)):
            whole = golden.quantities[name]
            atol = head["atol_part"] * float(abs(whole).max(initial=0.0))
            now = function(setup, at, golden.tolerance)
            differing += int((relative(whole[some], now, atol) > head["rtol"]).sum())
    return differing


class Copy:
    """A copy of the project in which one file at a time is spoilt."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "project"
        self.base = folder / "kernels"
        self.known: dict[str, bool] = {}
        self.base.mkdir()
        shutil.copytree(ROOT, self.root, ignore=shutil.ignore_patterns(".git", "__pycache__", "*.pyc", ".*cache"))

    def run(self, words: list[str], kernels: Path) -> bool:
        """Run a rung; return whether it passes."""
        haste = "--plain" in words
        environment = {
            **os.environ, "PYTHONPATH": str(self.root), "NUMBA_CACHE_DIR": str(kernels), "PYTHONDONTWRITEBYTECODE": "1",
        }  # fmt: skip
        if haste:
            environment["NUMBA_DISABLE_JIT"] = "1"
        limit = HASTE if haste else PATIENCE
        try:
            return not subprocess.run(
                words, cwd=self.root, env=environment, capture_output=True, timeout=limit
            ).returncode
        except subprocess.TimeoutExpired:
            return False

    def passes_unspoilt(self, words: list[str]) -> bool:
        """Tell whether a rung passes on the sources as they are; compiles what it needs."""
        key = " ".join(words)
        if key not in self.known:
            self.known[key] = self.run(words, self.base)
        return self.known[key]

    def take_over_kernels(self) -> None:
        """Start from what the project itself has compiled: a copy's kernels lie in a folder named by its path."""
        if kernel_folder().is_dir():
            shutil.copytree(kernel_folder(), self.base / kernel_folder(self.root / "brdftab").name)

    def kernels_of_mutant(self) -> Path:
        """Return a copy of the compiled kernels, as links; those that a mutant changes are compiled anew into it."""
        made = self.base.with_name("kernels-of-mutant")
        shutil.rmtree(made, ignore_errors=True)
        shutil.copytree(self.base, made, copy_function=os.link)
        return made

    def verdict(self, site: Site, quick: bool) -> dict[str, object]:
        """Spoil one token, climb the ladder until something notices, mend it, and say what noticed.

        `quick` climbs no further than plain Python. Only a rung that passes on the unspoilt sources counts; `broken` is
        the number of those that do not.
        """
        started = time.perf_counter()
        path = path_of(site.module, self.root)
        text, stamp = path.read_text(), path.stat()
        lines = text.splitlines(keepends=True)
        line = lines[site.line - 1]
        if not line[site.column :].startswith(site.before):
            raise SystemExit(f"{site.module}:{site.line} does not hold {site.before} there")
        lines[site.line - 1] = line[: site.column] + site.after + line[site.column + len(site.before) :]
        kernels = self.kernels_of_mutant()
        noticed, broken = "", 0
        for words in ladder(site.module):
            if quick and "--plain" not in words:
                break
            # what plain Python cannot do in time is asked of compiled kernels alone
            if "--plain" in words and not self.passes_unspoilt(words):
                continue
            path.write_text("".join(lines))
            try:
                passes = self.run(words, kernels)
            finally:
                path.write_text(text)
                os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
            if not passes and self.passes_unspoilt(words):
                noticed = words[-1] if words[-1].endswith((".npz", ".exr", ".py")) else " ".join(words[-2:])
                break
            broken += not passes
        seconds = round(time.perf_counter() - started, 1)
        return {**asdict(site), "caught": bool(noticed), "by": noticed, "broken": broken, "seconds": seconds}


# ---------------------------------------------------------------- the account


def report(results: list[dict[str, object]]) -> None:
    """Print what was caught, and every mutant that was not."""
    rest = [r for r in results if not r["caught"]]
    proved = {id(r): EQUIVALENT.get((r["module"], r["text"], r["before"], r["after"])) for r in rest}
    count = len(results) - sum(p is not None for p in proved.values())
    caught = len(results) - len(rest)
    print(f"{len(results)} mutants in {len({r['module'] for r in results})} modules: {caught} caught", end="")
    print(f", {len(results) - count} proved equivalent, {count - caught} not caught: {caught / max(count, 1):.1%}")
    for r in rest:
        print(f"  {r['module']}:{r['line']}  {r['before']} -> {r['after']}  in  {r['text']}")
        print(f"    {proved[id(r)] or 'NOT CAUGHT'}")


def main() -> None:
    """Run what is not in the file yet, and report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sites", type=int, default=80, help="how many [default: 80]")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draw [default: 1]")
    parser.add_argument(
        "--json", type=Path, default=Path("mutants.jsonl"), help="file of results, a line each; appended"
    )
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no mutant after so long")
    parser.add_argument("--module", default="", help="only modules in whose name this regular expression is found")
    parser.add_argument("--report", action="store_true", help="run nothing")
    parser.add_argument("--plain", metavar="MODEL", help="only compare a model's values without the compiler")
    options = parser.parse_args()
    if options.plain:
        raise SystemExit(min(plain(options.plain), 1))
    started = time.perf_counter()
    results = [json.loads(line) for line in options.json.read_text().splitlines()] if options.json.exists() else []
    done = {(r["module"], r["line"], r["column"], r["after"]) for r in results}
    if not options.report:
        with tempfile.TemporaryDirectory() as folder:
            copy = Copy(Path(folder))
            copy.take_over_kernels()
            for quick, site in itertools.product((True, False), drawn(options.sites, options.seed)):
                known = (site.module, site.line, site.column, site.after) in done
                if known or not re.search(options.module, site.module):
                    continue
                if time.perf_counter() - started > 60.0 * options.minutes:
                    break
                found = copy.verdict(site, quick)
                if quick and not found["caught"]:
                    # the second round, with the whole ladder, decides
                    continue
                done.add((site.module, site.line, site.column, site.after))
                results.append(found)
                with options.json.open("a") as file:
                    file.write(json.dumps(found) + "\n")
                print(
                    f"{site.module}:{site.line} {site.before} -> {site.after}: {found['by'] or 'NOT CAUGHT'}",
                    flush=True,
                )
    report(results)


if __name__ == "__main__":
    main()
