"""Write the pages that follow from the command line, the registry, the known limits, the imports and the public names.

python docs/make.py           # write all
python docs/make.py --check   # exit 1 if one is out of date
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import click
import structure

from brdftab.cli import main as group
from brdftab.commands.options import declared
from brdftab.materials import indices
from brdftab.models import names, spec
from brdftab.models.declaration import Param
from brdftab.validate import limits, properties

HERE = Path(__file__).parent
NOTE = "<!-- written by docs/make.py; edit the sources instead -->"

CLI_HEAD = f"""# Command line

{NOTE}

Angles are degrees. Every command has `--help`; all take `--json` for output that a program reads. Results go to
standard output, everything else to standard error.

Exit status: 0 success; 1 tables differ (`compare`, `verify`), a property fails (`check`) or it was interrupted;
2 an error, told in one line.

## Parameters of the models

Options of `tabulate` and `eval`; which model takes which, and with what default, is in [models.md](models.md).

| option | value | meaning |
| --- | --- | --- |"""


def cell(text: str) -> str:
    """Return text that cannot break a table."""
    return " ".join(text.split()).replace("|", "\\|")


def example_lines(command: click.Command) -> list[str]:
    """Return the examples of a command's help."""
    return [line.strip() for line in (command.epilog or "").splitlines() if line.strip().startswith("brdftab ")]


def option_rows(command: click.Command) -> list[tuple[str, str, str]]:
    """Return option, value and text of every option of a command."""
    rows = []
    for param in command.params:
        if not isinstance(param, click.Option):
            continue
        kind = param.type
        value = "" if param.is_flag else param.metavar or getattr(kind, "name", "text")
        if isinstance(kind, click.Choice):
            value = " | ".join(kind.choices)
        text = (param.help or "") + (" Required." if param.required else "")
        rows.append((", ".join(f"`{o}`" for o in param.opts), value, text))
    return rows


def section(name: str, command: click.Command, shared: list[tuple[str, str, str]]) -> list[str]:
    """Return the lines of one command."""
    arguments = [p for p in command.params if isinstance(p, click.Argument)]
    words = " ".join(p.make_metavar(click.Context(command)) for p in arguments)
    lines = [f"## brdftab {name}", "", " ".join((command.help or "").split()), ""]
    lines += ["```text", f"brdftab {name} [OPTIONS]{' ' + words if words else ''}", "```", ""]
    lines += [
        "Examples:" if len(example_lines(command)) > 1 else "Example:",
        "",
        "```bash",
        *example_lines(command),
        "```",
        "",
    ]
    rows = option_rows(command)
    own = [row for row in rows if row not in shared]
    if len(own) < len(rows):
        lines += ["Takes the [parameters of the model](#parameters-of-the-models) and:", ""]
    lines += ["| option | value | meaning |", "| --- | --- | --- |"]
    lines += [f"| {option} | {cell(value)} | {cell(text)} |" for option, value, text in own]
    return [*lines, ""]


def all_commands(parent: click.Group, prefix: str = "") -> dict[str, click.Command]:
    """Return every command by its words; a group's own commands take its place."""
    context = click.Context(parent)
    found: dict[str, click.Command] = {}
    for name in parent.list_commands(context):
        command = parent.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            found |= all_commands(command, f"{prefix}{name} ")
        else:
            found[f"{prefix}{name}"] = command
    return found


def cli_page() -> str:
    """Return docs/cli.md."""
    commands = all_commands(group)
    lines = CLI_HEAD.splitlines()
    tabulate = commands["tabulate"]
    shared = [row for row in option_rows(tabulate) if row[0].strip("`-").replace("-", "_") in declared()]
    lines += [f"| {option} | {cell(value)} | {cell(text)} |" for option, value, text in shared]
    lines.append("")
    for name, command in commands.items():
        lines += section(name, command, shared)
    return "\n".join(lines).rstrip() + "\n"


def shown(param: Param) -> tuple[str, str]:
    """Return default and bounds of a parameter in the command line's units."""
    turn = math.degrees if param.unit == "rad" else (lambda x: x)
    unit = " degrees" if param.unit == "rad" else f" {param.unit}".rstrip()
    default = param.default
    text = "" if default is None else default if isinstance(default, str) else f"{turn(default):g}{unit}"
    choices = ("mirror", *indices.names()) if param.name == "material" else param.choices
    if choices:
        return text, ", ".join(f"`{word}`" for word in choices)
    low, high = param.bounds or (-math.inf, math.inf)
    return text, f"[{turn(low):g}, {turn(high):g}]{unit}"


def models_page() -> str:
    """Return docs/models.md."""
    lines = ["# Models", "", NOTE, "", "| model | what it is |", "| --- | --- |"]
    lines += [f"| [`{name}`](#{name}) | {cell(spec(name).summary)} |" for name in names()]
    lines += ["", "Angles are degrees here and on the command line, radians in Python.", ""]
    for name in names():
        model = spec(name)
        layers = (
            "`order1`, `order2`, ..."
            if model.components == ("order",)
            else ", ".join(f"`{c}`" for c in model.components)
        )
        lines += [f"## {name}", "", f"{model.title}: {model.summary}.", "", f"- Variant: {model.variant}"]
        if model.errata:
            lines.append(f"- Errata: {model.errata}")
        link = f" [doi:{model.doi}](https://doi.org/{model.doi})" if model.doi else ""
        lines += [f"- Source: {model.citation}.{link}", f"- Components: {layers}"]
        if model.singular:
            lines.append(
                "- Infinite at the mirror direction itself; the cells of a table that hold it store their average."
            )
        lines += ["", "| parameter | meaning | default | range |", "| --- | --- | --- | --- |"]
        for param in model.params:
            default, bounds = shown(param)
            lines.append(f"| `{param.name}` | {cell(param.doc)} | {cell(default)} | {cell(bounds)} |")
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


LIMITS_HEAD = f"""# Known limits

{NOTE}

What [`brdftab check`](check.md) measures and does not count as a failure. The table is tested: each entry is measured
again at its example by every check, and fails where it no longer occurs or is less than a third of the stated size.

| model | property | limit | size | why it is left so | where | example |
| --- | --- | --- | --- | --- | --- | --- |"""


def words(values: dict[str, object]) -> str:
    """Return parameters as ``name = value``, ranges as ``low to high``."""
    shown = {k: f"{v[0]:g} to {v[1]:g}" if isinstance(v, list) and len(v) == 2 else v for k, v in values.items()}
    return ", ".join(f"`{k}` = {v:.4g}" if isinstance(v, float) else f"`{k}` = {v}" for k, v in shown.items())


def limits_page() -> str:
    """Return docs/limits.md."""
    lines = LIMITS_HEAD.splitlines()
    for known in sorted(limits.limits(), key=lambda one: (one.model, one.prop, one.name)):
        row = (
            f"[`{known.model}`](models.md#{known.model})", f"`{known.prop}`", known.name, f"{known.size:g}", known.why,
            words(known.where) or "anywhere", words(known.example["parameters"]) or "default",
        )  # fmt: skip
        lines.append("| " + " | ".join(cell(text) for text in row) + " |")
    lines += ["", "Sizes are in the units of the property:", ""]
    used = sorted({known.prop for known in limits.limits()})
    lines += [f"- `{name}`: {properties.module(name).MEANING}." for name in used]
    return "\n".join(lines).rstrip() + "\n"


PAGES = {
    "cli.md": cli_page,
    "models.md": models_page,
    "limits.md": limits_page,
    "architecture.md": structure.architecture_page,
    "api.md": structure.api_page,
}


def main() -> int:
    """Write the pages, or tell which are out of date."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args().check
    stale = []
    for name, page in PAGES.items():
        path, text = HERE / name, page()
        if check and (not path.exists() or path.read_text(encoding="utf-8") != text):
            stale.append(name)
        elif not check:
            path.write_text(text, encoding="utf-8")
    if stale:
        print(f"out of date: {', '.join(stale)}; run python docs/make.py", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
