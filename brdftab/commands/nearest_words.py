"""Commands and choices that propose the nearest word where one is mistyped."""

from __future__ import annotations

from typing import Any

import click

from brdftab.errors import proposal


def _near(word: str, known: list[str]) -> str:
    return proposal(word, known).rstrip().replace("did you", "Did you")


class Group(click.Group):
    """A group of commands that proposes the nearest one."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first word names."""
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            told = f"No such command {args[0]!r}. {_near(args[0], self.list_commands(ctx))}"
            raise click.UsageError(told.rstrip(), ctx)
        return super().resolve_command(ctx, args)


class Choice(click.Choice):  # type: ignore[type-arg]  # generic from click 8.2 on
    """One of some words; a mistyped one gets the nearest proposed."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the word, or fail with the nearest."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            near = _near(str(value), [str(choice) for choice in self.choices])
            self.fail(f"{error.message.rstrip('.')}. {near}".rstrip(), param, ctx)
