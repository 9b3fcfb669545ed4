"""The pages: there, closed to foreign content, and loading nothing from elsewhere."""

import re

import pytest

from bentray_service.routes.pages import WEB

ASSETS = sorted(
    f"/static/{path.relative_to(WEB / 'static')}" for path in (WEB / "static").rglob("*") if path.is_file()
)


@pytest.mark.parametrize("path", ["/", "/docs", "/docs/formats", *ASSETS])
def test_pages_load_only_own_files(start, path):
    answer = start().get(path)
    assert answer.status_code == 200
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    loaded = re.findall(r"(?:src|href)=[\"']([^\"']+)|url\(([^)]+)\)|from \"([^\"]+)", answer.text)
    assert [one for found in loaded for one in found if "//" in one] == []


@pytest.mark.parametrize("path", ["/", "/docs", "/docs/formats"])
def test_pages_keep_to_their_own_policy(start, path):
    text = start().get(path).text
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\bstyle=|\bon\w+=", text)


def test_problem_types_lead_to_their_list(start):
    answer = start().get("/problems/invalid-input", follow_redirects=False)
    assert answer.headers["location"] == "/docs#problems"
    assert 'id="problems"' in start("other").get("/docs").text


def test_static_files_end_at_their_folder(start):
    assert start().get("/static/..%2f..%2fapp.py").status_code == 404
