# Short names for what developers run; everything works without just.

default:
    @just --list

# what CI runs, in a virtual environment of its own
ci:
    .ci/run

test *args:
    python -m pytest -q {{args}}

lint:
    ruff check .
    ruff format --check .
    mypy

format:
    ruff check --fix .
    ruff format .

# write docs/cli.md and docs/models.md anew
docs:
    python docs/make.py

# tabulate the golden tables anew; look at the differences before you commit them
golden:
    python tests/golden/make.py

verify:
    brdftab verify tests/golden/*.exr tests/golden/*.npz

bench:
    python benchmarks/vgroove_nonsym_tables.py
    python benchmarks/vgroove_sym_tables.py
    python benchmarks/smith_vs_mitsuba.py
