"""Groups of commands whose help is plain: no summary is cut to one line, and no example is broken."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

# Longer than every summary: it is never cut.
WHOLE = 1_000


class CommandList(TyperGroup):
    """A group of commands; its help and theirs can be read and copied on a terminal of 80 columns."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        for command in self.commands.values():
            if command.help is not None:
                # After \b lines stay as they are; else they are broken at hyphens, within options too.
                command.help = command.help.replace("\n\nExample:", "\n\n\b\nExample:")

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands with their whole summaries."""
        found = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [(name, one.get_short_help_str(WHOLE)) for name, one in found if one is not None]
        with formatter.section("Commands"):
            formatter.write_dl(rows)
