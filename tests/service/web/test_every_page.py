"""Every page: axe finds nothing serious, nothing scrolls sideways, no request leaves the service."""

import io

import httpx
import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_workers.files.dataset import write_dataset

from ...kernels.acquisition.traces import scan as trace_scan
from ...waiting import wait_until
from ..conftest import PATIENCE_S
from .finished_results import finished, known
from .live_results import in_turns, started, uploaded

pytestmark = [pytest.mark.browser, pytest.mark.nightly]

# Ends of the addresses of pages whose parts axe has seen in another one.
REPEATED = ("?planes=3", "?mode=swipe")
SERIOUS = ("serious", "critical")
# WCAG 2.2 AA with what it includes; in the dark what depends on colours.
LEVELS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
RULES = {
    "light": {"runOnly": {"type": "tag", "values": LEVELS}},
    "dark": {"runOnly": {"type": "rule", "values": ["color-contrast", "link-in-text-block"]}},
}
NARROWEST, TELEPHONE, LAPTOP = (360, 740), (390, 844), (1400, 900)
# Width and height when a page is opened, and after it: of telephones, and of 4K and a laptop.
SIZES = ((NARROWEST, TELEPHONE), ((3840, 2160), LAPTOP))


@pytest.fixture(scope="module")
def places(shared_service):
    """The address of a service, and every page with a text that is there once it is complete."""
    address, scan, work, monkeypatch, folder = shared_service
    plane = [finished(address, scan, work, monkeypatch, known((12, 10), seed)) for seed in (0, 1)]
    volume = finished(address, scan, work, monkeypatch, known((6, 5, 4)))
    write_dataset(folder / "traced.h5", trace_scan(elements=12))
    sent = uploaded(address, folder / "traced.h5")
    work.error = InvalidInput("settings", "no finite speed at 3 nodes", "smaller relaxation")
    failed = started(address, scan)
    until(address, failed, lambda job: job["finished"])
    work.error, turns = None, in_turns(work, monkeypatch)
    live = started(address, scan)
    for number in (1, 2):
        turns.put(None)
        until(address, live, lambda job, number=number: len(job["history"]) == number)
    values = io.BytesIO()
    np.save(values, sampled(ONE_HOLE, 12))
    binary = {"Content-Type": "application/octet-stream"}
    ball = httpx.post(f"{address}/v1/volumes", content=values.getvalue(), headers=binary).json()
    marks = "profile=-8,-15,0,-5&ellipse=-8,-15,0,-5"
    return address, {
        "/": "Sixteen elements",
        # With the form of all settings open, and that of corrections with a refusal.
        f"/scans/{sent['id']}?from={plane[0]}": "Receiving element 0",
        f"/jobs/{plane[0]}?{marks}": "node ",
        f"/jobs/{volume}?planes=3": "node ",
        # Under way, with an image and a curve; and failed.
        f"/jobs/{live['id']}": "Stage 1, iteration 2",
        f"/jobs/{failed['id']}": "no finite speed at 3 nodes",
        f"/compare/{','.join(plane)}?{marks}": "m/s · B",
        f"/compare/{','.join(plane)}?mode=swipe": "m/s · B",
        "/jobs": "Sixteen elements",
        f"/rendering/{ball['id']}?mode=refract": "azimuth",
        "/surfaces": "Surface rendering",
        "/service": "worker",
        "/batch": "Sixteen elements",
    }


def until(address, job, reached):
    """Wait until the record of a job is as it should be."""
    wait_until(lambda: reached(httpx.get(f"{address}/v1/jobs/{job['id']}").json()), PATIENCE_S)


def resized(page, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})


def opened(page, address, path, text):
    page.goto("about:blank")
    page.goto(f"{address}/#{path}")
    page.locator("main").get_by_text(text).first.wait_for()
    if path.startswith("/scans/"):
        page.get_by_role("button", name="Correct units, frequency or order").click()
        page.get_by_role("button", name="Make a corrected copy").click()
        page.locator("#correct-error").get_by_text("changes nothing").wait_for()


def serious(page, path, scheme):
    """Serious findings of axe in this page: the parts, by the name of the rule."""
    report = Axe().run(page, options=RULES[scheme]).response
    assert report["passes"], path
    return {
        f"{path.partition('?')[0]} {scheme} {page.viewport_size['width']} {rule['id']}": [
            node["html"][:120] for node in rule["nodes"][:3]
        ]
        for rule in report["violations"]
        if rule["impact"] in SERIOUS
    }


def show_alerts(page):
    """The messages that the shell shows when a key ends, and when the service is away."""
    page.evaluate("document.dispatchEvent(new CustomEvent('locked', { detail: 'The key has expired' }))")
    page.evaluate("document.dispatchEvent(new CustomEvent('connection', { detail: false }))")


def sideways(page, path, *sizes):
    """Widths of the sizes at which the page scrolls sideways, with its path."""
    results = []
    for size in sizes:
        resized(page, size)
        if page.evaluate("document.documentElement.scrollWidth > innerWidth"):
            results.append((size[0], path))
    return results


def test_every_page_on_a_laptop_and_on_the_narrowest_telephone(page, places):
    """Each page once: axe finds nothing serious, nothing scrolls sideways, no request leaves the service."""
    address, pages = places
    results, wide, asked = {}, [], []
    page.on("request", lambda request: asked.append(request.url))
    page.emulate_media(color_scheme="light")
    for path, text in pages.items():
        resized(page, LAPTOP)
        opened(page, address, path, text)
        wide += sideways(page, path, LAPTOP, NARROWEST)
        resized(page, LAPTOP)
        if not path.endswith(REPEATED):
            if path == "/jobs":
                show_alerts(page)
            results |= serious(page, path, "light")
    assert results == {}
    assert wide == []
    assert len(asked) > len(pages)
    own = (f"{address}/", f"blob:{address}/", "data:")
    assert [request for request in asked if not request.startswith(own) and request != "about:blank"] == []
    expect(page.locator("h1")).to_have_count(1)


@pytest.mark.parametrize("scheme", RULES)
def test_axe_finds_nothing_serious_in_any_colours_or_width(page, places, scheme):
    address, pages = places
    page.emulate_media(color_scheme=scheme)
    results = {}
    for path, text in pages.items():
        resized(page, LAPTOP)
        opened(page, address, path, text)
        if path == "/jobs":
            show_alerts(page)
        for size in (LAPTOP, TELEPHONE):
            resized(page, size)
            results |= serious(page, path, scheme)
    assert results == {}


def test_nothing_scrolls_sideways_at_any_width(page, places):
    address, pages = places
    wide = []
    for first, second in SIZES:
        for path, text in pages.items():
            resized(page, first)
            opened(page, address, path, text)
            wide += sideways(page, path, first, second)
    assert wide == []
