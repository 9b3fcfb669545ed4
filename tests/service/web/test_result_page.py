"""The page of a result: values, colours, profile and region are those of the arrays; links keep the view."""

import base64
import csv
import io
import json
import re
import shlex
from pathlib import Path
from xml.etree import ElementTree as ET

import httpx
import numpy as np
import pytest
import yaml
from matplotlib import colormaps
from matplotlib.path import Path as Outline
from PIL import Image
from playwright.sync_api import expect
from scipy.ndimage import map_coordinates

from bentray_kernels.tomography import Caution

from .conftest import PATIENCE_MS, tab_to
from .finished_results import ORIGIN_M, SPACING_M, finished, known

pytestmark = pytest.mark.browser

SVG = "{http://www.w3.org/2000/svg}"
SPEED = known((24, 16))
DX, DY = (1e3 * step for step in SPACING_M[:2])
X0, Y0 = (1e3 * start for start in ORIGIN_M[:2])


MORE = {
    "attenuation": np.linspace(0.0, 20.0, SPEED.size).reshape(SPEED.shape),
    "coverage": SPEED - 1300.0,
}


@pytest.fixture(scope="module")
def result(shared_service):
    """The address of a result in a plane, for tests that leave it as it is."""
    return f"{shared_service.address}/#/jobs/{finished(shared_service, SPEED, **MORE)}"


@pytest.fixture
def made(shared_service):
    """The address of a result of these values that a test may change."""
    return lambda *given, **more: (
        f"{shared_service.address}/#/jobs/{finished(shared_service, *given, **more)}"
    )


def ready(page, address):
    # The whole canvas is in view.
    page.set_viewport_size({"width": 1400, "height": 1100})
    page.goto(address)
    page.locator(".readout").filter(has_text="mm").wait_for()


def redrawn(page):
    """Wait until all that has been changed is drawn, which the page does once a frame."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def node_below(page, share_x, share_y, canvas=None):
    """Put the pointer on a share of the canvas; what the page says: node, value, position in mm."""
    box = (canvas or page.locator("canvas.plane").first).bounding_box()
    page.mouse.move(box["x"] + share_x * box["width"], box["y"] + share_y * box["height"])
    redrawn(page)
    said = page.locator(".readout").evaluate("one => ({...one.dataset})")
    node = tuple(map(int, said["node"].split(","))) if said["node"] else None
    return node, float(said["value"]), (float(said["x"]), float(said["y"]))


def drawn(page, share_x, share_y, canvas):
    """The colour on a share of the canvas."""
    return canvas.evaluate(
        """(one, [x, y]) => [...one.getContext("2d").getImageData(
            Math.round(x * one.width), Math.round(y * one.height), 1, 1).data].slice(0, 3)""",
        [share_x, share_y],
    )


def colour_of(value, low, high, name="viridis"):
    return list(colormaps[name]((value - low) / (high - low), bytes=True)[:3])


def window_of(page):
    return [float(page.get_by_label(name, exact=True).input_value()) for name in ("from", "to")]


def test_the_value_and_the_colour_under_the_pointer_are_those_of_the_array(page, result):
    ready(page, result + "?window=1430,1570")
    canvas = page.locator("canvas.plane")
    assert min(canvas.bounding_box()["width"], canvas.bounding_box()["height"]) >= 600
    seen = set()
    for place in ((0.45, 0.3), (0.53, 0.71), (0.61, 0.55)):
        node, value, (x, y) = node_below(page, *place)
        assert node == (round((x - X0) / DX), round((y - Y0) / DY))
        assert value == SPEED[node]
        assert drawn(page, *place, canvas) == colour_of(value, 1430.0, 1570.0)
        expect(page.locator(".readout")).to_contain_text(f"{value:.2f} m/s")
        seen.add(node)
    assert len(seen) == 3
    # The middle of the canvas is the middle of the image.
    _, _, middle = node_below(page, 0.5, 0.5)
    assert middle == pytest.approx((X0 + 11.5 * DX, Y0 + 7.5 * DY), abs=0.1)


@pytest.mark.parametrize("size", [(1400, 900), (1280, 720), (390, 844)])
def test_image_colour_bar_and_read_out_fit_the_window(page, result, size):
    ready(page, result)
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    redrawn(page)
    for shown in ("#result-viewer canvas.plane", "#result-viewer .readout", "#result-viewer .colour-bar"):
        expect(page.locator(shown)).to_be_in_viewport(ratio=1.0)
    canvas = page.locator("canvas.plane").bounding_box()
    assert min(canvas["width"], canvas["height"]) >= 350
    page.get_by_label("Overlay", exact=True).select_option("attenuation")
    for bar in (0, 1):
        expect(page.locator("#result-viewer .colour-bar").nth(bar)).to_be_in_viewport(ratio=1.0)
    expect(page.locator("#result-viewer canvas.plane")).to_be_in_viewport(ratio=1.0)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]


@pytest.mark.nightly
def test_the_attenuation_is_in_decibels_per_centimetre(page, result):
    ready(page, result)
    page.get_by_role("button", name="Attenuation (experimental)").click()
    page.locator(".readout").filter(has_text="dB/cm").wait_for()
    node, value, _ = node_below(page, 0.5, 0.4)
    assert value == pytest.approx(
        np.linspace(0.0, 20.0, SPEED.size).reshape(SPEED.shape)[node] * 0.0868588963806
    )


def test_an_attenuation_no_better_than_a_constant_is_last_and_grey_with_a_note_on_its_image(page, made):
    text = "Attenuation not better than a constant: held-out amplitudes 2.6 dB against 2.5 dB."
    ready(page, made(SPEED, cautions=(Caution("attenuation", text),), **MORE))
    last = page.locator(".quantities button").last
    expect(last).to_have_text("Attenuation (experimental)")
    expect(last).to_have_attribute("title", text)
    expect(page.locator(".quantities [data-grey]")).to_have_count(1)
    expect(page.locator(".tile [role=note]")).to_have_count(0)
    last.click()
    expect(page.locator(".tile [role=note]")).to_have_text(text)
    expect(page.locator(".tile [role=note]")).to_be_in_viewport(ratio=1.0)


@pytest.mark.nightly
def test_the_resolution_is_the_recovered_fraction(page, made):
    """With the same colours from nothing to all, whatever its values are."""
    recovered = np.linspace(0.2, 0.9, SPEED.size).reshape(SPEED.shape)
    ready(page, made(SPEED, recovery=recovered))
    expect(page.locator("#result-cautions")).to_be_empty()
    page.get_by_role("button", name="Resolution").click()
    page.locator(".colour-bar").get_by_text("recovered fraction of a checkerboard").wait_for()
    assert window_of(page) == [0.0, 1.0]
    canvas = page.locator("canvas.plane")
    for place in ((0.45, 0.3), (0.61, 0.55)):
        node, value, _ = node_below(page, *place)
        assert value == pytest.approx(recovered[node], rel=1e-6)
        assert drawn(page, *place, canvas) == colour_of(recovered[node], 0.0, 1.0, "bone")
        expect(page.locator(".readout")).to_contain_text(f"{recovered[node]:.3f}")


@pytest.mark.nightly
def test_the_uncertainty_fades_what_is_not_known(page, made):
    """Opaque without uncertainty, clear where two deviations reach half the range of the colours."""
    spread = np.zeros(SPEED.shape)
    spread[8:], spread[16:] = 14.0, 35.0
    caution = "The standard deviations may be too small: <b>rays</b> gather."
    cautions = (Caution("bounds", "Cut off at 1800 m/s.", doubtful=True), Caution("uncertainty", caution))
    ready(page, made(SPEED, uncertainty=spread, cautions=cautions) + "?window=1430,1570")
    expect(page.locator("#result-facts")).to_contain_text("m/s (1 sd), detail down to 5.9 mm, 2 cautions: ")
    expect(page.locator("#result-cautions p")).to_have_text(
        ["Doubtful result. Cut off at 1800 m/s.", caution]
    )
    canvas = page.locator("canvas.plane")

    def alpha(share_x):
        return canvas.evaluate(
            """(one, x) => one.getContext("2d").getImageData(
                Math.round(x * one.width), Math.round(0.5 * one.height), 1, 1).data[3]""",
            share_x,
        )

    places = {share: node_below(page, share, 0.52)[0] for share in (0.3, 0.5, 0.7)}
    assert [alpha(share) for share in places] == [255, 255, 255]
    page.get_by_label("Fade what is not known").check()
    page.wait_for_url(re.compile("fade=1"))
    redrawn(page)
    for share, node in places.items():
        faded = 255.0 * max(0.0, 1.0 - 4.0 * spread[node] / 140.0)
        assert alpha(share) == pytest.approx(faded, abs=1)
    assert sorted({spread[node] for node in places.values()}) == [0.0, 14.0, 35.0]
    page.get_by_role("button", name="Uncertainty").click()
    page.locator(".colour-bar").get_by_text("standard deviation of the speed (m/s)").wait_for()
    expect(page.get_by_label("Fade what is not known")).to_be_hidden()
    assert window_of(page)[0] == 0.0


def test_a_link_restores_the_view(page, result, browser):
    ready(page, result)
    page.get_by_role("button", name="Coverage").click()
    page.locator(".colour-bar").get_by_text("ray length per node (m)").wait_for()
    page.locator("select[name=map]").select_option("inferno")
    page.get_by_label("from", exact=True).fill("150")
    page.get_by_label("to", exact=True).fill("260")
    page.get_by_label("to", exact=True).press("Tab")
    canvas = page.locator("canvas.plane")
    canvas.hover(position={"x": 400, "y": 300})
    page.mouse.wheel(0, -400)
    canvas.click(position={"x": 350, "y": 250})
    page.mouse.move(0, 0)
    page.wait_for_url(re.compile("q=coverage.*window=150%2C260.*at=.*view-z="))
    redrawn(page)
    said = page.locator(".readout").text_content()
    with browser.new_context() as other:
        again = other.new_page()
        again.set_default_timeout(PATIENCE_MS)
        ready(again, page.url)
        redrawn(again)
        assert again.locator(".readout").text_content() == said
        expect(again.get_by_role("button", name="Coverage")).to_have_attribute("aria-pressed", "true")
        expect(again.locator("select[name=map]")).to_have_value("inferno")
        assert window_of(again) == [150.0, 260.0]
        shots = [tab.locator("canvas.plane").evaluate("one => one.toDataURL()") for tab in (page, again)]
        assert shots[0] == shots[1]


def saved(page, panel):
    """Save what is measured in a panel as CSV; its rows."""
    with page.expect_download() as download:
        page.locator(f".measure.{panel}").get_by_role("button", name="Save as CSV").click()
    with download.value.path().open(newline="") as file:
        return list(csv.reader(file))


def dragged(page, *points):
    """Drag from the first of these points of the page over all others."""
    page.mouse.move(*points[0])
    page.mouse.down()
    for point in points[1:]:
        page.mouse.move(*point, steps=2)
    page.mouse.up()
    redrawn(page)


@pytest.mark.nightly
def test_a_profile_is_the_linear_interpolation_of_the_array(page, result):
    ready(page, result)
    page.get_by_label("Profile", exact=True).check()
    ends = (-8.0, -15.5, 9.25, 4.0)
    for name, value in zip(("x from", "y from", "x to", "y to"), ends, strict=True):
        page.get_by_label(f"Profile: {name}, mm").fill(str(value))
    page.get_by_label("Profile: y to, mm").press("Tab")
    page.get_by_role("img", name="Profile of sound speed").wait_for()
    head, *rows = saved(page, "profile")
    assert head[0] == "distance_mm"
    assert head[1].endswith("(m/s)")
    distance, value = np.array(rows, float).T
    length = np.hypot(ends[2] - ends[0], ends[3] - ends[1])
    assert (distance[0], distance[-1]) == (0.0, pytest.approx(length))
    share = distance / length
    places = [
        (ends[0] + share * (ends[2] - ends[0]) - X0) / DX,
        (ends[1] + share * (ends[3] - ends[1]) - Y0) / DY,
    ]
    np.testing.assert_allclose(value, map_coordinates(SPEED, places, order=1), rtol=1e-12)


@pytest.mark.parametrize("shape", [pytest.param("Rectangle", marks=pytest.mark.nightly), "Ellipse"])
def test_the_statistics_of_a_dragged_region_are_those_of_its_nodes(page, result, shape):
    ready(page, result)
    page.get_by_label(shape).check()
    box = page.locator("canvas.plane").bounding_box()
    corners = ((0.42, 0.31), (0.61, 0.67))
    dragged(page, *((box["x"] + u * box["width"], box["y"] + v * box["height"]) for u, v in corners))
    page.get_by_text("Standard deviation (m/s)").wait_for()
    head, row = saved(page, "region")
    said = dict(zip(head, row, strict=True))
    x0, y0, x1, y1 = (float(said[f"{edge}_mm"]) for edge in ("x0", "y0", "x1", "y1"))
    x, y = X0 + DX * np.arange(24)[:, None], Y0 + DY * np.arange(16)[None, :]
    u, v = (2 * x - x0 - x1) / (x1 - x0), (2 * y - y0 - y1) / (y1 - y0)
    inside = (u**2 + v**2 <= 1) if shape == "Ellipse" else (abs(u) <= 1) & (abs(v) <= 1)
    values = SPEED[inside]
    assert values.size > 20
    assert int(said["nodes"]) == values.size
    assert float(said["area_mm2"]) == pytest.approx(values.size * DX * DY)
    assert float(said["mean"]) == pytest.approx(values.mean(), rel=1e-12)
    assert float(said["standard_deviation"]) == pytest.approx(values.std(), rel=1e-9)
    away = np.hypot(u, v) if shape == "Ellipse" else np.maximum(abs(u), abs(v))
    contrast = values.mean() - SPEED[(away > 1.25) & (away <= 2)].mean()
    assert float(said["contrast"]) == pytest.approx(contrast, rel=1e-9)
    cells = page.locator(".statistics td").all_text_contents()
    assert cells[0] == f"{values.mean():.2f}"
    assert cells[3] == f"{contrast:.2f}"


@pytest.mark.nightly
def test_dragging_sets_the_window_and_moves_the_image_and_two_fingers_zoom(page, result):
    ready(page, result + "?window=1430,1570")
    box = page.locator("canvas.plane").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]

    page.get_by_label("Window", exact=True).check()
    dragged(page, (x, y), (x + 60, y))
    expect(page.get_by_label("from", exact=True)).not_to_have_value("1430")
    half = 70.0 * np.exp(60 / 150)
    np.testing.assert_allclose(window_of(page), [1500.0 - half, 1500.0 + half], atol=0.01)
    dragged(page, (x, y), (x, y - 30))
    expect(page.get_by_label("to", exact=True)).not_to_have_value(f"{1500.0 + half:.6g}")
    np.testing.assert_allclose(window_of(page), np.add([1500.0 - half, 1500.0 + half], 0.2 * half), atol=0.01)
    page.get_by_label("Move", exact=True).check()
    before = node_below(page, 0.5, 0.5)[2]
    dragged(page, (x, y), (x + 60, y + 30))
    after = node_below(page, 0.5, 0.5)[2]
    scale = 60 / (before[0] - after[0])
    assert scale > 0.0
    assert (after[1] - before[1]) * scale == pytest.approx(30.0, abs=0.1)
    touch = page.context.new_cdp_session(page)
    for kind, apart in (("touchStart", 40), ("touchMove", 80), ("touchEnd", None)):
        fingers = [{"x": x + sign * apart, "y": y, "id": sign} for sign in (0, 1)] if apart else []
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})
    page.wait_for_url(re.compile(r"view-z="))
    left, right = (node_below(page, 0.5 + share, 0.5)[2][0] for share in (0.0, 0.1))
    assert 0.1 * box["width"] / (right - left) == pytest.approx(2.0 * scale, rel=1e-3)


@pytest.mark.nightly
def test_a_region_has_the_contrast_of_the_truth_beside_its_own(page, made):
    # On a grid that has a node at each of the image.
    x, y = np.ogrid[-20.0:40.0, -30.0:30.0]

    def with_truth(file):
        file["truth/sound_speed_mps"] = 1500.0 + 0.1 * x**2 + 0.05 * (y - 3.0) ** 2
        file["truth"].attrs.update(spacing_m=1e-3, origin_m=[-0.02, -0.03])

    spread = np.linspace(1.0, 9.0, SPEED.size).reshape(SPEED.shape)
    ready(page, made(SPEED, with_truth, uncertainty=spread) + "?ellipse=-4,-12,4,2")
    table = page.locator(".statistics")
    expect(table.locator("tr").first).to_have_text("ResultTruth")
    expect(table).to_contain_text("Uncertainty of the mean (m/s)")
    rows = {
        row.locator("th").inner_text(): row.locator("td").all_inner_texts()
        for row in table.locator("tr:has(td)").all()
    }
    a, b = X0 + DX * np.arange(24)[:, None], Y0 + DY * np.arange(16)[None, :]
    away = np.hypot((a - 0.0) / 4.0, (b + 5.0) / 7.0)
    for column, values in enumerate((SPEED, 1500.0 + 0.1 * a**2 + 0.05 * (b - 3.0) ** 2)):
        inside, beside = values[away <= 1.0], values[(away > 1.25) & (away <= 2.0)]
        assert float(rows["Mean (m/s)"][column]) == pytest.approx(inside.mean(), abs=0.006)
        contrast = float(rows["Contrast to surroundings (m/s)"][column])
        assert contrast == pytest.approx(inside.mean() - beside.mean(), abs=0.006)
    of_mean, of_truth = rows["Uncertainty of the mean (m/s)"]
    assert float(of_mean) == pytest.approx(spread[away <= 1.0].mean(), abs=0.006)
    assert of_truth == "\N{EN DASH}"
    head, *lines = saved(page, "region")
    assert [line[0] for line in lines] == ["Result", "Truth"]
    assert float(lines[1][head.index("contrast")]) == pytest.approx(contrast, abs=0.006)
    assert [line[head.index("uncertainty")] != "" for line in lines] == [True, False]
    # Of the speed alone.
    page.get_by_role("button", name="Coverage").click()
    expect(table.locator("td").first).to_have_text("1.0000")


def test_distance_angle_and_area_are_those_of_their_points(page, made):
    values = known((8, 6, 5))
    ready(page, made(values))

    def click(*shares):
        points = []
        for share in shares:
            points.append(node_below(page, *share)[2])
            page.mouse.down()
            page.mouse.up()
        return np.array(points)

    page.get_by_label("Distance", exact=True).check()
    first = click((0.4, 0.3))
    page.get_by_label("Slice across z").press("ArrowRight")
    (across,) = click((0.6, 0.5)) - first
    page.get_by_label("Angle", exact=True).check()
    one, vertex, other = click((0.45, 0.2), (0.5, 0.5), (0.6, 0.3))
    page.get_by_label("Area", exact=True).check()
    *outline, _ = click((0.4, 0.2), (0.6, 0.25), (0.55, 0.8), (0.42, 0.7), (0.4, 0.2))
    head, *rows = saved(page, "list")
    length, angle, area = (dict(zip(head, row, strict=True)) for row in rows)
    # The second point lies in another slice.
    assert float(length["value"]) == pytest.approx(np.hypot(np.linalg.norm(across), 1e3 * SPACING_M[2]))
    arms = [complex(*(end - vertex)) for end in (one, other)]
    assert float(angle["value"]) == pytest.approx(abs(np.angle(arms[0] / arms[1], deg=True)))
    x, y = np.transpose(outline)
    assert float(area["value"]) == pytest.approx(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
    nodes = [(X0 + DX * a, Y0 + DY * b) for a in range(8) for b in range(6)]
    inside = values[..., 3].ravel()[Outline(outline).contains_points(nodes)]
    assert int(area["nodes"]) == inside.size > 5
    assert float(area["mean"]) == pytest.approx(inside.mean())
    assert float(area["standard_error"]) == pytest.approx(inside.std() / np.sqrt(inside.size))
    page.get_by_role("button", name="Remove measure 2").click()
    page.wait_for_url(lambda url: "measures=distance" in url and "angle" not in url)


@pytest.mark.nightly
def test_the_image_is_used_by_keys_alone(page, result):
    ready(page, result)
    page.locator("#skip").focus()
    tab_to(page, page.locator("canvas.plane"))
    read = page.locator(".readout")
    expect(read).to_contain_text("node 12, 8")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowUp")
    expect(read).to_contain_text("node 13, 9")
    assert float(read.get_attribute("data-value")) == SPEED[13, 9]
    before = window_of(page)
    page.keyboard.press(".")
    expect(page.get_by_label("from", exact=True)).not_to_have_value(f"{before[0]:g}")
    page.keyboard.press("a")
    expect(page.get_by_label("from", exact=True)).to_have_value(f"{before[0]:g}")
    page.keyboard.press("]")
    expect(page.get_by_label("to", exact=True)).not_to_have_value(f"{before[1]:g}")
    page.keyboard.press("a")
    expect(page.get_by_label("to", exact=True)).to_have_value(f"{before[1]:g}")
    page.get_by_label("Profile", exact=True).focus()
    page.keyboard.press("Space")
    page.locator("canvas.plane").focus()
    page.keyboard.press("Enter")
    for _ in range(4):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    page.get_by_role("img", name="Profile of sound speed over 4 mm").wait_for()
    page.keyboard.press("+")
    page.wait_for_url(re.compile("view-z="))
    page.keyboard.press("0")
    page.wait_for_url(re.compile("^((?!view-z).)*$"))


@pytest.mark.nightly
def test_slices_of_a_volume_and_three_planes_share_a_cursor(page, made):
    values = known((8, 6, 5))
    ready(page, made(values))
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    slider = page.get_by_label("Slice across z")
    for index in (0, 4, 2):
        slider.fill(str(index))
        page.get_by_text(f"Slice {index} of 0 to 4").wait_for()
    slider.focus()
    page.keyboard.press("ArrowRight")
    page.get_by_text("Slice 3 of 0 to 4, z = 14 mm").wait_for()
    node, value, _ = node_below(page, 0.45, 0.4)
    assert value == values[(*node, 3)]
    page.get_by_label("Axis across the slice").select_option("x")
    page.get_by_text("Slice 4 of 0 to 7, x = -6 mm").wait_for()
    node, value, _ = node_below(page, 0.45, 0.4)
    assert value == values[(4, *node)]
    expect(page.locator(".readout")).to_contain_text("x -6.00 mm · y ")
    expect(page.locator(".readout")).to_contain_text(f"node 4, {node[0]}, {node[1]}")
    page.get_by_label("Three planes").check()
    expect(page.locator("canvas.plane")).to_have_count(3)
    # A click on the plane across z sets the slices of the two others.
    node, _, _ = node_below(page, 0.3, 0.3)
    page.mouse.down()
    page.mouse.up()
    page.get_by_text(f"Slice {node[0]} of 0 to 7").wait_for()
    page.get_by_text(f"Slice {node[1]} of 0 to 5").wait_for()
    # From the values in the page; other requests may come at any time: for an icon, for the health.
    assert [request for request in asked if "/v1/volumes/" in request] == []


@pytest.mark.nightly
def test_a_result_is_run_again_with_changes(page, made, shared_service):
    ready(page, made(SPEED))
    page.get_by_role("link", name="Run again with changes").click()
    expect(page.get_by_label("Nodes per side")).to_have_value("16")
    expect(page.get_by_label("Method", exact=True)).to_have_value("sart")
    page.get_by_label("Nodes per side").fill("20")
    page.get_by_role("button", name="Start").click()
    # The first one, which is listed below the new one, has succeeded long before.
    expect(page.locator(".job").get_by_text("succeeded")).to_have_count(2)
    assert [call[1].nodes for call in shared_service.work.calls[-2:]] == [16, 20]


def copied(page, name):
    """Press a button that copies, and wait until it says so, which it does for two seconds only."""
    button = page.get_by_role("button", name=name)
    button.evaluate(
        """button => {
            window.copied = new Promise((done) => {
                const watch = () => button.textContent === "Copied" && done();
                new MutationObserver(watch).observe(button, { characterData: true, subtree: true });
            });
        }"""
    )
    button.click()
    page.evaluate("window.copied")


@pytest.mark.nightly
def test_the_copied_code_reads_the_values(page, result):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    ready(page, result)
    page.get_by_role("button", name="Coverage").click()
    page.locator(".colour-bar").get_by_text("ray length per node (m)").wait_for()
    page.get_by_text("More", exact=True).click()
    copied(page, "Copy as Python")
    names = {}
    exec(page.evaluate("navigator.clipboard.readText()"), names)
    np.testing.assert_array_equal(names["coverage"], SPEED - 1300.0)
    np.testing.assert_allclose(names["x"], X0 + DX * np.arange(24))
    copied(page, "Copy as curl")
    words = shlex.split(page.evaluate("navigator.clipboard.readText()"))
    assert words[:3] == ["curl", "-o", "coverage.npy"]
    np.testing.assert_array_equal(np.load(io.BytesIO(httpx.get(words[3]).content)), SPEED - 1300.0)


@pytest.mark.nightly
def test_a_result_is_renamed_exported_and_deleted(page, made):
    own_result = made(SPEED, **MORE)
    ready(page, own_result)
    page.get_by_role("heading", level=1).dblclick()
    page.keyboard.type("With the new water speed")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("With the new water speed")
    page.get_by_role("navigation").get_by_role("link", name="Jobs").click()
    page.get_by_role("main").get_by_role("link", name="With the new water speed").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("With the new water speed")
    page.get_by_text("Export", exact=True).click()
    page.locator(".export select").select_option("coverage")
    with page.expect_download() as download:
        page.locator(".export").get_by_role("link", name="NumPy").click()
    np.testing.assert_array_equal(np.load(download.value.path()), SPEED - 1300.0)
    page.on("dialog", lambda dialog: dialog.accept())
    expect(page.get_by_role("heading", name="Provenance")).to_be_visible()
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("heading", name="Jobs").wait_for()
    assert httpx.get(own_result.replace("/#/jobs/", "/v1/jobs/")).status_code == 404


def test_two_quantities_lie_over_each_other_and_values_between_nodes_are_interpolated(page, result):
    """By keys alone; the address keeps it; colours, read-out and bars are those of both arrays."""
    ready(page, result + "?window=1430,1570&over-window=0.5,1.5")
    page.locator("#skip").focus()
    tab_to(page, page.get_by_label("Overlay", exact=True))
    page.keyboard.type("Attenuation")
    tab_to(page, page.get_by_label("Opacity"))
    page.keyboard.press("ArrowRight")
    tab_to(page, page.get_by_label("Overlay from"))
    page.keyboard.type("0.5")
    tab_to(page, page.get_by_label("Overlay to"))
    page.keyboard.type("1.5")
    tab_to(page, page.get_by_label("Clear below the window"))
    page.keyboard.press("Space")
    page.wait_for_url(re.compile("over=attenuation&opacity=0.55&over-window=0.5%2C1.5&clear=1"))
    page.reload()
    page.locator(".readout").filter(has_text="mm").wait_for()
    expect(page.locator(".colour-bar .unit")).to_have_text(
        ["sound speed (m/s)", "attenuation, experimental (dB/cm)"]
    )
    canvas, seen = page.locator("canvas.plane"), set()
    for place in ((0.35, 0.3), (0.42, 0.71), (0.62, 0.6)):
        node, value, _ = node_below(page, *place)
        above = MORE["attenuation"][node] * 0.0868588963806
        expect(page.locator(".readout")).to_contain_text(f"Speed: {value:.2f} m/s")
        expect(page.locator(".readout")).to_contain_text(f"Attenuation: {above:.4f} dB/cm")
        grey, colour = colour_of(value, 1430.0, 1570.0, "gray"), colour_of(above, 0.5, 1.5, "plasma")
        mixed = np.add(np.multiply(grey, 0.45), np.multiply(colour, 0.55)) if above >= 0.5 else grey
        np.testing.assert_allclose(drawn(page, *place, canvas), mixed, atol=2)
        seen.add(above >= 0.5)
    assert seen == {True, False}
    page.get_by_label("Overlay", exact=True).select_option("none")
    expect(page.locator(".colour-bar")).to_have_count(1)
    page.locator("select[name=map]").select_option("viridis")
    page.get_by_label("Between nodes").select_option("linear")
    page.wait_for_url(re.compile("interpolation=linear"))
    redrawn(page)
    nearest = []
    for place in ((0.455, 0.3), (0.53, 0.73), (0.62, 0.57)):
        _, value, (x, y) = node_below(page, *place)
        between = map_coordinates(SPEED, [[(x - X0) / DX], [(y - Y0) / DY]], order=1)[0]
        expected = np.array(colour_of(between, 1430.0, 1570.0), int)
        np.testing.assert_allclose(drawn(page, *place, canvas), expected, atol=4)
        nearest.append(np.abs(expected - colour_of(value, 1430.0, 1570.0)).max())
    assert max(nearest) > 20


def test_a_figure_shows_the_view_with_caption_and_marks(page, result):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    ready(page, result + "?window=1430,1570&ellipse=-8,-15,0,-5&measures=distance,z,-5,-10,0,5,5,0")
    page.get_by_text("Export", exact=True).click()

    def exported(kind, name):
        with page.expect_download() as download:
            page.get_by_role("button", name=name).click()
        assert download.value.suggested_filename.endswith(kind)
        return download.value.path()

    svg = ET.parse(exported(".svg", "SVG")).getroot()
    texts = ["".join(text.itertext()) for text in svg.iter(f"{SVG}text")]
    ticks = {"1450", "1500", "1550"}
    assert {"x (mm)", "y (mm)", "sound speed (m/s)", "18.03 mm", *ticks} <= set(texts)
    caption = " ".join(texts)
    for part in ("nodes of 1 mm", "water 1500.0 m/s", "Bentray test", "no standard deviations"):
        assert part in caption
    assert len(list(svg.iter(f"{SVG}ellipse"))) == 2
    # The image has its pixels where the axes say.
    (image,) = svg.iter(f"{SVG}image")
    pixels = Image.open(io.BytesIO(base64.b64decode(image.get("href").partition(",")[2])))
    for node in ((3, 4), (20, 11)):
        place = [(k + 0.5) / n * side for k, n, side in zip(node, SPEED.shape, pixels.size, strict=True)]
        found = pixels.getpixel((int(place[0]), pixels.height - 1 - int(place[1])))
        assert list(found[:3]) == colour_of(SPEED[node], 1430.0, 1570.0)
    with Image.open(exported(".png", "PNG, 300 dpi")) as picture:
        sides = [float(svg.get(side)) * 300 / 96 for side in ("width", "height")]
        assert picture.size == tuple(map(round, sides))
        # Much of the figure is the image in its colours.
        assert len(picture.convert("RGB").getcolors(2**24)) > 200
    page.get_by_label("With what is measured").uncheck()
    bare = ET.parse(exported(".svg", "SVG")).getroot()
    assert not list(bare.iter(f"{SVG}ellipse"))
    assert "18.03 mm" not in "".join(bare.itertext())
    copied(page, "Copy caption")
    assert caption.endswith(page.evaluate("navigator.clipboard.readText()"))
    copied(page, "Copy BibTeX")
    bibtex = page.evaluate("navigator.clipboard.readText()")
    citation = yaml.safe_load((Path(__file__).parents[3] / "CITATION.cff").read_text())
    (thesis,) = citation["references"]
    (author,) = thesis["authors"]
    names = [author["family-names"] + ", " + author["given-names"], citation["authors"][0]["name"]]
    for part in (*names, citation["title"], thesis["title"], thesis["institution"]["name"], thesis["year"]):
        assert f"{{{part}}}" in bibtex
    assert "version = {test}" in bibtex


@pytest.mark.nightly
def test_provenance_is_told_in_words_and_copied_as_json(page, result):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    rms = {"held_out_mean_s": 1e-9, "held_out_rms_s": 25e-9, "training_rms_s": 20e-9}
    candidates = [
        {"label": "bent rays", "chosen": True, "shown": True, "outcome": "chosen", **rms},
        {"label": "straight rays", "chosen": False, "shown": False, "outcome": "a larger error", **rms},
    ]
    choice = {"candidates": candidates, "criterion": "held_out_rms_s", "reason": "Bent rays predict best."}
    page.route("**/summary", lambda route: route.fulfill(json=route.fetch().json() | choice))

    def with_rays(route):
        record = route.fetch().json()
        record["provenance"]["ray_numerics"] = '{"ray_width_m": 0.0026}'
        route.fulfill(json=record)

    page.route(re.compile("/v1/volumes/[^/]*$"), with_rays)
    ready(page, result)
    table = page.get_by_role("region", name="Candidates of the automatic choice")
    expect(table.locator("tbody tr").first).to_have_text("bent rays25 nschosen1 ns20 ns")
    expect(table.locator("tbody tr").last).to_have_text("straight rays25 nsa larger error1 ns20 ns")
    box = page.locator(".provenance")
    job = httpx.get(result.replace("/#/jobs/", "/v1/jobs/")).json()
    volume = httpx.get(result.partition("/#/")[0] + job["links"]["volume"]).json()
    box.get_by_text("Provenance", exact=True).click()
    box.get_by_text("Settings", exact=True).click()
    # The form of settings names them, once its description is read.
    box.get_by_role("row", name="Region of interest only").wait_for()
    rows = {row.locator("th").inner_text(): row.locator("td").inner_text() for row in box.locator("tr").all()}
    assert (rows["Job"], rows["Scan"], rows["Speed in water"]) == (job["id"], job["dataset"], "1500.0 m/s")
    image = (rows["Method"], rows["Side of the image"], rows["Region of interest only"])
    assert image == ("SART", "the array and a margin", "no")
    assert rows["Speed bounds"] == "1300 to 1800 m/s", rows
    assert "{" not in box.inner_text()
    box.get_by_text("Those of the rays before full waveforms").click()
    expect(box.get_by_role("row", name="Width of rays")).to_have_text("Width of rays0.0026 m")
    copied(page, "Copy JSON")
    record = json.loads(page.evaluate("navigator.clipboard.readText()"))
    assert record["settings"] == job["settings"]
    assert record["provenance"] == volume["provenance"]
    assert record["ray_numerics"] == {"ray_width_m": 0.0026}
