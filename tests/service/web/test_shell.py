"""The shell of the page: addresses, keys, colours."""

import re

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

from bentray_service.rows.keys import ApiKey

pytestmark = pytest.mark.browser


def test_page_requests_and_sends_a_key(page, serve, scan, work, tmp_path):
    key = ApiKey.new()
    (tmp_path / "key").write_text(key.shown())
    address = serve(first_key_file=tmp_path / "key")
    page.goto(address)
    page.locator("#access").get_by_text("Authentication required").wait_for()
    page.get_by_label("API key").fill(ApiKey.new().shown())
    page.get_by_role("button", name="Use key").click()
    page.locator("#key-error").get_by_text("unknown, revoked or expired").wait_for()
    page.get_by_label("API key").fill(key.shown())
    page.get_by_role("button", name="Use key").click()
    access = page.get_by_text("Tenant local", exact=True)
    expect(access).to_have_attribute("title", "local: metrics, read, write")
    # The header is one row on a laptop.
    page.set_viewport_size({"width": 1400, "height": 900})
    expect(page.get_by_role("button", name="Forget key")).to_be_visible()
    middles = []
    for one in (page.locator(".brand"), page.locator("#theme")):
        box = one.bounding_box()
        middles.append(box["y"] + box["height"] / 2)
    assert abs(middles[0] - middles[1]) < 5
    expect(page.locator("#key")).to_be_hidden()
    page.set_input_files("#scan-file", scan())
    page.get_by_text("16 emitters").wait_for()
    page.get_by_text("All settings").click()
    page.get_by_label("Nodes per side").fill("32")
    page.get_by_role("button", name="Start").click()
    job = page.locator(".job")
    job.get_by_text("succeeded").wait_for()
    image = job.locator("img")
    image.scroll_into_view_if_needed()
    expect(image).to_have_attribute("src", re.compile("^blob:"))
    expect(image).not_to_have_js_property("naturalWidth", 0)
    with page.expect_download() as saved:
        job.get_by_text("Download", exact=True).click()
        job.get_by_role("link", name="NumPy").click()
    assert np.load(saved.value.path()).shape == (32, 32)
    assert key.shown() not in page.url + page.content()
    assert page.evaluate("document.cookie + JSON.stringify(localStorage)") == "{}"
    page.get_by_role("button", name="Forget key").click()
    page.get_by_label("API key").wait_for()
    assert httpx.get(f"{address}/v1/datasets").status_code == 401


def test_unknown_addresses_are_named(page, shared_service):
    address = shared_service.address
    page.goto(f"{address}/#/nowhere")
    page.get_by_text("There is no page /nowhere").wait_for()
    expect(page.get_by_role("heading", level=1)).to_have_text("Not found")
    page.goto(f"{address}/#/scans/ds-none")
    words = "There is no 'ds-none'. It has been deleted, or belongs to another tenant or project."
    page.get_by_role("alert").get_by_text(words).wait_for()
    page.goto(f"{address}/#/jobs/job-none")
    page.get_by_role("alert").get_by_text("job-none").wait_for()


@pytest.mark.nightly
def test_the_colours_are_chosen_and_kept(page, shared_service):
    page.emulate_media(color_scheme="light")
    page.goto(shared_service.address)
    root = page.locator("html")
    expect(root).to_have_attribute("data-theme", "light")
    page.get_by_role("button", name="Switch to dark").click()
    expect(root).to_have_attribute("data-theme", "dark")
    page.reload()
    expect(root).to_have_attribute("data-theme", "dark")
    page.get_by_role("button", name="Switch to light").click()
    # The choice of the system: the page follows it again.
    page.emulate_media(color_scheme="dark")
    expect(root).to_have_attribute("data-theme", "dark")


@pytest.mark.nightly
def test_a_page_goes_on_by_itself_when_the_service_answers_again(page, shared_service):
    page.goto(f"{shared_service.address}/#/jobs")
    page.get_by_role("heading", level=1, name="Jobs").wait_for()
    banner = page.get_by_role("alert").get_by_text("The service does not answer. The page tries again")
    page.context.set_offline(True)
    # Neither a page that has been loaded before nor another one.
    for name in ("Jobs", "Service"):
        page.get_by_role("link", name="Scans", exact=True).click()
        page.get_by_role("link", name=name, exact=True).click()
        banner.wait_for()
        page.locator("main .error").get_by_text("The service does not answer.").first.wait_for()
    page.context.set_offline(False)
    page.get_by_role("region", name="Table of workers").wait_for()
    expect(page.locator("#offline")).to_be_hidden()
    assert page.locator("main .error:visible").count() == 0


@pytest.mark.nightly
def test_a_page_that_found_no_service_opens_later(page, shared_service):
    page.route("**/v1/access", lambda route: route.abort())
    page.goto(f"{shared_service.address}/#/jobs")
    page.locator("main").get_by_role("alert").get_by_text("The service does not answer.").wait_for()
    page.unroute("**/v1/access")
    page.get_by_role("heading", level=1, name="Jobs").wait_for()
