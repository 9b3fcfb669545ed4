"""The table of jobs: filters and pages in the address, actions in the rows, by keyboard, on a telephone."""

import re

import httpx
import pytest
from playwright.sync_api import expect

from .live_results import uploaded

pytestmark = pytest.mark.browser


@pytest.fixture
def address(serve):
    # Jobs stay where they are: no disk has so much room.
    return serve(min_free_bytes=2**60)


@pytest.fixture
def queued(address, scan):
    """Queue this many reconstructions of one scan, with a name each; returns their records."""
    sent = uploaded(address, scan())

    def make(*names, **settings):
        asked = {"kind": "reconstruction", "dataset": sent["id"], "settings": {"nodes": 16, **settings}}
        made = [httpx.post(f"{address}/v1/jobs", json=asked).json() for _ in names]
        for job, name in zip(made, names, strict=True):
            httpx.patch(f"{address}/v1/jobs/{job['id']}", json={"name": name}).raise_for_status()
        return made

    return make


def names(page):
    return page.locator(".job-table tbody td:first-child")


def test_a_link_restores_filters(page, address, queued):
    left, right, _ = queued("Left", "Right", "Left again")
    httpx.post(f"{address}{left['links']['cancel']}").raise_for_status()
    httpx.patch(f"{address}/v1/datasets/{right['dataset']}", json={"title": "scan_" * 40}).raise_for_status()
    page.goto(f"{address}/#/jobs")
    expect(names(page)).to_have_text(["Left again", "Right", "Left"])
    # A long word, as of a file, does not widen the page.
    page.get_by_role("link", name="scan_").first.wait_for()
    assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    page.get_by_label("Name, scan, notes").fill("left")
    expect(names(page)).to_have_text(["Left again", "Left"])
    page.get_by_label("State").select_option("cancelled")
    expect(names(page)).to_have_text(["Left"])
    assert page.url.endswith("#/jobs?text=left&state=cancelled")
    link = page.url
    page.goto("about:blank")
    page.goto(link)
    expect(names(page)).to_have_text(["Left"])
    expect(page.get_by_label("Name, scan, notes")).to_have_value("left")
    expect(page.get_by_label("State")).to_have_value("cancelled")
    page.get_by_label("Kind").select_option("simulation")
    page.get_by_text("No job matches these filters.").wait_for()
    page.get_by_role("button", name="Clear filters").click()
    expect(names(page)).to_have_text(["Left again", "Right", "Left"])
    assert page.url.endswith("#/jobs")
    page.get_by_role("link", name="Right").click()
    page.get_by_text("Next in the queue").wait_for()
    page.get_by_text("0 jobs run on 1 worker").wait_for()
    assert page.url.endswith(f"#/jobs/{right['id']}")


@pytest.mark.nightly
def test_pages_and_actions_by_keyboard(page, address, queued):
    scan = queued(*(f"Job {k}" for k in range(27)))[0]["dataset"]
    page.goto(f"{address}/#/jobs")
    expect(names(page)).to_have_count(25)
    expect(names(page).first).to_have_text("Job 26")
    page.get_by_role("link", name="Older jobs").focus()
    page.keyboard.press("Enter")
    expect(names(page)).to_have_text(["Job 1", "Job 0"])
    assert re.search(r"#/jobs\?before=job-\w+$", page.url)
    link = page.url
    page.go_back()
    expect(names(page)).to_have_count(25)
    page.goto("about:blank")
    page.goto(link)
    expect(names(page)).to_have_text(["Job 1", "Job 0"])
    row = page.get_by_role("row", name="Job 0")
    row.get_by_role("button", name="Cancel").focus()
    page.keyboard.press("Enter")
    expect(row.locator(".state")).to_have_text("cancelled")
    page.once("dialog", lambda dialog: dialog.accept())
    row.get_by_role("button", name="Delete").focus()
    page.keyboard.press("Enter")
    expect(names(page)).to_have_text(["Job 1"])
    # The page of the scan has the newest ones, and leads to the others.
    page.goto(f"{address}/#/scans/{scan}")
    expect(page.locator(".of-scan .job h2 a")).to_have_text([f"Job {k}" for k in range(26, 20, -1)])
    page.get_by_role("link", name="All in the table of jobs").click()
    expect(names(page)).to_have_count(25)
    expect(page.get_by_label("Name, scan, notes")).to_have_value(scan)


@pytest.mark.nightly
def test_a_telephone_shows_cards(page, address, queued):
    queued("A name that is far too long for one line of a telephone " * 3)
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(f"{address}/#/jobs")
    card = page.locator(".job-table tbody tr")
    expect(card.get_by_role("cell")).to_have_count(8)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert card.evaluate("card => getComputedStyle(card).display") == "block"
    kind = card.locator("[data-column=Kind]")
    assert kind.evaluate("cell => getComputedStyle(cell, '::before').content") == '"Kind"'
