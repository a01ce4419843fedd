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

# write the golden tables anew; look at the differences before you commit them
golden *args:
    brdftab golden record tests/golden --overwrite {{args}}

verify:
    brdftab golden check tests/golden

bench:
    python benchmarks/vgroove_nonsym_tables.py
    python benchmarks/vgroove_sym_tables.py
    python benchmarks/smith_vs_mitsuba.py
