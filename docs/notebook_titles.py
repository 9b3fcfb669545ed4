"""Sphinx extension: notebooks of recipes name pages by their titles, as they cannot link to them."""

import re
from pathlib import Path
from typing import Any

from sphinx_gallery import notebook

DOCS = Path(__file__).parent
LINK = re.compile(r":doc:`/([^`]+)`")
TITLE = re.compile(r'\A(?:"""|# )(.+)')


def title_of(page: str) -> str:
    """The title of a page or recipe, such as ``gallery/01_first_image``."""
    folder, _, name = page.partition("/")
    source = DOCS / "recipes" / f"{name}.py" if folder == "gallery" else DOCS / f"{page}.md"
    title = TITLE.match(source.read_text())
    assert title is not None, page
    return title[1]


def with_titles(text: str) -> str:
    """A text of a recipe with the title of each page in place of the link to it."""
    return LINK.sub(lambda link: f"*{title_of(link[1])}*", text)


def setup(app: Any) -> dict[str, bool]:
    """Register the extension."""
    convert = notebook.rst2md
    notebook.rst2md = lambda text, *rest: convert(with_titles(text), *rest)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
