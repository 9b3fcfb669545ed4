"""The page of a scan: its geometry, quality and traces; start a reconstruction, watch it."""

import re
from dataclasses import replace

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

from bentray_kernels.acquisition import speed_from_temperature
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_workers.files.dataset import write_dataset

from ...effort import effort
from ...kernels.acquisition.traces import blob_delay
from ...kernels.acquisition.traces import scan as trace_scan
from .conftest import serious
from .live_results import uploaded

pytestmark = pytest.mark.browser

# All pixels of a canvas as text.
PIXELS = "canvas => canvas.toDataURL()"


def sent(page, address, scan):
    """The page of a scan that has just been uploaded."""
    page.goto(f"{address}/#/scans/{uploaded(address, scan())['id']}")
    page.get_by_text("16 emitters").wait_for()


# With a key: the first test of test_shell.py.
@pytest.mark.nightly
def test_changed_settings_are_sent_and_the_job_is_watched(page, address, scan, work):
    sent(page, address, scan)
    page.get_by_text("All settings").click()
    page.get_by_label("Method", exact=True).select_option("SART")
    page.get_by_label("Rays", exact=True).select_option("Straight")
    page.get_by_label("Nodes per side").fill("32")
    page.get_by_text("Advanced").click()
    page.get_by_label("Iterations").fill("2")
    page.get_by_label("Speed bounds, highest").fill("1700")
    page.get_by_label("Check the scan first").uncheck()
    work.hold.clear()
    with page.expect_request("**/v1/jobs") as asked:
        page.get_by_role("button", name="Start").click()
    assert asked.value.post_data_json["settings"] == {
        "method": "sart",
        "rays": "straight",
        "nodes": 32,
        "iterations": 2,
        "speed_bounds_mps": [1300, 1700],
        "picking": {"examine": False},
    }
    job = page.locator(".job")
    job.get_by_text("running").wait_for()
    work.hold.set()
    job.get_by_text("succeeded").wait_for()
    job.get_by_text("residual 2,000 ns").wait_for()
    assert job.get_by_role("heading", name="Straight rays").is_visible()
    settings = work.calls[0][1]
    assert (settings.method, settings.nodes, settings.iterations) == ("sart", 32, 2)
    image = job.locator("img")
    image.scroll_into_view_if_needed()
    expect(image).not_to_have_js_property("naturalWidth", 0)
    assert page.get_by_text("Nothing has run yet").is_hidden()
    # Another one is cancelled here; on the page of a job: test_live_page.py.
    work.hold.clear()
    page.locator("#start").click()
    page.get_by_role("button", name="Cancel").click()
    page.locator(".state", has_text="cancelled").wait_for()


@pytest.mark.nightly
def test_every_setting_has_a_field_with_its_default(page, address, scan):
    sent(page, address, scan)
    page.get_by_text("Nothing has run yet").wait_for()
    page.get_by_text("All settings").click()
    page.get_by_label("Nodes per side").wait_for()
    for place in PLACES.values():
        record, _, leaf = place.rpartition(".")
        value = getattr(getattr(Settings(), record) if record else Settings(), leaf)
        if isinstance(value, tuple):
            for end, one in enumerate(value):
                expect(page.locator(f'[name="{place}.{end}"]')).to_have_value(f"{one:g}")
        elif isinstance(value, bool):
            expect(page.locator(f'[name="{place}"]')).to_be_checked(checked=value)
        else:
            shown = "" if value is None else f"{value:g}" if isinstance(value, int | float) else value
            expect(page.locator(f'[name="{place}"]')).to_have_value(shown)
    assert page.locator("#run-settings .setting :is(input, select)").count() == len(PLACES) + 1


def test_a_refused_setting_is_told_at_its_field(page, address, scan, work):
    sent(page, address, scan)
    page.get_by_text("All settings").click()
    nodes = page.get_by_label("Nodes per side")
    nodes.fill("3")
    field = page.locator(".setting", has=nodes)
    # Before anything is started, by the plan.
    expect(field.get_by_role("alert")).to_have_text("Found 3; accepted: a number from 16 to 2048.")
    page.get_by_role("button", name="Start").click()
    expect(nodes).to_be_focused()
    expect(nodes).to_have_attribute("aria-invalid", "true")
    assert page.locator("#run-error").is_hidden()
    nodes.fill("16")
    expect(field.get_by_role("alert")).to_be_hidden()
    # Six settings come first, and what has no effect beside the others is not shown.
    shown, find = page.locator("#run-settings .setting:visible"), page.get_by_label("Find a setting")
    find.fill("may be left out")
    expect(shown).to_have_count(1)
    find.fill("check the scan")
    page.get_by_label("Check the scan first").uncheck()
    find.fill("may be left out")
    expect(shown).to_have_count(0)
    find.fill("speed bounds")
    lowest = page.get_by_label("Speed bounds, lowest")
    lowest.fill("1900")
    # Which the service knows, and the form does not.
    expect(page.locator(".setting", has=lowest).get_by_role("alert")).to_contain_text("Found")
    lowest.fill("1400")
    page.get_by_text("16 nodes per side").wait_for()
    page.get_by_role("button", name="Start").click()
    page.locator(".job").get_by_text("succeeded").wait_for()
    assert work.calls[0][1].speed_bounds_mps == (1400.0, 1800.0)
    assert len(work.calls) == 1


@pytest.mark.nightly
def test_the_buttons_tell_their_time(page, serve, scan, work):
    sent(page, serve(), scan)
    expect(page.locator("#start")).to_contain_text(re.compile(r"about \d+ s, rough"))
    for done in (1, 2, 3):
        page.locator("#start").click()
        expect(page.locator(".job").get_by_text("succeeded")).to_have_count(done)
    fast = page.locator("#start")
    expect(fast).to_contain_text(re.compile(r"about \d+ s$"))
    # No traces, no waves: Best is the same work.
    expect(page.get_by_role("button", name="Best")).to_contain_text(re.compile(r"about \d+ s$"))


@pytest.mark.nightly
def test_the_residual_curve_shows_where_a_stage_begins(page, address, scan, work):
    work.stages = 2
    sent(page, address, scan)
    page.get_by_text("All settings").click()
    page.get_by_text("Advanced").click()
    page.get_by_label("Iterations").fill("3")
    page.get_by_role("button", name="Start").click()
    curve = page.get_by_role("img", name="Residual of 6 iterations in 2 stages")
    curve.wait_for()
    points = curve.locator("polyline").get_attribute("points").split(" ")
    assert [round(float(point.split(",")[0])) for point in points] == [0, 20, 40, 60, 80, 100]
    border = curve.locator("line.stage")
    assert (border.count(), float(border.get_attribute("x1"))) == (1, 50.0)


@pytest.mark.nightly
def test_a_volume_in_space_is_shown_as_glass(page, address, scan, work, monkeypatch):
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

    sent(page, address, scan)
    page.locator("#start").click()
    page.get_by_role("img", name="Sound speed, Sixteen elements").wait_for()
    page.get_by_text("Sound speed, 1500 (dark) to").wait_for()
    expect(page.get_by_text("Volume rendering", exact=True).and_(page.locator("#jobs *"))).to_have_count(0)
    monkeypatch.setattr(type(work), "__call__", in_space)
    page.locator("#start").click()
    image = page.get_by_role("img", name="Volume rendering, Sixteen elements")
    image.wait_for()
    image.scroll_into_view_if_needed()
    expect(image).to_have_js_property("naturalWidth", 512)
    assert image.get_attribute("src").endswith(
        "?iso=1520&outside=1&index=0.974&surroundings=0&elevation_deg=35"
    )
    expect(page.get_by_text("Volume rendering", exact=True).and_(page.locator("#jobs *"))).to_have_count(1)


def with_traces(address, folder):
    """The record of a scan with traces that has just been uploaded."""
    write_dataset(folder / "traced.h5", trace_scan(blob_delay(12), elements=12, noise=0.01))
    return uploaded(address, folder / "traced.h5")


def opened(page, address, scan):
    """Open the page of a scan; returns what the service tells about it, by the end of the address."""
    here = f"{address}{scan['links']['self']}"
    page.goto(f"{address}/#/scans/{scan['id']}")
    return lambda what: httpx.get(f"{here}/{what}".rstrip("/"), timeout=60.0).json()


@pytest.fixture(scope="module")
def shared_scan(shared_service):
    return with_traces(shared_service.address, shared_service.folder)


@pytest.fixture
def traced(page, shared_service, shared_scan):
    """The page of a scan with traces, for tests that leave it as it is; see ``opened``."""
    return opened(page, shared_service.address, shared_scan)


@pytest.fixture
def own_traced(page, address, tmp_path):
    """A traced scan that the test may change."""
    return opened(page, address, with_traces(address, tmp_path))


def busy(**queue):
    """An answer of GET /v1/cluster with two busy workers."""
    return {"workers": [{"compiling": False}] * 2, "queue": {"drawing_workers": 2, "all_running": 1, **queue}}


def test_the_numbers_of_the_page_are_those_of_the_service(page, traced):
    facts = page.locator("#scan-facts")
    expect(facts).to_contain_text("8.000 MHz")
    geometry, report = traced("geometry"), traced("quality")
    expect(facts).to_contain_text(f"{geometry['center_frequency_hz'] / 1e3:.1f} kHz, stated in the file")
    expect(facts).to_contain_text(f"{geometry['samples']} samples from {1e6 * geometry['t0_s']:.2f} µs")
    expect(facts).to_contain_text(f"{geometry['water_speed_mps']:.1f} m/s")
    usable, pairs = report["usable_pairs"], report["pairs"]
    quality = page.locator("#quality")
    expect(quality).to_contain_text(f"{usable} of {pairs} pairs ({100 * usable / pairs:.1f} %)")
    expect(quality.locator("ul:not(details *) > li")).to_have_count(len(report["findings"]))
    for finding in report["findings"]:
        expect(quality).to_contain_text(finding["found"])
    # The picture of the report is held back, and two workers are busy.
    held = []
    page.route("**/quality.png", lambda route: held.append(route))
    loads = [{"waiting_images": 1, "images_s": 3.2}, {"waiting_images": 0, "images_s": None}]
    page.route("**/v1/cluster", lambda route: route.fulfill(json=busy(**loads[0])))
    page.get_by_text("Matrix and histogram of the travel times").click()
    page.get_by_text("Drawing the report · waiting for a worker: 2 of 2 busy, about 4 s").wait_for()
    del loads[0]
    page.get_by_text("Drawing the report · a worker computes it", exact=True).wait_for()
    held[0].continue_()
    report = page.get_by_role("img", name="matrix and histogram of the travel times")
    expect(report).not_to_have_js_property("naturalWidth", 0)
    assert httpx.get(page.get_by_role("link", name="Quality report").evaluate("one => one.href")).is_success
    expect(page.get_by_text("Drawing the report")).to_have_count(0)
    drawing = page.get_by_role("img", name="12 elements, 12 emit, 12 receive")
    expect(drawing.locator(".emitter")).to_have_count(12)
    expect(drawing.locator(".receiver")).to_have_count(12)


def test_a_water_that_is_only_reported_is_used_at_the_press_of_a_button(page, address, tmp_path):
    """The stated speed is that of water 10 °C warmer than the traces say."""
    dataset = trace_scan(blob_delay(16), elements=16, noise=0.01)
    wrong = replace(dataset, water_speed_mps=dataset.water_speed_mps + 20.0)
    write_dataset(tmp_path / "warm.h5", wrong)
    scan = uploaded(address, tmp_path / "warm.h5")
    page.goto(f"{address}/#/scans/{scan['id']}")
    advice = page.locator("#quality li", has_text="water speed")
    expect(advice).to_contain_text("Only reported: reconstructions use the data as they are.")
    advice.get_by_role("button", name="Use water of").click()
    expect(page.locator("#scan-facts")).to_contain_text("stated on this page")
    now = httpx.get(f"{address}/v1/datasets/{scan['id']}", timeout=60.0).json()
    assert speed_from_temperature(now["water_temperature_c"]) == pytest.approx(
        dataset.water_speed_mps, abs=3.0
    )
    expect(page.locator("#quality li", has_text="water speed")).to_have_count(0)


@pytest.mark.nightly
def test_the_slider_changes_the_emission(page, traced):
    told = page.locator("#shot-facts")
    expect(told).to_contain_text("Emission 0 by element 0")
    before = page.locator("#shot canvas").evaluate(PIXELS)
    slider = page.get_by_role("slider", name="Emission")
    slider.focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    expect(told).to_contain_text("Emission 3 by element 3")
    expect(page.get_by_label("Emission number")).to_have_value("3")
    assert page.locator("#shot canvas").evaluate(PIXELS) != before
    shot = traced("traces?emission=3")
    known = [pick for pick in shot["pick_s"] if pick is not None]
    expect(told).to_contain_text(f"arrivals in {len(known)} of 12")
    page.locator("#shot").focus()
    for _ in range(8):
        page.keyboard.press("ArrowRight")
    pick, straight = shot["pick_s"][8], shot["straight_s"][8]
    values = page.locator("#shot-values")
    expect(values).to_contain_text("Receiving element 8")
    expect(values).to_contain_text(
        f"straight line {1e6 * straight:.2f} µs, with the object {1e6 * pick:.2f} µs"
    )
    page.get_by_label("Emission number").fill("99")
    page.keyboard.press("Tab")
    expect(told).to_contain_text("Emission 11 by element 11")
    water = "traces?emission=11&slice=0&quantity=water"
    with page.expect_response(lambda answer: answer.url.endswith(water)) as answer:
        page.locator("#shot-quantity").select_option("water")
    assert answer.value.ok
    expect(page.locator("#shot-error")).to_be_hidden()
    # The element that emits is marked in the drawing.
    marked = page.locator("#elements .chosen")
    expect(marked).to_have_attribute("cx", page.locator("#elements .emitter").nth(11).get_attribute("cx"))


@pytest.mark.nightly
def test_name_notes_and_water_are_edited(page, own_traced, work):
    traced = own_traced
    expect(page.locator("#shot-values")).to_contain_text("Receiving element 0")
    straight = traced("traces?emission=0")["straight_s"][5]
    # No name is left behind by notes alone.
    page.get_by_role("button", name="Edit name").click()
    page.get_by_label("Notes").fill("Second visit.\nLeft.")
    page.get_by_role("button", name="Save").click()
    expect(page.locator("#scan-notes")).to_have_text("Second visit.\nLeft.")
    kept = traced("")
    assert (kept["title"], kept["notes"]) == ("", "Second visit.\nLeft.")
    expect(page.get_by_role("heading", level=1)).to_have_text(kept["id"])
    page.get_by_role("button", name="Edit name").click()
    page.get_by_label("Name", exact=True).fill("Left, warm")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Left, warm")
    page.get_by_role("button", name="Correct the water temperature").click()
    expect(page.locator("#edit-form").get_by_label("Water temperature (°C)")).to_be_focused()
    page.keyboard.type("31.5")
    page.keyboard.press("Enter")
    facts = page.locator("#scan-facts")
    expect(facts).to_contain_text(
        f"{speed_from_temperature(31.5):.1f} m/s, 31.5 °C, stated on this page; in the file: "
    )
    expect(page.locator("#dataset-facts")).to_contain_text("water 31.5 °C, stated here")
    # The straight line arrives earlier in warmer water.
    earlier = traced("traces?emission=0")["straight_s"][5]
    assert earlier < straight
    expect(page.locator("#shot-values")).to_contain_text("Receiving element 0")
    page.get_by_label("Receiver, from 0").fill("5")
    page.keyboard.press("Tab")
    expect(page.locator("#shot-values")).to_contain_text(f"straight line {1e6 * earlier:.2f} µs")
    page.locator("#start").click()
    page.locator(".job").get_by_text("succeeded").wait_for()
    assert [call[1].water_temperature_c for call in work.calls] == [31.5]
    # A setting of one reconstruction goes before what is stated of the scan.
    page.get_by_text("All settings").click()
    setting = page.locator("#run-settings .setting", has=page.locator('[name="water_temperature_c"]'))
    field = setting.get_by_label("Water temperature (°C)")
    expect(field).to_have_value("")
    expect(setting).to_contain_text("Empty: as the scan states it.")
    field.fill("200")
    expect(setting.get_by_role("alert")).to_contain_text("Found 200.0; accepted: a number from 0 to 95")
    field.fill("20")
    expect(setting.get_by_role("alert")).to_be_hidden()
    page.get_by_role("button", name="Start").click()
    expect(page.locator(".job").get_by_text("succeeded")).to_have_count(2)
    assert [call[1].water_temperature_c for call in work.calls] == [31.5, 20.0]
    page.reload()
    expect(page.get_by_role("heading", level=1)).to_have_text("Left, warm")
    page.get_by_role("button", name="Edit name").click()
    page.locator("#edit-form").get_by_label("Water temperature (°C)").fill("")
    # The reloaded page has no facts at first, so their absence would not show that it has saved.
    with page.expect_response(lambda answer: answer.request.method == "PATCH"):
        page.get_by_role("button", name="Save").click()
    expect(facts).to_contain_text("m/s")
    expect(facts).not_to_contain_text("stated on this page")
    assert traced("")["water_temperature_c"] is None


@pytest.mark.nightly
def test_a_scan_in_wrong_units_is_corrected_as_the_page_proposes(page, address, scan):
    def in_microseconds(file):
        file["traveltime/delta_tof_s"][...] *= 1e-3

    wrong = opened(page, address, uploaded(address, scan(in_microseconds)))
    proposed = page.locator("#proposed")
    expect(proposed).to_contain_text("Were times in ms read as µs?")
    page.get_by_role("button", name="Correct units, frequency or order").click()
    form = page.locator("#correct-form")
    expect(form.get_by_label("Times in the original file")).to_be_focused()
    expect(form.get_by_label("Times in the original file")).to_have_value("ms")
    expect(form.get_by_label("Times were read as")).to_have_value("us")
    # What is not plausible is refused, and the form stays.
    form.get_by_label("Lengths in the original file").select_option("um")
    form.get_by_role("button", name="Make a corrected copy").click()
    expect(form.get_by_role("alert")).to_contain_text("after the correction")
    form.get_by_label("Lengths in the original file").select_option("as they were read")
    form.get_by_label("Centre frequency (kHz)").fill("500")
    # The answer is lost, and the user presses again.
    page.route("**/corrections", lambda route: (route.fetch(), route.abort()))
    form.get_by_role("button", name="Make a corrected copy").click()
    expect(form.get_by_role("alert")).to_contain_text("does not answer")
    page.unroute("**/corrections")
    form.get_by_role("button", name="Make a corrected copy").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Sixteen elements, corrected")
    expect(page.locator("#scan-facts")).to_contain_text("500.0 kHz, stated in the file")
    expect(page.locator("#scan-notes")).to_contain_text("times in ms, read as us before")
    expect(page.locator("#proposed")).to_be_hidden()
    scan = wrong("")
    assert scan["notes"] == ""
    found = httpx.get(f"{address}/v1/datasets", params={"text": scan["id"]}).json()["datasets"]
    assert len(found) == 2, "the scan and one copy, whose notes name it"


@pytest.mark.nightly
def test_without_a_water_shot_there_is_none_to_choose(page, address, tmp_path):
    made = trace_scan(blob_delay(12), elements=12, noise=0.01)
    write_dataset(tmp_path / "bare.h5", replace(made, waveform=replace(made.waveform, water=None)))
    page.goto(f"{address}/#/scans/{uploaded(address, tmp_path / 'bare.h5')['id']}")
    expect(page.locator("#shot-legend")).to_contain_text("the scan has no water shot")
    expect(page.locator("#shot-quantity")).to_be_hidden()
    page.get_by_role("button", name="Edit name").click()
    for scheme in effort(["light"], ["light", "dark"]):
        page.emulate_media(color_scheme=scheme)
        assert serious(page) == {}
