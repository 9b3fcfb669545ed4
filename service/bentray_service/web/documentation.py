"""The documentation at /documentation: built pages of a wheel, or of a checkout after `make docs`."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from starlette.staticfiles import StaticFiles

from .documents import document

PACKAGED = Path(__file__).parent / "built_documentation"
CHECKOUT = Path(__file__).resolve().parents[3]


@cache
def documentation_files() -> StaticFiles | None:
    """The built pages, or None where there are none."""
    places = [PACKAGED]
    if (CHECKOUT / "docs" / "conf.py").is_file():
        places.append(CHECKOUT / "build" / "docs")
    found = next((place for place in places if (place / "index.html").is_file()), None)
    return StaticFiles(directory=found, html=True) if found else None


def missing_page(version: str) -> str:
    """Instructions for where the documentation is not built."""
    return document(
        "documentation",
        version,
        "<p>This installation has no built documentation. The packages of a release contain it. In a clone "
        "of the repository, run <code>make docs</code> and restart the service; the same texts are in the "
        "folder <code>docs</code>.</p>"
        '<p>The <a href="/docs">REST reference</a> and the <a href="/docs/formats">file formats</a> are '
        "always served.</p>",
    )
