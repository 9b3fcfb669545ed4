"""HTML of pages that are generated as a whole, and the built documentation at /documentation."""

from collections.abc import Sequence
from functools import cache
from html import escape
from pathlib import Path

from starlette.staticfiles import StaticFiles

PACKAGED = Path(__file__).parent / "built_documentation"
CHECKOUT = Path(__file__).resolve().parents[3]


def document(title: str, version: str, content: str) -> str:
    """A whole page.

    Args:
        title: as text.
        version: of the service, as text.
        content: HTML.
    """
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Bentray: {escape(title)}</title>
<link rel="icon" href="/static/icon.svg" type="image/svg+xml">
<link rel="stylesheet" href="/static/style.css">
<script src="/static/theme.js"></script>
</head>
<body>
<header class="top">
<div class="brand"><img src="/static/icon.svg" alt="" width="32" height="32">
<div><h1>Bentray {escape(version)}</h1><small>{escape(title)}</small></div></div>
<nav><a href="/">Viewer</a><a href="/documentation/">Documentation</a><a href="/docs">REST reference</a>
<a href="/docs/formats">File formats</a><a href="/openapi.json">openapi.json</a></nav>
<button id="theme" type="button" class="quiet">Dark</button>
</header>
<main class="reference">
{content}
</main></body></html>"""


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table as HTML; head and cells are text."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


@cache
def documentation_files() -> StaticFiles | None:
    """The built pages, or None where there are none."""
    places = [PACKAGED]
    if (CHECKOUT / "docs" / "conf.py").is_file():
        places.append(CHECKOUT / "build" / "docs")
    found = next((place for place in places if (place / "index.html").is_file()), None)
    return StaticFiles(directory=found, html=True) if found else None


def missing_page(version: str) -> str:
    """For an address that is no page, with instructions for where the documentation is not built."""
    return document(
        "documentation",
        version,
        '<p>The documentation has no such page: <a href="/documentation/">its start</a>. This installation '
        "shows the pages as they are written; the reference of Python and the pictures of the gallery are in "
        "the packages of a release. In a clone of the repository, run <code>make docs</code> and restart the "
        "service.</p>"
        '<p>The <a href="/docs">REST reference</a> and the <a href="/docs/formats">file formats</a> are '
        "always served.</p>",
    )
