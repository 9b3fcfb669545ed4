"""Every page: axe finds nothing serious, nothing scrolls sideways, no request leaves the service."""

import httpx
import pytest
from playwright.sync_api import expect

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_workers.files.dataset import write_dataset

from ...kernels.acquisition.traces import scan as trace_scan
from ...waiting import wait_until
from ..conftest import PATIENCE_S
from .conftest import serious
from .finished_results import finished, known
from .live_results import in_turns, started, stored_volume, uploaded

pytestmark = [pytest.mark.browser, pytest.mark.nightly]

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
    plane = [finished(shared_service, known((12, 10), seed)) for seed in (0, 1)]
    volume = finished(shared_service, known((6, 5, 4)))
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
    ball = stored_volume(address, sampled(ONE_HOLE, 12))
    marks = "profile=-8,-15,0,-5&ellipse=-8,-15,0,-5"
    return address, {
        "/": "Sixteen elements",
        # With the form of all settings open, and that of corrections with a refusal.
        f"/scans/{sent['id']}?from={plane[0]}": "Receiving element 0",
        f"/jobs/{plane[0]}?{marks}&over=coverage": "node ",
        f"/jobs/{volume}?planes=3": "node ",
        # Under way, with an image and a curve; and failed.
        f"/jobs/{live['id']}": "Stage 1, iteration 2",
        f"/jobs/{failed['id']}": "no finite speed at 3 nodes",
        f"/compare/{','.join(plane)}?{marks}": "m/s · B",
        f"/compare/{','.join(plane)}?mode=swipe": "m/s · B",
        "/jobs": "Sixteen elements",
        f"/rendering/{ball['id']}": "node ",
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


@pytest.mark.parametrize("scheme", RULES)
def test_axe_finds_nothing_serious_in_any_colours_or_width(page, places, scheme):
    """And no request leaves the service."""
    address, pages = places
    page.emulate_media(color_scheme=scheme)
    results, asked = {}, []
    page.on("request", lambda request: asked.append(request.url))
    for path, text in pages.items():
        resized(page, LAPTOP)
        opened(page, address, path, text)
        if path == "/jobs":
            show_alerts(page)
        for size in (LAPTOP, TELEPHONE):
            resized(page, size)
            found = serious(page, RULES[scheme])
            results |= {f"{path} {size[0]} {rule}": parts for rule, parts in found.items()}
        expect(page.locator("h1")).to_have_count(1)
    assert results == {}
    assert len(asked) > len(pages)
    own = (f"{address}/", f"blob:{address}/", "data:", "about:blank")
    assert [request for request in asked if not request.startswith(own)] == []


def test_nothing_scrolls_sideways_at_any_width(page, places):
    address, pages = places
    wide = []
    for first, second in SIZES:
        for path, text in pages.items():
            resized(page, first)
            opened(page, address, path, text)
            wide += sideways(page, path, first, second)
    assert wide == []
