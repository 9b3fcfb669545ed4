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
        """Write the commands with their whole summaries, below the names of their panels."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for name, command in self.commands.items():
            rows = panels.setdefault(getattr(command, "rich_help_panel", None) or "Commands", [])
            rows.append((name, command.get_short_help_str(WHOLE)))
        for panel, rows in panels.items():
            with formatter.section(panel):
                formatter.write_dl(rows)
