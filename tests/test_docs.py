"""README and docs: Python blocks run, commands run or say why not, generated pages are fresh, links lead somewhere."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import brdftab
from brdftab.cli import main

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "THIRD_PARTY.md", ROOT / "benchmarks" / "README.md"]
PAGES += sorted((ROOT / "docs").glob("*.md"))
# pages whose commands are not run here
NOT_RUN = {
    "docs/cli.md": "generated from the help, whose examples test_cli.py parses; some take a minute",
    "benchmarks/README.md": "benchmarks take minutes",
    "docs/adding-a-model.md": "test_adding_a_model.py builds its package",
}


def name(page):
    return str(page.relative_to(ROOT))


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.S | re.M)


def section(page, title):
    found = re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", page.read_text(), re.S | re.M)
    assert found, title
    return found.group(1)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with the table that the pages on files talk of."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=name)
def test_python_blocks_run(page, folder):
    if name(page) == "docs/adding-a-model.md":
        pytest.skip(NOT_RUN[name(page)])
    if name(page) == "docs/file-format.md":
        table = brdftab.tabulate("vgroove-sym", "3x3x4", components=True, max_bounces=2, dtype="float64")
        brdftab.write(table, "table.exr")
        brdftab.write(table, "table.npz")
    namespace = {"__name__": "docs"}
    for number, block in enumerate(blocks(page, "python")):
        exec(compile(block, f"{name(page)} block {number}", "exec"), namespace)
    assert namespace


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "bash")], ids=name)
def test_commands_run(page, folder):
    if name(page) in NOT_RUN:
        pytest.skip(NOT_RUN[name(page)])
    text = page.read_text()
    if name(page) == "README.md":
        # these two blocks are what a stranger runs on a fresh machine; CI runs the second
        text = text.replace(section(page, "Two commands"), "")
    for file, body in re.findall(r"^```toml\n# (\S+\.toml)\n(.*?)^```", text, re.S | re.M):
        Path(file).write_text(body)
    ran = 0
    for block in re.findall(r"^```bash\n(.*?)^```", text, re.S | re.M):
        for line in block.splitlines():
            if line.startswith("brdftab "):
                result = CliRunner().invoke(main, shlex.split(line)[1:])
                assert result.exit_code == 0, f"{line}: {result.stderr}"
                ran += 1
    assert ran


def test_two_commands_of_the_readme():
    found = re.findall(r"```(?:bash|sh|console)\n(.*?)```", section(ROOT / "README.md", "Two commands"), re.S)
    assert len(found) == 2
    assert found[0].startswith("python -m pip install")
    assert "brdftab tabulate --model vgroove-nonsym" in found[0]
    ci = (ROOT / ".ci" / "run").read_text()
    for line in found[1].splitlines():
        assert line in ci, f"CI does not run {line}"


def test_generated_pages_are_fresh():
    done = subprocess.run([sys.executable, ROOT / "docs" / "make.py", "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def slug(title):
    return re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if target.startswith(("http://", "https://")):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{name(page)}: {target}"
        if anchor:
            assert anchor in {slug(t) for t in re.findall(r"^#+ (.*)$", file.read_text(), re.M)}, (
                f"{name(page)}: {target}"
            )


def test_every_page_is_in_the_index():
    index = (ROOT / "docs" / "index.md").read_text()
    for page in (ROOT / "docs").glob("*.md"):
        assert page.name == "index.md" or f"({page.name})" in index, page.name


def test_every_benchmark_and_test_named_exists():
    for page in PAGES:
        for path in re.findall(r"(?:tests|benchmarks|docs)/\w+\.(?:py|md)", page.read_text()):
            assert (ROOT / path).exists(), f"{name(page)}: {path}"
    readme = (ROOT / "benchmarks" / "README.md").read_text()
    for script in (ROOT / "benchmarks").glob("*.py"):
        assert script.name in readme or f"benchmarks.{script.stem}" in readme, script.name


def test_ci_runs_the_same_script_everywhere():
    assert ".ci/run" in (ROOT / ".github" / "workflows" / "ci.yml").read_text()
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o100


def test_version_and_licence_agree():
    assert f"## {brdftab.__version__}" in (ROOT / "CHANGELOG.md").read_text()
    assert "BSD 3-Clause" in (ROOT / "LICENSE").read_text()
