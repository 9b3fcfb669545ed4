"""The page of a scan: start a reconstruction, watch it."""

from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import expect

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.tomography.settings import Settings

pytestmark = pytest.mark.browser


def sent(page, address, scan):
    """The page of a scan that was uploaded on the start page."""
    page.goto(address)
    page.set_input_files("#scan-file", scan())
    page.get_by_text("16 emitters").wait_for()


def test_the_form_starts_with_the_defaults(page, serve, scan):
    sent(page, serve(), scan)
    page.get_by_text("Nothing has run yet").wait_for()
    page.get_by_text("Other settings").click()
    expect(page.get_by_label("Iterations")).to_have_value(str(Settings(method="sart").iterations))


def test_upload_start_watch(page, serve, scan, work):
    sent(page, serve(), scan)
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
    sent(page, serve(), scan)
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
    sent(page, serve(), scan)
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

    sent(page, serve(), scan)
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


def test_cancel(page, serve, scan, work):
    sent(page, serve(), scan)
    work.hold.clear()
    page.get_by_role("button", name="Fast").click()
    page.get_by_role("button", name="Cancel").click()
    page.locator(".state", has_text="cancelled").wait_for()


def test_by_keyboard_alone(page, serve, scan, work):
    sent(page, serve(), scan)
    page.locator("#theme").focus()
    for _ in range(20):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "start":
            break
    page.keyboard.press("Enter")
    page.locator(".job").wait_for()
