"""Tables of the pages from the code: most stand in the pages (`make tables`), one is made by Sphinx."""

import re
from collections.abc import Callable
from typing import Any

from .command_line import commands
from .dispersion import dispersion
from .dissertation import dissertation
from .export_formats import export_formats
from .head_to_head import head_to_head, head_to_head_code
from .reconstruction_settings import reconstruction_settings
from .rest import records, routes
from .scan_limits import scan_limits
from .scan_readers import scan_readers
from .scoreboard import scoreboard
from .service_settings import settings_table
from .sizing import measured_sizing, sizing

# A page holds one of these between comments on lines of their own: <!-- from the code: commands --> and
# <!-- end: commands -->. `make tables` writes what is between them, and a test compares it.
PARTS: dict[str, Callable[[], str]] = {
    "commands": commands,
    "routes": routes,
    "records": records,
    "dispersion": dispersion,
    "export formats": export_formats,
    "head to head": head_to_head,
    "head to head code": head_to_head_code,
    "scan limits": scan_limits,
    "scan readers": scan_readers,
    "scoreboard": scoreboard,
    "sizing": sizing,
    "measured sizing": measured_sizing,
    "service settings": settings_table,
    "reconstruction settings": reconstruction_settings,
}
# Of megabytes, so it is made when the pages are built: <!-- from the code: dissertation -->
BUILT = {"dissertation": dissertation}
# Docstrings write absolute values between bars, which reStructuredText reads as substitutions.
BARS = re.compile(r"``[^`]*``|\|")
MARK = re.compile(r"^<!-- from the code: ([a-z ]+) -->$(?:.*?^<!-- end: \1 -->$)?", re.MULTILINE | re.DOTALL)


def filled(text: str) -> str:
    """The text of a page with the parts of ``PARTS`` as the code has them now.

    Raises:
        KeyError: for an unknown part.
    """

    def part(mark: re.Match[str]) -> str:
        name = mark[1]
        if name in BUILT:
            return mark[0]
        return f"<!-- from the code: {name} -->\n{PARTS[name]()}\n<!-- end: {name} -->"

    return MARK.sub(part, text)


def setup(app: Any) -> dict[str, bool]:
    """Register the extension: fill in what is built, and escape bars in docstrings."""

    def fill(app: Any, page: str, source: list[str]) -> None:
        source[0] = MARK.sub(lambda mark: BUILT[mark[1]]() if mark[1] in BUILT else mark[0], source[0])

    def keep_bars(app: Any, what: str, name: str, one: Any, options: Any, lines: list[str]) -> None:
        lines[:] = [BARS.sub(lambda found: "\\|" if found[0] == "|" else found[0], line) for line in lines]

    app.connect("source-read", fill)
    app.connect("autodoc-process-docstring", keep_bars)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
