"""The start page: upload a scan, error messages, and the list of scans."""

import io

import httpx
import numpy as np
import pytest
import trimesh
from playwright.sync_api import expect
from scipy.io import savemat

from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_workers.simulation.request import SAMPLE, PhantomScan

from ...workers.foreign_scans.scans import delta_tof, positions
from .conftest import drop
from .live_results import simulating, uploaded

pytestmark = pytest.mark.browser


@pytest.mark.nightly
def test_several_files_are_dropped_beside_the_zone(page, serve, scan, tmp_path):
    page.goto(serve())
    page.get_by_text("No scan yet").wait_for()
    page.get_by_text("ready, 1 worker").wait_for()
    content = scan().read_bytes()
    drop(page, "h1", first=content, notes=b"only text", second=content)
    page.get_by_text("3 of 3: second.h5 is stored").wait_for()
    expect(page.locator("#scan-error")).to_contain_text(
        "notes.h5 is not a scan, a volume or a mesh that can be read. "
    )
    expect(page.locator("#scans li")).to_have_count(2)


@pytest.mark.nightly
def test_scans_are_found_by_their_names_and_read_in_pages(page, serve, scan):
    address = serve()
    for name in ("Left", "Right", "Left again"):
        sent = uploaded(address, scan())
        httpx.patch(f"{address}{sent['links']['self']}", json={"title": name}).raise_for_status()
    # Two scans on a page, as if there were many.
    page.route("**/v1/datasets?*", lambda route: route.continue_(url=route.request.url.replace("=25", "=2")))
    page.goto(address)
    names = page.locator("#scans a")
    expect(names).to_have_text(["Left again", "Right"])
    page.get_by_role("link", name="Older scans").click()
    expect(names).to_have_text(["Left"])
    page.get_by_role("link", name="Newest scans").click()
    expect(names).to_have_text(["Left again", "Right"])
    page.get_by_label("Name, notes or id").fill("left")
    expect(names).to_have_text(["Left again", "Left"])
    assert page.url.endswith("#/?text=left")
    page.reload()
    expect(names).to_have_text(["Left again", "Left"])
    page.get_by_label("Name, notes or id").fill("middle")
    page.get_by_text("No scan has this text.").wait_for()


def test_errors_are_shown_as_text(page, address, tmp_path):
    (tmp_path / "notes.h5").write_text("only text")
    (tmp_path / "empty.h5").touch()
    page.goto(address)
    page.set_input_files("#scan-file", tmp_path / "empty.h5")
    expect(page.locator("#scan-error")).to_have_text("empty.h5 is empty.")
    page.set_input_files("#scan-file", tmp_path / "notes.h5")
    alert = page.locator("#scan-error")
    found = "Found a file that is not HDF5 (it begins with 'only tex'); accepted: a scan in HDF5, MATLAB "
    found += "or NumPy (.npz), or a zip or folder of a documented format."
    expect(alert).to_contain_text(f"notes.h5 is not a scan, a volume or a mesh that can be read. {found}")
    alert.get_by_role("link", name="Accepted formats").click()
    page.get_by_role("heading", name="Scans", exact=True).wait_for()
    assert page.url.endswith("/docs/formats#scans")
    page.get_by_role("heading", name="openUSCT (HDF5)").wait_for()


def test_a_volume_a_mesh_and_a_scan_open_on_their_own_pages(page, address, scan):
    content = io.BytesIO()
    np.savez(content, volume=np.round(200.0 * sampled(ONE_HOLE, 12)).astype(np.uint8))
    page.goto(address)
    page.locator("#scan-drop").wait_for()
    # By its content: the service refuses it as a scan first.
    drop(page, "#scan-drop", ball=content.getvalue(), suffix=".npz")
    page.locator(".readout").wait_for()
    assert "#/rendering/vol-" in page.url
    ring = torus(12, 8)
    mesh = trimesh.Trimesh(ring.vertices, ring.faces, process=False).export(file_type="ply")
    # What was refused is read before another page opens.
    drop(page, "#volume-drop", ring=mesh, notes=b"only text", suffix="")
    expect(page.locator("#volume-error")).to_contain_text("notes is not a scan, a volume or a mesh that ")
    assert "#/rendering/vol-" in page.url
    drop(page, "#volume-drop", ring=mesh, suffix="")
    page.get_by_text("192 faces").wait_for()
    assert "#/surfaces/mesh-" in page.url
    drop(page, "#mesh-drop", ring=mesh[:200], suffix=".ply")
    expect(page.locator("#mesh-error")).to_contain_text("ring.ply is not a mesh that can be read. ")
    drop(page, "#mesh-drop", scan=scan().read_bytes())
    page.get_by_role("heading", name="Sixteen elements").wait_for()


@pytest.mark.nightly
def test_own_variables_are_named_in_a_form_that_opens_when_a_file_is_rejected(page, address, tmp_path):
    savemat(tmp_path / "scan.mat", {"pos": 1e3 * positions(), "dtof": 1e6 * delta_tof()})
    page.goto(address)
    page.set_input_files("#scan-file", tmp_path / "scan.mat")
    page.locator("#scan-error").wait_for()
    assert "--map element_position=NAME" in page.locator("#scan-error").inner_text()
    assert page.locator("#scan-own").get_attribute("open") is not None
    page.get_by_label("Variables, FIELD=NAME").fill("element_position=pos, delta_tof=dtof")
    page.get_by_label("Lengths").select_option("mm")
    page.get_by_label("Times").select_option("us")
    page.get_by_label("Water, °C").fill("24")
    page.get_by_role("button", name="Send the file again").click()
    expect(page.locator("#dataset-facts")).to_contain_text("water 1494")


@pytest.mark.nightly
def test_a_sample_scan_is_simulated_and_opened(page, address, monkeypatch):
    requests = simulating(monkeypatch)
    page.goto(address)
    page.get_by_role("button", name="Simulate a sample scan").click()
    page.get_by_role("heading", name="A phantom").wait_for()
    assert "#/scans/" in page.url
    (request,) = requests
    assert request == PhantomScan(**SAMPLE).chosen()


def renamed_in_place(page, row, name, route):
    """Rename what a row of a list shows to "Another name", after a change of mind and a lost connection."""
    expect(row.locator(".thumbnail")).to_have_js_property("naturalWidth", 96)
    pencil, field = row.get_by_role("button", name=f"Rename {name}"), row.get_by_label(f"New name of {name}")
    pencil.click()
    page.keyboard.type("Not this")
    page.keyboard.press("Escape")
    expect(pencil).to_be_focused()
    page.keyboard.press("Enter")
    expect(field).to_have_value(name)
    page.keyboard.type("Another name")
    page.route(route, lambda sent: sent.abort() if sent.request.method == "PATCH" else sent.continue_())
    page.keyboard.press("Enter")
    row.get_by_text("The service does not answer.").wait_for()
    page.unroute(route)
    expect(field).to_have_value("Another name")
    page.keyboard.press("Enter")
    expect(row.get_by_role("link", name="Another name")).to_be_visible()


@pytest.fixture
def in_pieces(page):
    """Let the page send pieces of 4096 bytes, as if the file were large."""

    def small(route):
        answer = route.fetch()
        route.fulfill(response=answer, body=answer.text().replace("8 * 2 ** 20", "4096"))

    page.route("**/resumable_upload.js", small)


def test_an_upload_goes_on_after_a_broken_connection_and_is_listed(page, address, scan, in_pieces):
    """The first piece arrives, and the second breaks off."""
    sent: list[int] = []
    asked: list[str] = []

    def broken(route):
        asked.append(route.request.method)
        if asked[-1] == "PATCH":
            sent.append(int(route.request.headers["upload-offset"]))
        if asked[-1] == "PATCH" and len(sent) == 2:
            route.abort()
        # As nginx answers for a service that restarts.
        elif asked[-1] == "HEAD" and asked.count("HEAD") == 1:
            route.fulfill(status=502)
        else:
            route.continue_()

    page.route("**/v1/uploads/*", broken)
    page.goto(address)
    file = scan()
    page.set_input_files("#scan-file", file)
    page.get_by_role("heading", name="Sixteen elements").wait_for()
    page.get_by_role("link", name="Scans", exact=True).click()
    renamed_in_place(page, page.locator("#scans li").first, "Sixteen elements", "**/v1/datasets/*")
    page.get_by_role("link", name="Another name").first.click()
    expect(page.locator("#dataset-facts")).to_contain_text("16 emitters")
    assert file.stat().st_size > 3 * 4096
    assert sent[:3] == [0, 4096, 4096]
    assert sent[-1] == (file.stat().st_size - 1) // 4096 * 4096


@pytest.mark.nightly
def test_an_upload_that_a_closed_page_left_is_continued(page, address, scan, in_pieces):
    file = scan()
    page.goto(address)
    offsets: list[int] = []

    def first_piece_only(route):
        if route.request.method != "PATCH":
            return route.continue_()
        offsets.append(int(route.request.headers["upload-offset"]))
        return route.continue_() if offsets[-1] == 0 or len(offsets) > 2 else None

    page.route("**/v1/uploads/*", first_piece_only)
    page.set_input_files("#scan-file", file)
    while len(offsets) < 2:
        page.wait_for_timeout(50)
    page.reload()
    page.set_input_files("#scan-file", file)
    page.get_by_role("heading", name="Sixteen elements").wait_for()
    assert offsets[:3] == [0, 4096, 4096]
    assert page.evaluate("localStorage.length") == 0
