"""The pages: there, closed to foreign content, and loading nothing from elsewhere."""

import re

import pytest

from bentray_service.routes.pages import WEB
from bentray_service.web import documents

PAGES = ("/", "/docs", "/docs/formats")
ASSETS = [
    # Written as it is asked for.
    "/static/export_formats.json",
    *(
        f"/static/{path.relative_to(WEB / 'static')}"
        for path in (WEB / "static").rglob("*")
        if path.is_file()
    ),
]


def test_pages_load_only_own_files_and_keep_to_their_own_policy(http):
    for path in (*PAGES, *ASSETS):
        answer = http.get(path)
        assert answer.status_code == 200, path
        assert "default-src 'self'" in answer.headers["content-security-policy"], path
        assert answer.headers["x-content-type-options"] == "nosniff", path
        loaded = re.findall(r"(?:src|href)=[\"']([^\"']+)|url\(([^)]+)\)|from \"([^\"]+)", answer.text)
        assert [one for found in loaded for one in found if "//" in one] == [], path
        within = r"<script(?![^>]*\bsrc=)|<style|\bstyle=|\bon\w+="
        assert path in ASSETS or not re.search(within, answer.text), path


def test_problem_types_lead_to_their_list(start):
    answer = start().get("/problems/invalid-input", follow_redirects=False)
    assert answer.headers["location"] == "/docs#problems"
    assert 'id="problems"' in start("other").get("/docs").text


def test_static_files_end_at_their_folder(start):
    assert start().get("/static/..%2f..%2fapp.py").status_code == 404


@pytest.fixture
def built(tmp_path, monkeypatch):
    """A built documentation of two pages beside a file that is not part of it."""
    folder = tmp_path / "documentation"
    (folder / "how-to").mkdir(parents=True)
    (folder / "index.html").write_text("<title>start</title>")
    (folder / "how-to" / "deploy.html").write_text("<title>deploy</title>")
    (tmp_path / "secret.html").write_text("secret")
    monkeypatch.setattr(documents, "PACKAGED", folder)
    documents.documentation_files.cache_clear()
    yield folder
    documents.documentation_files.cache_clear()


def test_the_documentation_is_served_under_the_same_policy(start, built):
    app = start()
    assert app.get("/documentation", follow_redirects=False).headers["location"] == "/documentation/"
    for path, title in {"": "start", "how-to/deploy.html": "deploy"}.items():
        answer = app.get(f"/documentation/{path}")
        assert (answer.status_code, answer.text) == (200, f"<title>{title}</title>")
        assert "default-src 'self'" in answer.headers["content-security-policy"]
    for path in ("nowhere.html", "..%2fsecret.html", "%2e%2e/secret.html"):
        assert app.get(f"/documentation/{path}").status_code == 404


def test_a_documentation_that_is_not_built_is_shown_as_it_is_written(start, monkeypatch, tmp_path):
    monkeypatch.setattr(documents, "PACKAGED", tmp_path)
    monkeypatch.setattr(documents, "CHECKOUT", tmp_path)
    documents.documentation_files.cache_clear()
    app = start()
    for path, words in {
        "": "What do you want to do?",
        "how-to/deploy.html": "<h1",
        "reference/settings.md": "<td><code>gauss_newton.penalty_strength</code></td>",
        "mathematics/rays.html": "<pre>",
        "gallery/02_own_data.html": "import bentray",
        "gallery/index.html": '<a href="02_own_data.html">',
        "?q=water+TEMPERATURE": '<a href="/documentation/how-to/use-your-own-data.html">',
        "?q=%3Cb%3Enothing": "No page has &lt;b&gt;nothing",
    }.items():
        answer = app.get(f"/documentation/{path}")
        assert (answer.status_code, words in answer.text) == (200, True), path
        assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\bstyle=", answer.text), path
    start_page = app.get("/documentation/").text
    pictures = re.findall(r'<img src="(pictures/[^"]+)"', start_page)
    assert pictures
    for address in [*pictures, *re.findall(r'<a href="([\w-]+/[\w-]+\.\w+)"', start_page)]:
        assert app.get(f"/documentation/{address}").status_code == 200, address
    for path in ("nowhere.html", "..%2fREADME.md", "%2e%2e/pyproject.toml", "conf.py"):
        assert app.get(f"/documentation/{path}").status_code == 404
    documents.documentation_files.cache_clear()


def test_a_documentation_that_is_not_built_says_how_to_get_it(start, monkeypatch, tmp_path):
    monkeypatch.setattr(documents, "PACKAGED", tmp_path)
    monkeypatch.setattr(documents, "CHECKOUT", tmp_path)
    documents.documentation_files.cache_clear()
    answer = start().get("/documentation/nowhere.html")
    documents.documentation_files.cache_clear()
    assert answer.status_code == 404
    assert "make docs" in answer.text
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\bstyle=|\bon\w+=", answer.text)
