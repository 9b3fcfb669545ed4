"""The page / in a real browser: upload, start, progress, error messages."""

import io
import re
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest
import trimesh
from playwright.sync_api import expect, sync_playwright
from scipy.io import savemat

from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.tomography.settings import Settings
from bentray_service.jobs import kinds
from bentray_service.rows.api_key import ApiKey

from ...workers.foreign_scans.scans import delta_tof, positions

CHROMIUM = Path("/usr/bin/chromium")
# A machine under load may be slow, and the first picture waits for kernels that are not compiled yet.
PATIENCE_MS = 60_000

expect.set_options(timeout=PATIENCE_MS)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"no browser at {CHROMIUM}"),
]


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def page(browser):
    """A page of its own context, so that no test sees cookies or storage of another."""
    with browser.new_context() as context:
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "console",
            lambda message: wrong.append(message.text) if "Security Policy" in message.text else None,
        )
        yield page
        assert wrong == []


def test_empty_list_shows_instructions(page, serve):
    page.goto(serve())
    page.get_by_text("Nothing has run yet").wait_for()
    page.get_by_text("ready, 1 worker").wait_for()
    assert page.get_by_role("button", name="Fast").is_disabled()
    assert page.get_by_role("button", name="Best").is_disabled()
    page.get_by_text("Other settings").click()
    expect(page.get_by_label("Iterations")).to_have_value(str(Settings(method="sart").iterations))


def test_upload_start_watch(page, serve, scan, work):
    page.goto(serve())
    page.set_input_files("#scan-file", scan())
    page.get_by_text("scan.h5 is stored").wait_for()
    page.get_by_text("16 emitters").wait_for()
    page.get_by_text("Other settings").click()
    page.get_by_label("one emitter after another").check()
    page.get_by_label("Straight").check()
    page.get_by_label("Nodes per side").fill("32")
    work.hold.clear()
    page.get_by_role("button", name="Start").click()
    job = page.locator(".job")
    job.get_by_text("running").wait_for()
    work.hold.set()
    job.get_by_text("succeeded").wait_for()
    job.get_by_text("residual 2.00 µs").wait_for()
    assert job.get_by_role("heading", name="Straight rays").is_visible()
    assert work.calls[0][1].nodes == 32
    image = job.locator("img")
    image.scroll_into_view_if_needed()
    expect(image).to_have_js_property("complete", True)
    assert image.evaluate("image => image.naturalWidth") > 0
    assert page.get_by_text("Nothing has run yet").is_hidden()


def test_automatic_method_hides_the_ray_choice(page, serve, scan, work):
    page.goto(serve())
    page.set_input_files("#scan-file", scan())
    page.get_by_text("16 emitters").wait_for()
    page.get_by_text("Other settings").click()
    expect(page.get_by_label("Straight")).to_be_disabled()
    page.get_by_role("button", name="Start").click()
    job = page.locator(".job")
    job.get_by_text("succeeded").wait_for()
    assert job.get_by_role("heading", name="Automatic").is_visible()
    assert work.calls[0][1].method == "auto"
    expect(job.locator("img")).to_have_count(1)
    page.get_by_label("all emitters at once").check()
    expect(page.get_by_label("Straight")).to_be_enabled()
    page.get_by_label("Straight").check()
    page.get_by_role("button", name="Start").click()
    page.get_by_role("heading", name="Straight rays").wait_for()
    expect(page.get_by_text("succeeded")).to_have_count(2)
    assert (work.calls[1][1].method, work.calls[1][1].rays) == ("gauss-newton", "straight")


def test_the_residual_curve_shows_where_a_stage_begins(page, serve, scan, work):
    work.stages = 2
    page.goto(serve())
    page.set_input_files("#scan-file", scan())
    page.get_by_text("16 emitters").wait_for()
    page.get_by_text("Other settings").click()
    page.get_by_label("Iterations").fill("3")
    page.get_by_role("button", name="Start").click()
    curve = page.get_by_role("img", name="Residual of 6 iterations in 2 stages")
    curve.wait_for()
    points = curve.locator("polyline").get_attribute("points").split(" ")
    assert [round(float(point.split(",")[0])) for point in points] == [0, 20, 40, 60, 80, 100]
    border = curve.locator("line.stage")
    assert (border.count(), float(border.get_attribute("x1"))) == (1, 50.0)


def test_a_volume_in_space_is_shown_as_glass(page, serve, scan, work, monkeypatch):
    plain = type(work).__call__

    def in_space(self, *given, **named):
        result = plain(self, *given, **named)
        ball = 40.0 * sampled(ONE_HOLE, 16)
        return replace(
            result,
            speed=1500.0 + ball,
            coverage=np.ones(ball.shape),
            spacing_m=(1e-3,) * 3,
            origin_m=(0.0,) * 3,
        )

    page.goto(serve())
    page.set_input_files("#scan-file", scan())
    page.get_by_text("16 emitters").wait_for()
    page.get_by_role("button", name="Fast").click()
    page.get_by_role("img", name="Sound speed, Sixteen elements").wait_for()
    page.wait_for_load_state("networkidle")
    expect(page.get_by_text("Volume rendering", exact=True).and_(page.locator("#jobs *"))).to_have_count(0)
    monkeypatch.setattr(type(work), "__call__", in_space)
    page.get_by_role("button", name="Fast").click()
    image = page.get_by_role("img", name="Volume rendering, Sixteen elements")
    image.wait_for()
    image.scroll_into_view_if_needed()
    expect(image).to_have_js_property("naturalWidth", 512)
    assert image.get_attribute("src").endswith(
        "?iso=1520&outside=1&index=0.974&surroundings=0&elevation_deg=35"
    )
    expect(page.get_by_text("Volume rendering", exact=True).and_(page.locator("#jobs *"))).to_have_count(1)


def test_a_turntable_is_shown(page, serve, scan, work, monkeypatch):
    monkeypatch.setattr(kinds, "draw_turntable", lambda *args, **control: args[3].write_bytes(b"pictures"))
    address = serve()
    values = io.BytesIO()
    np.save(values, sampled(ONE_HOLE, 12))
    stream = {"Content-Type": "application/octet-stream"}
    sent = httpx.post(f"{address}/v1/volumes", content=values.getvalue(), headers=stream, timeout=60).json()
    asked = {
        "kind": "refraction",
        "volume": sent["id"],
        "settings": {"frames": 5, "width": 300, "iso": [0.3, 0.6], "index": [1.3, 1.4]},
    }
    httpx.post(f"{address}/v1/jobs", json=asked).raise_for_status()
    page.goto(address)
    job = page.locator(".job")
    job.get_by_role("heading", name="Turntable").wait_for()
    job.get_by_text("5 frames of 300").wait_for()
    link = job.get_by_role("link", name="Frames")
    link.wait_for()
    assert link.get_attribute("href").endswith("/animation")
    image = job.get_by_role("img")
    image.scroll_into_view_if_needed()
    expect(image).to_have_js_property("naturalWidth", 300)
    assert "iso=0.3&iso=0.6&" in image.get_attribute("src")


def saved(tmp_path, values):
    np.save(tmp_path / "ball.npy", values)
    return tmp_path / "ball.npy"


def test_a_volume_is_uploaded_looked_at_and_turned(page, serve, work, tmp_path, monkeypatch):
    monkeypatch.setattr(kinds, "draw_turntable", lambda *args, **control: args[3].write_bytes(b"pictures"))
    page.goto(serve())
    turn = page.get_by_role("button", name="Render a turntable")
    expect(turn).to_be_disabled()
    page.set_input_files("#volume-file", saved(tmp_path, sampled(ONE_HOLE, 12)))
    page.get_by_text("ball.npy is stored").wait_for()
    page.get_by_text(re.compile("^12 . 12 . 12 nodes")).wait_for()
    image = page.get_by_role("img", name="Volume rendering of ball.npy")
    expect(image).to_have_js_property("naturalWidth", 512)
    assert image.get_attribute("src").endswith("/refraction.png?azimuth_deg=30&elevation_deg=20")
    page.get_by_label("Iso-value").fill("0.4")
    page.get_by_label("Azimuth").fill("75")
    page.get_by_label("Frames per turn").fill("7")
    expect(image).to_have_attribute("src", re.compile("iso=0.4&azimuth_deg=75&"))
    turn.click()
    job = page.locator(".job")
    job.get_by_text("7 frames of 512").wait_for()
    job.get_by_text("ball.npy").wait_for()
    link = job.get_by_role("link", name="Frames")
    with page.expect_download() as download:
        link.click()
    assert download.value.suggested_filename.endswith(".apng")
    assert download.value.path().read_bytes() == b"pictures"


def test_display_errors_are_shown_as_text(page, serve, tmp_path):
    page.goto(serve())
    page.set_input_files("#volume-file", saved(tmp_path, sampled(ONE_HOLE, 12)))
    page.get_by_text("ball.npy is stored").wait_for()
    page.get_by_label("Iso-value").fill("7")
    page.get_by_label("Iso-value").press("Tab")
    expect(page.locator("#look-error")).to_contain_text("iso: found 7; accepted: ")
    (tmp_path / "notes.txt").write_text("only text")
    page.set_input_files("#volume-file", tmp_path / "notes.txt")
    expect(page.locator("#volume-error")).to_contain_text("NRRD")


def test_a_mesh_is_uploaded_and_its_field_looked_at(page, serve, tmp_path, monkeypatch):
    build = kinds.geometry_field.build_field

    def small(_, mesh, settings, *folders, **control):
        # The settings of the page take seconds.
        coarse = replace(settings, inner_samples=4, divisions=4, image_size=33)
        return build(None, mesh, coarse, *folders, **control)

    monkeypatch.setattr(kinds.geometry_field, "build_field", small)
    ring = torus(16, 10)
    content = trimesh.Trimesh(ring.vertices, ring.faces, process=False).export(file_type="ply")
    (tmp_path / "ring.ply").write_bytes(content)
    page.goto(serve())
    make = page.get_by_role("button", name="Build the geometry field")
    expect(make).to_be_disabled()
    page.set_input_files("#mesh-file", tmp_path / "ring.ply")
    page.get_by_text("ring.ply is stored").wait_for()
    page.get_by_text("320 faces · closed · 1 handle").wait_for()
    expect(page.get_by_label("Samples per edge")).to_have_value("24")
    page.get_by_label("Samples per edge").fill("6")
    make.click()
    job = page.locator(".job")
    job.get_by_role("heading", name="Geometry field").wait_for()
    job.get_by_text("6 samples per edge").wait_for()
    image = page.get_by_role("img", name="ring.ply, reflect")
    expect(image).to_have_js_property("naturalWidth", 512)
    assert job.get_by_role("link", name="Normal map").get_attribute("href").endswith("/normal-map.png")
    page.get_by_label("Scene").select_option("two-mirrors")
    page.get_by_label("Material").select_option("glass")
    image = page.get_by_role("img", name="ring.ply, refract")
    expect(image).to_have_attribute("src", re.compile("mode=refract&scene=two-mirrors&"))
    (tmp_path / "notes.txt").write_text("only text")
    page.set_input_files("#mesh-file", tmp_path / "notes.txt")
    expect(page.locator("#mesh-error")).to_contain_text("PLY")


def test_cancel(page, serve, scan, work):
    page.goto(serve())
    page.set_input_files("#scan-file", scan())
    page.get_by_text("16 emitters").wait_for()
    work.hold.clear()
    page.get_by_role("button", name="Fast").click()
    page.get_by_role("button", name="Cancel").click()
    page.locator(".state", has_text="cancelled").wait_for()


def test_errors_are_shown_as_text(page, serve, tmp_path):
    (tmp_path / "notes.h5").write_text("only text")
    page.goto(serve())
    page.set_input_files("#scan-file", tmp_path / "notes.h5")
    alert = page.locator("#scan-error")
    alert.wait_for()
    assert "HDF5" in alert.inner_text()


def test_by_keyboard_alone(page, serve, scan, work):
    page.goto(serve())
    page.set_input_files("#scan-file", scan())
    page.get_by_text("16 emitters").wait_for()
    page.locator("#dataset").focus()
    for _ in range(20):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "start":
            break
    page.keyboard.press("Enter")
    page.locator(".job").wait_for()


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
    page.get_by_text("Tenant local (metrics, read, write)").wait_for()
    expect(page.locator("#key")).to_be_hidden()
    page.set_input_files("#scan-file", scan())
    page.get_by_text("scan.h5 is stored").wait_for()
    page.get_by_text("Other settings").click()
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


def test_simulated_scan_can_be_reconstructed(page, serve, monkeypatch):
    made = {"title": "A phantom", "source": "", "license": "", "dimension": 2, "elements": 16, "ntx": 16}
    made |= {"nrx": 16, "slices": 1, "has_traces": False, "has_travel_times": True, "has_truth": True}
    made |= {"water_speed_mps": 1500.0, "bytes": 1, "sha256": "0" * 64}

    def simulate_scan(client, request, target, work_dir, **control):
        target.write_bytes(b"scan")
        return made

    monkeypatch.setattr(kinds, "simulate_to_file", simulate_scan)
    url = serve()
    asked = {"kind": "simulation", "settings": {"nodes": 16, "elements": 16}}
    assert httpx.post(f"{url}/v1/jobs", json=asked).status_code == 202
    page.goto(url)
    job = page.locator(".job")
    job.get_by_role("heading", name="Simulated scan").wait_for()
    job.get_by_text("succeeded").wait_for()
    job.get_by_text("A phantom").wait_for()
    expect(page.get_by_label("Scan to reconstruct")).to_contain_text("A phantom")
    whole = job.get_by_text("the largest (")
    assert whole.is_hidden()
    job.get_by_text("Plan: 2 tasks").click()
    assert whole.is_visible()


def test_own_variables_are_named_in_a_form_that_opens_when_a_file_is_rejected(page, serve, tmp_path):
    savemat(tmp_path / "scan.mat", {"pos": 1e3 * positions(), "dtof": 1e6 * delta_tof()})
    page.goto(serve())
    page.set_input_files("#scan-file", tmp_path / "scan.mat")
    page.locator("#scan-error").wait_for()
    assert "--map element_position=NAME" in page.locator("#scan-error").inner_text()
    assert page.locator("#scan-own").get_attribute("open") is not None
    page.get_by_label("Variables, FIELD=NAME").fill("element_position=pos, delta_tof=dtof")
    page.get_by_label("Lengths").select_option("mm")
    page.get_by_label("Times").select_option("us")
    page.get_by_label("Water, °C").fill("24")
    page.get_by_role("button", name="Send the file again").click()
    page.get_by_text("scan.mat is stored").wait_for()
    expect(page.locator("#dataset-facts")).to_contain_text("water 1494")
