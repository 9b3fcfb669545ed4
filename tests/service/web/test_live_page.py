"""The page of a running job: progress, image and misfit of each iteration, cancellation, a failure."""

import numpy as np
import pytest
from playwright.sync_api import expect

from bentray_kernels.errors import InvalidInput

from .conftest import tab_to
from .live_results import ITERATIONS, SHAPE, in_turns, started

pytestmark = pytest.mark.browser


@pytest.fixture
def turns(work, monkeypatch):
    return in_turns(work, monkeypatch)


def colour_at(canvas, x, y):
    """Red, green and blue of a pixel of a canvas."""
    pixel = "(it, [x, y]) => [...it.getContext('2d').getImageData(x, y, 1, 1).data.slice(0, 3)]"
    return canvas.evaluate(pixel, [round(x), round(y)])


def test_it_sharpens_until_the_result_is_shown(page, address, scan, turns):
    page.goto(f"{address}/#/jobs/{started(address, scan)['id']}")
    page.get_by_text("The image appears after the first iteration").wait_for()
    page.get_by_text("0 % of this step").wait_for()
    page.get_by_role("heading", level=1, name="Bent rays, SART").wait_for()
    picture, curve = page.locator("canvas.preview"), page.locator(".misfit svg")
    turns.put(None)
    expect(picture).to_have_attribute("aria-label", "Sound speed so far, 1500 to 1520 m/s")
    # x is to the right and y up: the largest value is at the upper right, in the last colour of viridis.
    width, height = picture.evaluate("it => [it.width, it.height]")
    pixels_per_mm = 0.97 * min(width / SHAPE[0], height / SHAPE[1])
    corner = width / 2 + 23.5 * pixels_per_mm, height / 2 - 17.5 * pixels_per_mm
    np.testing.assert_allclose(colour_at(picture, *corner), [253, 231, 37], atol=2)
    # The white bar has a round length, at most three tenths of the width.
    most_mm = 0.3 * width / pixels_per_mm
    bar_mm = max(step for step in (1, 2, 5, 10, 20, 50) if step <= most_mm)
    drawn = float(page.locator(".marks .bar").last.get_attribute("d").partition("h")[2])
    assert drawn == pytest.approx(bar_mm * pixels_per_mm, rel=0.01)
    bar = page.locator(".colour-bar svg")
    expect(bar).to_have_attribute("aria-label", "Colours from 1500 to 1520")
    # The range leaves out the least and the largest values: both ends are a little inside.
    expect(bar).to_have_text("150515101515")
    page.get_by_text("2,000 ns in the first iteration").wait_for()
    turns.put(None)
    expect(curve).to_have_attribute("data-points", "2")
    page.get_by_text("iteration 2 of at most").wait_for()
    share = float(page.get_by_label("Progress").get_attribute("value"))
    assert share > 2 / ITERATIONS - 1e-9
    expect(picture).to_have_attribute("aria-label", "Sound speed so far, 1500 to 1540 m/s")
    # The range widens at once, and narrows half of the way.
    expect(bar).to_have_attribute("aria-label", "Colours from 1500 to 1540")
    turns.put(None)
    expect(curve).to_have_attribute("data-points", "3")
    # As that of a result it leaves out a thousandth of the nodes at each end.
    expect(picture).to_have_attribute("aria-label", "Sound speed so far, 1500 to 1700 m/s")
    expect(bar).to_have_attribute("aria-label", "Colours from 1500 to 1530")
    label = "Misfit of 3 iterations: 2,000 ns to 667 ns"
    expect(page.get_by_role("img", name=label)).to_be_visible()
    assert curve.locator("path.curve").get_attribute("d").count("L") == 2
    assert float(page.get_by_label("Progress").get_attribute("value")) > share
    page.get_by_text("left", exact=False).and_(page.locator(".live-time")).wait_for()
    for _ in range(ITERATIONS - 3):
        turns.put(None)
    page.locator("#result-viewer canvas").first.wait_for()
    assert page.locator(".live-views").count() == 0


@pytest.mark.nightly
def test_it_can_be_cancelled_and_run_again(page, address, scan, turns):
    job = started(address, scan)
    page.goto(f"{address}/#/jobs/{job['id']}")
    page.get_by_text("The image appears after the first iteration").wait_for()
    tab_to(page, page.get_by_role("button", name="Cancel"))
    page.keyboard.press("Enter")
    page.get_by_text("Cancelled", exact=True).wait_for()
    again = page.get_by_role("link", name="Run again with changes")
    assert again.get_attribute("href") == f"#/scans/{job['dataset']}?from={job['id']}"
    assert page.locator("main .error:visible").count() == 0
    tab_to(page, again)
    page.keyboard.press("Enter")
    expect(page.get_by_label("Nodes per side")).to_have_value("16")


def test_a_failure_is_explained(page, address, scan, work):
    work.error = InvalidInput("settings", "no finite speed at 3 nodes", "smaller relaxation")
    page.goto(f"{address}/#/jobs/{started(address, scan)['id']}")
    reason = page.get_by_role("alert").filter(
        has_text="no finite speed at 3 nodes; accepted: smaller relaxation"
    )
    expect(reason).to_contain_text("Change this and run it again")
    page.locator(".live-time").get_by_text("took ").wait_for()
    page.get_by_role("link", name="Examine the scan").click()
    page.get_by_role("heading", level=1, name="Sixteen elements").wait_for()


ESTIMATE = """async (totals) => {
  const { ProgressEstimate } = await import("/static/jobs/progress_estimate.js");
  const one = new ProgressEstimate();
  const [shares, left] = [[], []];
  totals.forEach((total, now) => {
    // A report of 10 tasks every 5 s.
    if (now % 5 === 0) one.add(now, { done: 2 * now, total, phase: "picking" }, now);
    shares.push(one.share(now));
    left.push(one.left(now));
  });
  one.add(totals.length, { done: 0, total: 7, phase: "reconstructing" }, totals.length);
  return [shares, left, one.share(totals.length)];
}"""


@pytest.mark.nightly
def test_progress_between_two_reports_is_even_and_the_bar_never_jumps(page, shared_service):
    page.goto(shared_service.address)
    shares, left, next_phase = page.evaluate(ESTIMATE, [100] * 41)
    assert np.all(np.diff(shares) >= 0.0)
    # From the second report on each second is one fiftieth.
    np.testing.assert_allclose(np.diff(shares)[5:], 0.02, atol=1e-9)
    assert left[-1] == pytest.approx(10.0)
    assert next_phase == 0
    # Trials end early: fewer tasks than planned. Later there are some more.
    shares, left, _ = page.evaluate(ESTIMATE, [400] * 20 + [160] * 20 + [200] * 61)
    steps = np.diff(shares)
    assert steps.min() >= 0.0
    # At the fall, 40 of 400 tasks are done, and then 120 are left in place of 360: three times the pace.
    np.testing.assert_allclose(steps[6:19], 2 / 400, atol=1e-9)
    np.testing.assert_allclose(steps[21:39], (1 - shares[20]) * 2 / 120, atol=1e-9)
    np.testing.assert_allclose(steps[41:98], (1 - shares[40]) * 2 / 120, atol=1e-9)
    assert (shares[-1], left[-1]) == (1.0, 0.0)
    np.testing.assert_allclose(left[20:40], np.arange(60, 40, -1), atol=1e-9)


@pytest.mark.nightly
def test_a_misfit_that_falls_far_is_drawn_over_powers_of_ten(page, shared_service):
    page.goto(shared_service.address)
    texts, path = page.evaluate(
        """async () => {
          const { MisfitCurve } = await import("/static/jobs/misfit_curve.js");
          const { html, render } = await import("/static/parts/view.js");
          const place = document.createElement("div");
          const row = (value, k) => ({ stage: 0, sweep: k + 1, residual_rms_s: value });
          const history = [1e-6, 1e-7, 1e-8].map(row);
          render(html`<${MisfitCurve} history=${history} />`, place);
          const texts = [...place.querySelectorAll("text")].map((one) => one.textContent);
          return [texts, place.querySelector(".curve").getAttribute("d")];
        }"""
    )
    assert {"10", "20", "50", "100", "1000"} <= set(texts)
    heights = [float(point.split(" ")[1]) for point in path[1:].split("L")]
    assert heights[1] - heights[0] == pytest.approx(heights[2] - heights[1], abs=0.02)
    assert heights[1] - heights[0] > 50.0
