"""The Sphinx extensions of docs/: formulas as MathML, pages without inline code."""

import re
import sys
import zipfile
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.insert(0, str(DOCS))

# The tools of the documentation are an extra of their own.
sphinx = pytest.importorskip("sphinx")

import mathml  # noqa: E402
import notebook_titles  # noqa: E402
import offline  # noqa: E402

PAGE = """<html><head><style>p { color: red; }</style></head><body>
<script>let a = 1;</script><script src="own.js"></script>
<p style="width: 3%">text <img src="data:image/png;base64,iVBORw0KGgo="></p></body></html>"""


def formulas() -> list[tuple[str, str, bool]]:
    """Page, formula and whether it stands on lines of its own."""
    results = []
    for page in sorted(DOCS.rglob("*.md")):
        text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(), flags=re.DOTALL)
        results += [
            (page.name, block or line, bool(block))
            for block, line in re.findall(r"\$\$(.*?)\$\$|\$([^$\n]+)\$", text, re.DOTALL)
        ]
    return results


def test_every_formula_is_converted() -> None:
    listed = formulas()
    assert len(listed) > 200
    for page, text, block in listed:
        assert "<math" in mathml.converted(text, block=block), (page, text)


def test_an_unknown_command_is_an_error() -> None:
    with pytest.raises(mathml.MathError):
        mathml.converted(r"\unheard", block=False)


def test_pages_have_nothing_inline(tmp_path: Path) -> None:
    parts = offline.Parts(tmp_path)
    result = parts.separated(PAGE, "../")
    parts.write_styles()
    assert not offline.LEFT.search(result)
    assert offline.LEFT.search(PAGE)
    files = re.findall(r"(?:src|href)=\"\.\./([^\"]+)", result)
    content = [(tmp_path / name).read_bytes() for name in files]
    assert b"let a = 1;" in content
    assert b"p { color: red; }" in content
    assert any(part_of.startswith(b"\x89PNG") for part_of in content)
    assert any(b"width: 3%" in part_of for part_of in content)
    assert parts.separated(result, "../") == result, "a page that was not built again stays as it is"


def test_style_sheets_have_no_data_addresses(tmp_path: Path) -> None:
    parts = offline.Parts(tmp_path)
    sheet = """a { --i: url('data:image/svg+xml;charset=utf-8,<svg x="1"/>'); b: url("own.svg") }
    c { d: url("data:image/svg+xml;charset=utf-8,%3Csvg y='2'/%3E") }"""
    result = parts.with_files(sheet, "../")
    assert "data:" not in result
    assert "own.svg" in result
    drawings = [(tmp_path / name).read_text() for name in re.findall(r'url\("\.\./([^"]+)', result)]
    assert drawings == ['<svg x="1"/>', "<svg y='2'/>"]


def test_files_of_other_hosts_are_noticed() -> None:
    assert offline.FOREIGN.search('<script src="https://cdn.example.org/a.js">')
    assert offline.FOREIGN.search('<link rel="stylesheet" href="https://example.org/a.css">')
    assert not offline.FOREIGN.search('<a href="https://example.org">source</a>')


def test_archives_do_not_depend_on_times(tmp_path: Path) -> None:
    for name, when in (("a.zip", (2020, 1, 1, 0, 0, 0)), ("b.zip", (2024, 5, 5, 1, 2, 4))):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr(zipfile.ZipInfo("recipe.py", when), "text")
        offline._without_dates(tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()


def test_notebooks_name_pages_by_their_titles() -> None:
    text = "see :doc:`/gallery/05_coupling_speed` and\n:doc:`/mathematics/eikonal`."
    assert notebook_titles.with_titles(text) == (
        "see *The speed of the water decides* and\n*The Eikonal equation and its solvers*."
    )
