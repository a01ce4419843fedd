"""``python -m brdftab``: the command line."""

from brdftab.cli import main

if __name__ == "__main__":
    main(prog_name="brdftab")
