"""A Sphinx extension: fills the reference pages with what the code itself says."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from .command_line import commands
from .dispersion import dispersion
from .rest import addresses, records
from .scan_limits import scan_limits
from .service_settings import settings_table

# A page asks for one of these by a comment on a line of its own: <!-- from the code: commands -->
PARTS: dict[str, Callable[[], str]] = {
    "commands": commands,
    "addresses": addresses,
    "records": records,
    "dispersion": dispersion,
    "scan limits": scan_limits,
    "service settings": settings_table,
}
# Between bars a docstring has an absolute value, reStructuredText a substitution.
BARS = re.compile(r"``[^`]*``|\|")
ASKED = re.compile(r"^<!-- from the code: ([a-z ]+) -->$", re.MULTILINE)


def filled(text: str) -> str:
    """The text of a page with every part that it asks for.

    Raises:
        KeyError: for a part that is not there.
    """
    return ASKED.sub(lambda asked: PARTS[asked[1]](), text)


def setup(app: Any) -> dict[str, bool]:
    """Let Sphinx fill the pages as it reads them, and leave bars in docstrings as they are."""

    def fill(app: Any, page: str, source: list[str]) -> None:
        source[0] = filled(source[0])

    def keep_bars(app: Any, what: str, name: str, one: Any, options: Any, lines: list[str]) -> None:
        lines[:] = [BARS.sub(lambda found: "\\|" if found[0] == "|" else found[0], line) for line in lines]

    app.connect("source-read", fill)
    app.connect("autodoc-process-docstring", keep_bars)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
