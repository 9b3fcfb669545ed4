"""From a dropped file to an export in a browser, with a service and a worker as processes of their own."""

import httpx
import nibabel
import numpy as np
import pytest
from playwright.sync_api import expect

from bentray_kernels.tomography import Settings, reconstruct
from bentray_workers.files.dataset import write_dataset

from ...faults.live_service import LiveService
from ...faults.machine import wait_until
from ...table6 import table6_scan
from .conftest import PATIENCE_MS, drop, tab_to

pytestmark = [pytest.mark.browser, pytest.mark.slow]

ELEMENTS = 32
# So many iterations that the service can be killed between two of them.
SETTINGS = Settings.from_values(method="sart", nodes=64, iterations=48)


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    made = LiveService(tmp_path_factory.mktemp("story"), ("north", "south"), workers=1)
    yield made
    made.kill()


@pytest.fixture(scope="module")
def breast():
    """Travel times of a ring about the 2-D breast phantom."""
    return table6_scan(ELEMENTS, 32, 0.08, 1500.0)


def enter(page, service, tenant):
    page.goto(service.url)
    page.get_by_label("API key").fill(service.keys[tenant])
    page.get_by_role("button", name="Use key").click()
    page.get_by_text(f"Tenant {tenant}", exact=True).wait_for()


def dropped(page, scan, folder):
    write_dataset(folder / "breast.h5", scan)
    page.locator("#scan-drop").wait_for()
    drop(page, "#scan-drop", breast=(folder / "breast.h5").read_bytes())
    page.wait_for_url("**/#/scans/*")


@pytest.mark.nightly
def test_from_a_dropped_file_over_a_killed_service_to_an_export(page, service, breast, tmp_path):
    enter(page, service, "north")
    dropped(page, breast, tmp_path)
    page.get_by_text("All settings").click()
    page.get_by_label("Method", exact=True).select_option("SART")
    page.get_by_label("Nodes per side").fill(str(SETTINGS.nodes))
    page.get_by_text("Advanced").click()
    page.get_by_label("Iterations").fill(str(SETTINGS.iterations))
    page.get_by_role("button", name="Start").click()
    page.locator(".job h2 a").click()
    http = httpx.Client(headers={"Authorization": f"Bearer {service.keys['north']}"}, timeout=60.0)
    job = f"{service.url}/v1/jobs/{page.url.rpartition('/')[2]}"
    wait_until(lambda: http.get(job).json()["history"])
    service.kill()
    assert page.locator("canvas.plane").count() == 0
    service.start(service.port)
    # Nobody touches the page: it finds the service again, and shows the result when it is there.
    page.locator(".readout").filter(has_text="mm").wait_for()
    assert len(http.get(job).json()["history"]) == SETTINGS.iterations
    canvas = page.locator("canvas.plane")
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.6 * box["height"])
    page.wait_for_function("() => document.querySelector('.readout').dataset.node")
    said = page.locator(".readout").evaluate("one => ({...one.dataset})")
    undisturbed = reconstruct(breast, SETTINGS).speed
    node = tuple(map(int, said["node"].split(",")))
    assert float(said["value"]) == pytest.approx(undisturbed[node], rel=1e-6)
    page.get_by_text("Export", exact=True).click()
    with page.expect_download() as download:
        page.locator(".export").get_by_role("link", name="NIfTI").click()
    download.value.save_as(tmp_path / "speed.nii")
    np.testing.assert_allclose(
        np.squeeze(nibabel.load(tmp_path / "speed.nii").get_fdata()), undisturbed, rtol=1e-6
    )


def test_the_whole_story_by_keyboard_alone(page, service, breast, tmp_path):
    def press(goal, key="Enter"):
        tab_to(page, goal)
        page.keyboard.press(key)

    page.on("dialog", lambda dialog: dialog.accept())
    write_dataset(tmp_path / "ring.h5", breast)
    page.goto(service.url)
    tab_to(page, page.get_by_label("API key"))
    page.keyboard.type(service.keys["south"])
    page.keyboard.press("Enter")
    with page.expect_file_chooser() as chooser:
        press(page.locator("#scan-file"))
    chooser.value.set_files(tmp_path / "ring.h5")
    page.wait_for_url("**/#/scans/*")
    press(page.get_by_text("All settings"))
    for name, text in (("Method", "SART"), ("Nodes per side", "32"), ("Iterations", "1")):
        if name == "Iterations":
            press(page.get_by_text("Advanced"))
        tab_to(page, page.get_by_label(name, exact=True))
        page.keyboard.type(text)
    page.keyboard.press("Enter")
    press(page.locator(".job h2 a"))
    page.locator(".readout").filter(has_text="mm").wait_for()
    http = httpx.Client(headers={"Authorization": f"Bearer {service.keys['south']}"}, timeout=60.0)
    job = http.get(f"{service.url}/v1/jobs/{page.url.partition('?')[0].rpartition('/')[2]}").json()
    assert (job["settings"]["method"], job["settings"]["nodes"]) == ("sart", 32)
    press(page.locator(".export summary"))
    with page.expect_download() as download:
        press(page.locator(".export").get_by_role("link", name="NumPy"))
    assert download.value.suggested_filename.endswith("-speed.npy")
    values = np.load(download.value.path())
    page.keyboard.press("Escape")
    expect(page.locator(".export summary")).to_be_focused()
    expect(page.locator(".export .sheet")).to_be_hidden()
    press(page.locator("canvas.plane"), "ArrowRight")
    expect(page.locator(".readout")).to_contain_text("node 17, 16")
    assert float(page.locator(".readout").get_attribute("data-value")) == values[17, 16]
    page.locator("#page").focus()
    press(page.get_by_role("main").get_by_role("link", name="Scan", exact=True))
    press(page.get_by_role("button", name="Delete"))
    page.get_by_text("No scan yet").wait_for()
    assert http.get(f"{service.url}{job['links']['self']}").status_code == 404


@pytest.mark.nightly
def test_two_tenants_see_nothing_of_each_other(page, browser, service, breast, tmp_path):
    enter(page, service, "north")
    dropped(page, breast, tmp_path)
    own = page.url
    with browser.new_context() as context:
        other = context.new_page()
        other.set_default_timeout(PATIENCE_MS)
        enter(other, service, "south")
        other.get_by_text("No scan yet").wait_for()
        other.goto(own)
        other.get_by_role("alert").get_by_text(own.rpartition("/")[2]).wait_for()
        other.goto(f"{service.url}/#/jobs")
        other.get_by_text("Nothing has run yet").wait_for()
    page.goto(service.url)
    expect(page.locator("#scans li")).not_to_have_count(0)
