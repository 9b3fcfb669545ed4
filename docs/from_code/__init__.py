"""Sphinx extension: generates tables of the reference pages from the code."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from .command_line import commands
from .dispersion import dispersion
from .dissertation import dissertation
from .export_formats import export_formats
from .reconstruction_settings import reconstruction_settings
from .rest import records, routes
from .scan_limits import scan_limits
from .scan_readers import scan_readers
from .scoreboard import scoreboard
from .service_settings import settings_table
from .sizing import measured_sizing, sizing

# A page includes one of these by a comment on its own line: <!-- from the code: commands -->
PARTS: dict[str, Callable[[], str]] = {
    "commands": commands,
    "routes": routes,
    "records": records,
    "dispersion": dispersion,
    "dissertation": dissertation,
    "export formats": export_formats,
    "scan limits": scan_limits,
    "scan readers": scan_readers,
    "scoreboard": scoreboard,
    "sizing": sizing,
    "measured sizing": measured_sizing,
    "service settings": settings_table,
    "reconstruction settings": reconstruction_settings,
}
# Docstrings write absolute values between bars, which reStructuredText reads as substitutions.
BARS = re.compile(r"``[^`]*``|\|")
MARK = re.compile(r"^<!-- from the code: ([a-z ]+) -->$", re.MULTILINE)


def filled(text: str) -> str:
    """The text of a page with every mark replaced by its generated part.

    Raises:
        KeyError: for an unknown part.
    """
    return MARK.sub(lambda mark: PARTS[mark[1]](), text)


def setup(app: Any) -> dict[str, bool]:
    """Register the extension: fill pages when they are read, and escape bars in docstrings."""

    def fill(app: Any, page: str, source: list[str]) -> None:
        source[0] = filled(source[0])

    def keep_bars(app: Any, what: str, name: str, one: Any, options: Any, lines: list[str]) -> None:
        lines[:] = [BARS.sub(lambda found: "\\|" if found[0] == "|" else found[0], line) for line in lines]

    app.connect("source-read", fill)
    app.connect("autodoc-process-docstring", keep_bars)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
