"""Volume rendering: upload, orbit, histogram, settings, turntable."""

import io
import re
import time
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_service.jobs import kinds

from .live_results import stored_volume

pytestmark = pytest.mark.browser


def saved(tmp_path, values):
    np.save(tmp_path / "ball.npy", values)
    return tmp_path / "ball.npy"


def whole(page, **settings):
    """The canvas with the full picture of a view."""
    with_all = "".join(f"[data-address*='{name}={value}']" for name, value in settings.items())
    canvas = page.locator(f"#glass[data-quality=full]{with_all}")
    canvas.wait_for()
    return canvas


def settings_of(address):
    return {name: values[0] for name, values in parse_qs(urlsplit(address).query).items()}


@pytest.fixture(scope="module")
def stored(shared_service):
    """The address of the surface of a ball with a hole."""
    volume = stored_volume(shared_service.address, sampled(ONE_HOLE, 12))
    return f"{shared_service.address}/#/rendering/{volume['id']}?view=surface"


@pytest.fixture
def ball(page, stored):
    page.goto(stored)
    whole(page)


def test_a_volume_is_uploaded_looked_at_and_turned(page, serve, work, tmp_path, monkeypatch):
    monkeypatch.setattr(kinds, "draw_turntable", lambda *args, **control: args[3].write_bytes(b"pictures"))
    page.goto(serve() + "/#/rendering")
    turn = page.get_by_role("button", name="Render a turntable")
    expect(turn).to_be_disabled()
    page.set_input_files("#volume-file", saved(tmp_path, sampled(ONE_HOLE, 12)))
    page.get_by_text("ball.npy is stored").wait_for()
    page.get_by_text(re.compile("^12 . 12 . 12 nodes")).wait_for()
    # What is it? Three planes of its values come first, a lit surface second, glass third.
    expect(page.locator("canvas.plane")).to_have_count(3)
    expect(page.locator(".readout")).to_contain_text("node 6, 6, 6")
    value = float(page.locator(".readout").get_attribute("data-value"))
    assert value == pytest.approx(float(sampled(ONE_HOLE, 12)[6, 6, 6]), rel=1e-6)
    page.get_by_label("Between nodes").select_option("linear")
    page.wait_for_url(re.compile("#/rendering/vol-.*view=planes.*interpolation=linear"))
    expect(page.get_by_label("Iso-value", exact=True)).to_be_hidden()
    page.get_by_role("button", name="Surface", exact=True).click()
    image = page.get_by_role("img", name="Volume rendering of ball.npy")
    expect(image).to_have_attribute("data-address", re.compile("mode=shaded.*&width=512&height=512"))
    page.get_by_label("Glass").check()
    page.get_by_label("Iso-value", exact=True).fill("0.4")
    page.get_by_label("Azimuth, degrees").fill("75")
    page.get_by_label("Backdrop").select_option("warped picture")
    page.get_by_label("Supersampling").select_option("more rays")
    page.get_by_label("Smoothing").fill("0.5")
    page.get_by_label("Frames per turn").fill("7")
    whole(page, mode="refract", iso="0.4", azimuth_deg="75", backdrop="warped-picture")
    expect(page.locator("#turn-plan")).to_have_text(re.compile(r"^Turntable: about \d+ \w+, rough$"))
    expect(image).to_have_attribute(
        "data-address", re.compile("smoothing=0.5&.*supersampling=real&degree=2&")
    )
    turn.click()
    job = page.locator(".job")
    job.get_by_text("7 frames of 512").wait_for()
    job.get_by_text("ball.npy").wait_for()
    # The view of the planes is kept beside the surface.
    page.get_by_role("button", name="Planes", exact=True).click()
    expect(page.get_by_label("Between nodes")).to_have_value("linear")
    page.get_by_role("button", name="Surface", exact=True).click()
    link = job.get_by_role("link", name="Frames")
    with page.expect_download() as download:
        link.click()
    assert download.value.suggested_filename.endswith(".apng")
    assert download.value.path().read_bytes() == b"pictures"
    page.once("dialog", lambda dialog: dialog.accept())
    page.get_by_role("button", name="Delete the volume").click()
    expect(page.locator("#volume")).to_have_text("No 3-D volume yet")
    expect(page.get_by_role("button", name="Delete the volume")).to_be_hidden()


@pytest.mark.nightly
def test_dragging_turns_the_view_and_full_quality_follows(page, ball):
    before = whole(page, azimuth_deg="30").evaluate("canvas => canvas.toDataURL()")
    box = page.locator("#stage").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 140, box["y"] + 220)
    # While the pointer rests on the picture the view rests, too.
    page.locator("#glass[data-quality=preview], #glass[data-address*='azimuth_deg=60']").wait_for()
    page.mouse.up()
    canvas = whole(page, azimuth_deg="60", elevation_deg="30")
    expect(canvas).to_have_js_property("width", 512)
    assert canvas.evaluate("canvas => canvas.toDataURL()") != before
    expect(page.get_by_label("Azimuth, degrees")).to_have_value("60")
    assert page.get_by_role("img", name="azimuth 60°, elevation 30°").count() == 1
    # By a finger, and zoomed by two.
    touch = page.context.new_cdp_session(page)

    def touched(*moves):
        for kind, places in zip(("touchStart", "touchMove", "touchEnd"), (*moves, []), strict=True):
            fingers = [{"x": box["x"] + x, "y": box["y"] + 200, "id": k} for k, x in enumerate(places)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})

    touched([200], [220])
    expect(page.get_by_label("Azimuth, degrees")).to_have_value("50")
    touched([180, 220], [160, 240])
    expect(page.get_by_role("spinbutton", name="Zoom")).to_have_value("2")


@pytest.mark.nightly
def test_the_view_is_turned_by_keyboard_and_kept_in_the_address(page, ball):
    page.locator("#stage").focus()
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowUp", "+"):
        page.keyboard.press(key)
    whole(page, azimuth_deg="40", elevation_deg="35", zoom="1.15")
    page.get_by_label("Glass").check()
    whole(page, mode="refract", azimuth_deg="40")
    page.wait_for_url(re.compile("mode=refract"))
    assert "azimuth_deg=40" in page.url
    page.reload()
    whole(page, mode="refract", azimuth_deg="40", elevation_deg="35", zoom="1.15")
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    whole(page, mode="refract", azimuth_deg="30", elevation_deg="20", zoom="1")


@pytest.mark.nightly
def test_two_requests_at_most_and_the_newest_view_wins(page, ball):
    requested, under_way, most = [], set(), []

    def begin(request):
        if "refraction.png" in request.url:
            requested.append(request.url)
            # A full picture is cancelled where the view moves on; a preview never is.
            if "width=256" in request.url:
                under_way.add(request)
                most.append(len(under_way))

    def slowly(route):
        time.sleep(0.05)
        route.continue_()

    page.route("**/refraction.png*", slowly)
    page.on("request", begin)
    for name in ("requestfinished", "requestfailed"):
        page.on(name, lambda request: under_way.discard(request))
    page.get_by_label("Glass").check()
    page.locator("#stage").focus()
    for _ in range(60):
        page.keyboard.press("ArrowRight")
    whole(page, mode="refract", azimuth_deg="330")
    views = [settings_of(request) for request in requested]
    previews = [view for view in views if view["width"] == "256"]
    assert max(most) <= 2
    assert 0 < len(previews) < 60
    assert all((preview["ray_spacing"], preview["supersampling"]) == ("2", "none") for preview in previews)
    # Each is of a later view than the one before it, and the last is whole.
    turned = [float(preview["azimuth_deg"]) for preview in previews]
    assert turned == sorted(turned)
    assert (views[-1]["width"], views[-1]["azimuth_deg"], views[-1]["supersampling"]) == (
        "512",
        "330",
        "prss",
    )


@pytest.mark.nightly
def test_a_preview_that_comes_late_is_not_shown(page, ball):
    content = io.BytesIO()
    Image.new("RGB", (8, 8), "red").save(content, "PNG")
    held = []

    def answer(route):
        if "width=256" in route.request.url and not held:
            held.append(route)
        else:
            route.fulfill(body=content.getvalue(), content_type="image/png")

    page.route("**/refraction.png*", answer)
    page.get_by_label("Glass").check()
    whole(page, mode="refract", azimuth_deg="30")
    page.locator("#stage").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    pictures = whole(page, azimuth_deg="40").get_attribute("data-pictures")
    with page.expect_event("requestfinished"):
        held[0].fulfill(body=content.getvalue(), content_type="image/png")
    # Time for it to be drawn, were it not late.
    page.wait_for_timeout(300)
    assert settings_of(held[0].request.url)["azimuth_deg"] == "35"
    assert whole(page, azimuth_deg="40").get_attribute("data-pictures") == pictures


@pytest.mark.nightly
def test_an_iso_value_is_chosen_by_its_histogram(page, address, tmp_path):
    values = np.round(200.0 * sampled(ONE_HOLE, 14)).astype(np.uint8)
    page.goto(address + "/#/rendering")
    page.set_input_files("#volume-file", saved(tmp_path, values))
    page.get_by_text(re.compile("^14 . 14 . 14 nodes")).wait_for()
    page.get_by_role("button", name="Surface", exact=True).click()
    histogram = page.get_by_role("img", name=re.compile(r"^Histogram of 2,744 nodes from 0 to 200"))
    histogram.wait_for()
    steps = histogram.locator("path").get_attribute("d").split("V")[1:-1]
    counts, _ = np.histogram(values, 256)
    heights = 60.0 - np.array([float(step.split("H")[0]) for step in steps])
    expected = 60.0 * np.log1p(counts) / np.log1p(counts.max())
    np.testing.assert_allclose(heights, expected, atol=0.006)
    expect(page.get_by_label("Smoothing")).to_have_attribute("placeholder", "automatic: 30")
    assert histogram.locator("line").count() == 1
    slider = page.get_by_label("Iso-value by slider")
    slider.focus()
    slider.press("Home")
    for _ in range(100):
        slider.press("ArrowRight")
    expect(page.get_by_label("Iso-value", exact=True)).to_have_value("40")
    whole(page, iso="40")
    assert float(histogram.locator("line").get_attribute("x1")) == pytest.approx(256 * 40 / 200)


def test_an_image_of_one_plane_does_not_show_another_volume(page, ball):
    flat = {"id": "vol-flat", "name": "flat", "source": "upload", "shape": [8, 9], "links": {}}
    page.route("**/v1/volumes/vol-flat", lambda route: route.fulfill(json=flat))
    page.evaluate("location.hash = '#/rendering/vol-flat'")
    page.get_by_text(re.compile("8 . 9 nodes, which cannot be rendered")).wait_for()


@pytest.mark.nightly
def test_display_errors_are_shown_as_text(page, ball, tmp_path):
    page.route("**/*filter=*", lambda route: route.abort())
    with page.expect_request(re.compile("refraction.png.*filter=catmull-rom&")):
        page.get_by_label("Filter").select_option("catmull-rom")
    expect(page.locator("#look-error")).to_have_text("The service does not answer.")
    page.get_by_label("Filter").select_option("B-spline 3")
    expect(page.locator("#look-error")).to_be_hidden()
    page.get_by_label("Iso-value", exact=True).fill("7")
    page.get_by_label("Iso-value", exact=True).press("Tab")
    expect(page.locator("#look-error")).to_contain_text("iso: found 7; accepted: ")
    page.get_by_label("Iso-value", exact=True).fill("0.5")
    page.get_by_label("Iso-value", exact=True).press("Tab")
    whole(page, iso="0.5")
    expect(page.locator("#look-error")).to_be_hidden()
    (tmp_path / "notes.txt").write_text("only text")
    page.set_input_files("#volume-file", tmp_path / "notes.txt")
    expect(page.locator("#volume-error")).to_contain_text("NRRD")
