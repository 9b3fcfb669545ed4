"""A page of Debian's Chromium for the pictures of the documentation."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Of the packages chromium-headless-shell and chromium.
PROGRAMS = Path("/usr/bin/chromium-headless-shell"), Path("/usr/bin/chromium")
# Of a page: the machine may compile kernels first.
PATIENCE_MS = 600_000.0


@contextmanager
def browser(size: tuple[int, int]) -> Iterator[Any]:
    """A page of Chromium of this width and height, pixels."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        program = next((path for path in PROGRAMS if path.exists()), PROGRAMS[0])
        started = playwright.chromium.launch(executable_path=str(program), args=["--no-sandbox"])
        page = started.new_page(viewport={"width": size[0], "height": size[1]})
        page.set_default_timeout(PATIENCE_MS)
        yield page
        started.close()
