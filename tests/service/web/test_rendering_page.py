"""Volume rendering: upload, view, turntable."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_service.jobs import kinds

pytestmark = pytest.mark.browser


def saved(tmp_path, values):
    np.save(tmp_path / "ball.npy", values)
    return tmp_path / "ball.npy"


def test_a_volume_is_uploaded_looked_at_and_turned(page, serve, work, tmp_path, monkeypatch):
    monkeypatch.setattr(kinds, "draw_turntable", lambda *args, **control: args[3].write_bytes(b"pictures"))
    page.goto(serve() + "/#/rendering")
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
    page.goto(serve() + "/#/rendering")
    page.set_input_files("#volume-file", saved(tmp_path, sampled(ONE_HOLE, 12)))
    page.get_by_text("ball.npy is stored").wait_for()
    page.get_by_label("Iso-value").fill("7")
    page.get_by_label("Iso-value").press("Tab")
    expect(page.locator("#look-error")).to_contain_text("iso: found 7; accepted: ")
    (tmp_path / "notes.txt").write_text("only text")
    page.set_input_files("#volume-file", tmp_path / "notes.txt")
    expect(page.locator("#volume-error")).to_contain_text("NRRD")
