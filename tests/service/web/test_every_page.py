"""Every page: axe finds nothing serious, nothing scrolls sideways, no request leaves the service."""

from __future__ import annotations

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from bentray_workers.files.dataset import write_dataset

from ...kernels.acquisition.traces import scan as trace_scan
from .finished_results import finished, known

pytestmark = pytest.mark.browser

SERIOUS = ("serious", "critical")
# WCAG 2.2 AA with what it includes.
RULES = {
    "runOnly": {
        "type": "tag",
        "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
    }
}
# Width and height: a small telephone and a 4K screen.
SIZES = ((360, 740), (3840, 2160))


@pytest.fixture
def places(serve, scan, work, monkeypatch, tmp_path):
    """The address of the service, and every page with a text that is there once it is complete."""
    address = serve()
    plane = [finished(address, scan, work, monkeypatch, known((12, 10), seed)) for seed in (0, 1)]
    volume = finished(address, scan, work, monkeypatch, known((6, 5, 4)))
    write_dataset(tmp_path / "traced.h5", trace_scan(elements=12))
    content = (tmp_path / "traced.h5").read_bytes()
    sent = httpx.post(
        f"{address}/v1/datasets", content=content, headers={"Content-Type": "application/x-hdf5"}
    )
    marks = "profile=-8,-15,0,-5&ellipse=-8,-15,0,-5"
    pages = {
        "/": "Sixteen elements",
        # With the form of all settings open.
        f"/scans/{sent.json()['id']}?from={plane[0]}": "Receiving element 0",
        f"/jobs/{plane[0]}?{marks}": "node ",
        f"/jobs/{volume}?planes=3": "node ",
        f"/compare/{','.join(plane)}?{marks}": "m/s · B",
        f"/compare/{','.join(plane)}?mode=swipe": "m/s · B",
        "/jobs": "Sixteen elements",
        "/rendering": "Volume rendering",
        "/surfaces": "Surface rendering",
        "/service": "worker",
    }
    return address, pages


def opened(page, address, path, text):
    page.goto("about:blank")
    page.goto(f"{address}/#{path}")
    page.locator("main").get_by_text(text).first.wait_for()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious(page, places, scheme):
    address, pages = places
    page.emulate_media(color_scheme=scheme)
    found = {}
    for path, text in pages.items():
        opened(page, address, path, text)
        report = Axe().run(page, options=RULES).response
        assert len(report["passes"]) > 20, path
        for one in report["violations"]:
            if one["impact"] in SERIOUS:
                where = [node["html"][:120] for node in one["nodes"][:3]]
                found[f"{path.partition('?')[0]} {one['id']}"] = where
    assert found == {}


def test_nothing_scrolls_sideways(page, places):
    address, pages = places
    wide = []
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        for path, text in pages.items():
            opened(page, address, path, text)
            if page.evaluate("document.documentElement.scrollWidth > innerWidth"):
                wide.append((width, path))
    assert wide == []


def test_no_request_leaves_the_service(page, places):
    address, pages = places
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    for path, text in pages.items():
        opened(page, address, path, text)
    assert len(asked) > len(pages)
    own = (f"{address}/", f"blob:{address}/", "data:")
    assert [one for one in asked if not one.startswith(own) and one != "about:blank"] == []
    expect(page.locator("h1")).to_have_count(1)
