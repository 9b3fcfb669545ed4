"""The page of one job: what it made, and its place in the queue."""

import time

import httpx
import pytest
from PIL import Image
from playwright.sync_api import expect

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_service.jobs import kinds

from .live_results import simulating, started, stored_volume

pytestmark = pytest.mark.browser


def two_frames(client, path, turntable, target, work_dir, **control):
    """In place of ``draw_turntable``."""
    first, second = (Image.new("RGB", (7, 5), colour) for colour in ("red", "blue"))
    first.save(target, "PNG", save_all=True, append_images=[second])


@pytest.mark.nightly
def test_a_turntable_is_shown_and_plays_when_asked(page, address, work, monkeypatch):
    monkeypatch.setattr(kinds, "draw_turntable", two_frames)
    asked = {
        "kind": "refraction",
        "volume": stored_volume(address, sampled(ONE_HOLE, 12))["id"],
        "settings": {"frames": 5, "width": 300, "iso": [0.3, 0.6], "index": [1.3, 1.4]},
    }
    made = httpx.post(f"{address}/v1/jobs", json=asked).json()
    page.goto(f"{address}/#/jobs/{made['id']}")
    job = page.locator(".job")
    job.get_by_role("heading", name="Turntable").wait_for()
    job.get_by_text("5 frames of 300").wait_for()
    link = job.get_by_role("link", name="Frames")
    link.wait_for()
    assert link.get_attribute("href").endswith("/animation")
    image = job.get_by_role("img")
    image.scroll_into_view_if_needed()
    expect(image).to_have_js_property("naturalWidth", 300)
    still = image.get_attribute("src")
    assert "iso=0.3&iso=0.6&" in still
    assert job.get_by_role("button", name="Play").count() == 0
    asked["settings"]["format"] = "apng"
    made = httpx.post(f"{address}/v1/jobs", json=asked).json()
    page.goto(f"{address}/#/jobs/{made['id']}")
    play = job.get_by_role("button", name="Play")
    play.wait_for()
    expect(image).to_have_attribute("src", still)
    play.focus()
    page.keyboard.press("Enter")
    expect(image).to_have_js_property("naturalWidth", 7)
    assert image.get_attribute("src").endswith("/animation")
    page.keyboard.press("Enter")
    expect(image).to_have_attribute("src", still)


def test_simulated_scan_can_be_reconstructed(page, serve, monkeypatch):
    simulating(monkeypatch)
    url = serve()
    asked = {"kind": "simulation", "settings": {"nodes": 16, "elements": 16}}
    job = httpx.post(f"{url}/v1/jobs", json=asked).json()
    page.goto(f"{url}/#/jobs/{job['id']}")
    job = page.locator(".job")
    job.get_by_role("heading", name="Simulated scan").wait_for()
    job.get_by_text("succeeded").wait_for()
    job.get_by_text("A phantom").wait_for()
    whole = job.get_by_text("the largest (")
    assert whole.is_hidden()
    job.get_by_text("Plan: 2 tasks").click()
    assert whole.is_visible()
    page.get_by_role("link", name="Scans", exact=True).click()
    page.get_by_role("link", name="A phantom").wait_for()


@pytest.mark.nightly
def test_a_queued_job_tells_its_place(page, serve, scan):
    # Jobs stay where they are: no disk has so much room.
    address = serve(min_free_bytes=2**60)
    made = [started(address, scan) for _ in range(3)]
    page.goto(f"{address}/#/jobs/{made[2]['id']}")
    page.get_by_text("2 jobs before this one").wait_for()
    httpx.post(f"{address}{made[0]['links']['cancel']}").raise_for_status()
    page.get_by_text("1 job before this one").wait_for()


def test_events_take_the_place_of_polling(page, serve, scan, work):
    address = serve()
    work.hold.clear()
    started(address, scan)
    asked = []
    page.on("request", lambda request: asked.append(request.url) if "/v1/jobs" in request.url else None)
    page.goto(f"{address}/#/jobs")
    job = page.locator(".job-table tbody tr")
    job.get_by_text("running", exact=True).wait_for()
    # Quiet for two seconds while nothing happens; a page that polls never is.
    deadline, quiet = time.monotonic() + 60, 0
    while quiet < 4:
        before = len(asked)
        page.wait_for_timeout(500)
        quiet = quiet + 1 if len(asked) == before else 0
        assert time.monotonic() < deadline
    work.hold.set()
    job.get_by_text("succeeded").wait_for()
    # A job that another program starts appears too.
    started(address, scan)
    expect(job.get_by_text("succeeded")).to_have_count(2)


@pytest.mark.nightly
def test_without_a_stream_the_page_polls(page, serve, scan, work):
    address = serve()
    page.route("**/v1/events*", lambda route: route.abort())
    work.hold.clear()
    started(address, scan)
    page.goto(f"{address}/#/jobs")
    job = page.locator(".job-table tbody tr")
    job.get_by_text("running", exact=True).wait_for()
    work.hold.set()
    job.get_by_text("succeeded").wait_for()
