"""The pages of the folder docs as HTML, with a search: the documentation where nobody has built it."""

import re
from functools import cache
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

from .documents import CHECKOUT, document

# In a package without built pages; in a checkout the folder itself.
PACKAGED = Path(__file__).parent / "written_documentation"
RECIPES = "recipes/"
NOTE = (
    "Pages as they are written: formulas in LaTeX, without the pictures of the gallery and the reference of "
    "Python. <code>make docs</code> builds all of it."
)
TITLE = re.compile(r'\A(?:# |""")(.+)$', re.MULTILINE)
# For Sphinx alone.
CONTENTS = re.compile(r"^```\{toctree\}.*?^```$", re.MULTILINE | re.DOTALL)
FORMULA_BLOCK = re.compile(r"^\$\$\s*(.*?)\s*\$\$[^\n]*", re.MULTILINE | re.DOTALL)
ROLES = re.compile(r"\{(?:eq|doc|ref)\}(?=`)")
# Left out of the excerpts of a search.
MARKUP = re.compile(r"[`|*#]|-{3}|\]\([^)]*\)")
FORMULA = re.compile(r"\$([^$]+)\$")
# Characters of a page around the first word that was found.
AROUND = 120


@cache
def page_files() -> dict[str, Path]:
    """The files of the documentation by their addresses: Markdown, programs of the gallery, pictures."""
    checkout = CHECKOUT / "docs"
    folder = checkout if (checkout / "conf.py").is_file() else PACKAGED
    found = [*folder.rglob("*.md"), *folder.rglob("*.png"), *folder.glob(f"{RECIPES}*.py")]
    return {path.relative_to(folder).as_posix(): path for path in sorted(found)}


def written_page(address: str, version: str) -> str | None:
    """The page of an address as HTML, or None if there is none.

    Args:
        address: as of the built documentation (``how-to/deploy.html``), or that of the file.
        version: of the service.
    """
    stem = (address or "index").removesuffix(".html").removesuffix(".md").removesuffix(".rst")
    if stem == "gallery/index":
        programs = [name for name in page_files() if name.startswith(RECIPES)]
        links = "".join(
            f'<li><a href="{Path(name).stem}.html">{escape(_title(name))}</a></li>' for name in programs
        )
        return _framed("Gallery", version, f"<h1>Gallery</h1><ul>{links}</ul>")
    if stem.startswith("gallery/"):
        name = stem.replace("gallery/", RECIPES, 1) + ".py"
        if name not in page_files():
            return None
        return _framed(_title(name), version, f'<pre tabindex="0">{escape(_text(name))}</pre>')
    name = f"{stem}.md"
    return _framed(_title(name), version, _html(name)) if name in page_files() else None


def found_pages(words: str, version: str) -> str:
    """The page of the results of a search: pages with all words, those with the most first."""
    wanted = words.lower().split()
    found = []
    for name in page_files():
        if not name.endswith(".png"):
            text = f"{_title(name)}\n{_text(name)}".lower()
            counts = [text.count(word) + 20 * _title(name).lower().count(word) for word in wanted]
            if wanted and all(counts):
                found.append((sum(counts), name))
    items = []
    for _, name in sorted(found, reverse=True):
        text = _text(name)
        at = max(text.lower().find(wanted[0]), 0)
        near = " ".join(MARKUP.sub("", text[max(at - AROUND, 0) : at + AROUND]).split())
        address = re.sub(rf"^{RECIPES}", "gallery/", name).rpartition(".")[0] + ".html"
        link = f'<a href="/documentation/{address}">{escape(_title(name))}</a>'
        items.append(f"<li>{link}<br><small>… {escape(near)} …</small></li>")
    count = f"{len(items)} pages with {escape(words)}" if items else f"No page has {escape(words)}"
    return _framed(
        "search of the documentation", version, f"<h1>{count}</h1><ul>{''.join(items)}</ul>", words
    )


def _framed(title: str, version: str, content: str, words: str = "") -> str:
    search = (
        '<form action="/documentation/" role="search"><label>Search <input type="search" name="q" '
        f'value="{escape(words)}" required></label> <button type="submit">Search</button></form>'
    )
    return document(title, version, f'{search}<article class="written">{content}</article><p>{NOTE}</p>')


@cache
def _text(name: str) -> str:
    return page_files()[name].read_text(encoding="utf-8")


def _title(name: str) -> str:
    found = TITLE.search(_text(name))
    return found[1] if found else name


@cache
def _html(name: str) -> str:
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark").enable("table")
    parser.inline.ruler.before("escape", "formula", _formula)
    text = FORMULA_BLOCK.sub(r"```text\n\1\n```", ROLES.sub("", CONTENTS.sub("", _text(name))))
    tokens = parser.parse(text)
    for head, inline in pairwise(tokens):
        if head.type == "heading_open":
            head.attrSet("id", re.sub(r"[^\w\- ]", "", inline.content.lower()).replace(" ", "-"))
    return str(parser.renderer.render(tokens, parser.options, {}))


def _formula(state: Any, silent: bool) -> bool:
    """A rule of the parser: what is between dollar signs is code, in which nothing is emphasised."""
    found = FORMULA.match(state.src, state.pos)
    if found is None:
        return False
    if not silent:
        state.push("code_inline", "code", 0).content = found[1]
    state.pos = found.end()
    return True
