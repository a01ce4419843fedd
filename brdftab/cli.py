"""The command line: one thin function a command; everything heavy is imported inside."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from typing import Any

import click

from brdftab._version import __version__
from brdftab.commands.interrupt import ABORTED, answered
from brdftab.commands.nearest_words import Group
from brdftab.errors import BrdftabError

_COMMANDS = {
    "albedo": "brdftab.commands.albedo:albedo",
    "bench": "brdftab.commands.bench:bench",
    "cache": "brdftab.commands.scene:cache",
    "check": "brdftab.commands.check:check",
    "compare": "brdftab.commands.files:compare",
    "eval": "brdftab.commands.evaluation:evaluate",
    "fit": "brdftab.commands.fit:fit",
    "golden": "brdftab.commands.golden:golden",
    "info": "brdftab.commands.files:info",
    "models": "brdftab.commands.models:models",
    "plan": "brdftab.commands.scene:plan",
    "scratch": "brdftab.commands.scratch:scratch",
    "tabulate": "brdftab.commands.tabulate:tabulate",
    "verify": "brdftab.commands.files:verify",
}


class _Group(Group):
    """Loads a command's module when it is named, and turns expected errors into one line and exit status 2."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        module, name = _COMMANDS[cmd_name].split(":")
        return getattr(importlib.import_module(module), name)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; bad input ends in one line on stderr."""
        warnings.formatwarning = lambda message, *rest, **more: f"Warning: {message}\n"
        # names of files need not be text of this terminal's
        for stream in (sys.stdout, sys.stderr):
            if getattr(stream, "errors", None) == "strict" and hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="backslashreplace")
        try:
            with answered():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            click.echo("Aborted", err=True)
            ctx.exit(ABORTED)
        except click.exceptions.NoArgsIsHelpError:
            raise
        except click.UsageError as error:
            path = error.ctx.command_path if error.ctx else ctx.command_path
            message = " ".join(error.format_message().split()).rstrip(".")
            end = "" if message.endswith("?") else "."
            click.echo(f"Error: {message}{end} See {path} --help.", err=True)
            ctx.exit(2)
        except BrdftabError as error:
            message = " ".join(str(error).split())
            click.echo(f"Error: {message}", err=True)
            ctx.exit(2)
        except MemoryError:
            click.echo("Error: the table does not fit into memory; ask for a smaller --grid or float32", err=True)
            ctx.exit(2)
        except BrokenPipeError:
            # the reader of our output went away: nothing is left to tell it
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(1)


@click.group(
    cls=_Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="\b\nExample:\n  brdftab tabulate --model vgroove-nonsym --out gold.exr --out gold.npz",
)
@click.version_option(__version__, prog_name="brdftab")
def main() -> None:
    """Tabulate, compare and check BRDF models: right to many digits, with the error and the cost stated."""
