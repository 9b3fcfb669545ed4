"""Results side by side: one range of colours, one cursor, differences."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from .finished_results import finished, known
from .test_result_page import colour_of, drawn, node_below, ready, window_of

pytestmark = pytest.mark.browser

FIRST, SECOND = known((24, 16)), 20.0 + known((24, 16), seed=1)


@pytest.fixture(scope="module")
def both(shared_service):
    ids = [finished(shared_service, mps) for mps in (FIRST, SECOND)]
    return f"{shared_service.address}/#/compare/{','.join(ids)}"


def test_both_images_have_one_range_and_one_cursor(page, both):
    ready(page, both)
    canvases = page.locator("canvas.plane")
    expect(canvases).to_have_count(2)
    low, high = window_of(page)
    for values in (FIRST, SECOND):
        assert np.mean((low <= values) & (values <= high)) > 0.99
    for k, values in enumerate((FIRST, SECOND)):
        node, value, _ = node_below(page, 0.4, 0.35, canvases.nth(k))
        assert value == values[node]
        # The limits in the fields are rounded to six digits: at most one colour away.
        computed, expected = drawn(page, 0.4, 0.35, canvases.nth(k)), colour_of(value, low, high)
        assert np.abs(np.subtract(computed, expected, dtype=int)).max() <= 4
        expect(page.locator(".readout")).to_contain_text(f"{FIRST[node]:.2f} m/s")
        expect(page.locator(".readout")).to_contain_text(f"{SECOND[node]:.2f} m/s")
    page.get_by_text("Export", exact=True).click()
    with page.expect_download() as download:
        page.get_by_role("button", name="SVG").click()
    figure = download.value.path().read_text()
    assert [figure.count(part) for part in ("<image", "A:", "B:")] == [2, 1, 1]


@pytest.mark.nightly
def test_four_images_have_one_range(page, both, shared_service):
    more = [finished(shared_service, 3.0 * FIRST - mps) for mps in (3000.0, 2990.0)]
    ready(page, ",".join([both, *more]) + "?ellipse=-8,-15,0,-5")
    expect(page.locator("canvas.plane")).to_have_count(4)
    expect(page.locator(".statistics tr").first.locator("th")).to_have_count(5)
    page.set_viewport_size({"width": 360, "height": 740})
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    page.set_viewport_size({"width": 1400, "height": 1100})
    low, high = window_of(page)
    assert low < FIRST.min() - 30.0
    assert high > FIRST.max() + 30.0
    node = node_below(page, 0.4, 0.35)[0]
    for values in (FIRST, SECOND, 3.0 * FIRST - 3000.0, 3.0 * FIRST - 2990.0):
        expect(page.locator(".readout")).to_contain_text(f"{values[node]:.2f} m/s")


@pytest.mark.nightly
def test_the_difference_and_the_border_to_swipe(page, both):
    ready(page, both)
    page.get_by_role("button", name="Difference", exact=True).click()
    expect(page.locator("canvas.plane")).to_have_count(1)
    node, value, _ = node_below(page, 0.55, 0.4)
    assert value == (SECOND - FIRST)[node]
    low, high = window_of(page)
    assert low == -high
    page.get_by_role("button", name="Swipe").click()
    page.get_by_label("Border").fill("0.5")
    canvas = page.locator("canvas.plane")
    node, value, _ = node_below(page, 0.42, 0.4)
    assert value == FIRST[node]
    node, value, _ = node_below(page, 0.58, 0.4)
    assert value == SECOND[node]
    low, high = window_of(page)
    expected = colour_of(value, low, high)
    assert np.abs(np.subtract(drawn(page, 0.58, 0.4, canvas), expected, dtype=int)).max() <= 4
    page.wait_for_url(re.compile("mode=swipe"))


@pytest.mark.nightly
def test_a_way_that_is_chosen_before_the_values_are_read_is_shown(page, both):
    held = []
    page.route("**/data?*", lambda route: held.append(route))
    page.goto(both)
    page.get_by_role("button", name="Difference", exact=True).click()
    while len(held) < 2:
        page.wait_for_timeout(20)
    for route in held:
        route.continue_()
    expect(page.locator("canvas.plane")).to_have_count(1)
    page.locator(".readout").filter(has_text="mm").wait_for()


def test_a_comparison_is_chosen_on_the_page_of_a_result(page, both):
    first, second = both.rsplit("/", 1)[1].split(",")
    ready(page, f"{both.partition('#')[0]}#/jobs/{first}")
    page.get_by_text("Compare with").click()
    drawn = page.locator(f"label:has(input[value={second}]) img.thumbnail")
    page.wait_for_function("image => image.naturalHeight === 96", arg=drawn.element_handle())
    page.locator(f"input[value={second}]").check()
    page.get_by_role("button", name="Compare", exact=True).click()
    page.wait_for_url(re.compile(f"#/compare/{first},{second}"))
    expect(page.locator("canvas.plane")).to_have_count(2)


def test_a_comparison_needs_two_results(page, both):
    page.goto(both.rsplit(",", 1)[0])
    page.get_by_role("alert").get_by_text("two to 4 results").wait_for()
