"""Sphinx extension: pages without inline scripts and styles, and without files of other hosts.

So the service can serve them under its own content security policy, and they are complete without a network.
"""

import base64
import hashlib
import os
import re
import zipfile
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from sphinx.util import logging

log = logging.getLogger(__name__)

# Files made from inline parts, named by their content.
FOLDER = "_static/inline"
STYLES = "styles.css"

SCRIPT = re.compile(r"<script(?: type=\"text/javascript\")?>(.*?)</script>", re.DOTALL)
STYLE = re.compile(r"<style(?: type=\"text/css\")?>(.*?)</style>", re.DOTALL)
ATTRIBUTE = re.compile(r"(<[a-zA-Z][^<>]*?) style=\"([^\"]*)\"")
IMAGE = re.compile(r"src=\"data:image/(png|svg\+xml);base64,([^\"]*)\"")
DRAWING = re.compile(r"url\((['\"])data:image/svg\+xml;charset=utf-8,(.*?)\1\)", re.DOTALL)
LEFT = re.compile(
    r"<script(?![^>]*\bsrc=)(?![^>]*json)|<style|<[a-z][^<>]*?\s(?:style|on\w+)=\"|\bsrc=\"data:"
)
FOREIGN = re.compile(
    r"<(?:script|img|source|iframe)\b[^>]*\bsrc=\"(?:https?:)?//|<link\b[^>]*\bhref=\"https?://"
)


class Parts:
    """Collects the inline parts of pages as files in the folder of the output."""

    def __init__(self, output: Path) -> None:
        self.output = output
        self.rules: dict[str, str] = {}
        (output / FOLDER).mkdir(parents=True, exist_ok=True)

    def separated(self, text: str, up: str) -> str:
        """The text of a page with links to files in place of inline parts; ``up`` leads to the output."""
        text = SCRIPT.sub(lambda one: f'<script src="{up}{self._file(one[1], "js")}"></script>', text)
        text = STYLE.sub(
            lambda one: f'<link rel="stylesheet" type="text/css" href="{up}{self._file(one[1], "css")}">',
            text,
        )
        text = IMAGE.sub(lambda one: f'src="{up}{self._image(one[1], one[2])}"', text)
        marked = ATTRIBUTE.sub(lambda one: f'{one[1]} data-style="{self._rule(one[2])}"', text)
        if marked != text:
            link = f'<link rel="stylesheet" type="text/css" href="{up}{FOLDER}/{STYLES}">'
            marked = marked.replace("</head>", f"{link}\n</head>", 1)
        return marked

    def with_files(self, text: str, up: str) -> str:
        """A style sheet with files in place of drawings in data addresses."""
        return DRAWING.sub(lambda one: f'url("{up}{self._stored(unquote(one[2]).encode(), "svg")}")', text)

    def write_styles(self) -> None:
        """Write the rules of all style attributes, with those of earlier runs."""
        path = self.output / FOLDER / STYLES
        before = path.read_text().splitlines() if path.exists() else []
        rules = [f'[data-style="{name}"] {{ {style} }}' for name, style in self.rules.items()]
        path.write_text("\n".join(sorted({*before, *rules})) + "\n")

    def _rule(self, style: str) -> str:
        name = _digest(style.encode())
        self.rules[name] = style
        return name

    def _file(self, text: str, suffix: str) -> str:
        return self._stored(text.encode(), suffix)

    def _image(self, kind: str, content: str) -> str:
        return self._stored(base64.b64decode(content), kind.partition("+")[0])

    def _stored(self, content: bytes, suffix: str) -> str:
        name = f"{FOLDER}/{_digest(content)}.{suffix}"
        (self.output / name).write_bytes(content)
        return name


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def separate(app: Any, error: Exception | None) -> None:
    """Separate the inline parts of all pages that were built."""
    if error is not None or app.builder.format != "html":
        return
    parts = Parts(Path(app.outdir))
    for page in sorted(parts.output.rglob("*.html")):
        text = page.read_text()
        up = os.path.relpath(parts.output, page.parent) + "/"
        separated = parts.separated(text, "" if up == "./" else up)
        if separated != text:
            page.write_text(separated)
        if found := FOREIGN.search(separated) or LEFT.search(separated):
            log.warning("%s: inline code or a file of another host: %s", page.name, found[0])
    parts.write_styles()
    for sheet in sorted(parts.output.rglob("*.css")):
        text = sheet.read_text()
        if (changed := parts.with_files(text, os.path.relpath(parts.output, sheet.parent) + "/")) != text:
            sheet.write_text(changed)
        if "url(data:" in changed.replace('"', "").replace("'", ""):
            log.warning("%s: an image in a data address", sheet.name)
    for archive in sorted(parts.output.rglob("*.zip")):
        _without_dates(archive)


def _without_dates(archive: Path) -> None:
    """Write an archive again without the times of its files, so that two builds are equal."""
    with zipfile.ZipFile(archive) as old:
        content = {name: old.read(name) for name in sorted(old.namelist())}
    with zipfile.ZipFile(archive, "w") as new:
        for name, text in content.items():
            new.writestr(zipfile.ZipInfo(name), text)


def setup(app: Any) -> dict[str, bool]:
    """Register the extension."""
    app.connect("build-finished", separate)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
