"""The page of a running job: progress, image and misfit of each iteration, cancellation, a failure."""

from __future__ import annotations

import queue
from dataclasses import replace

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Cancelled
from bentray_kernels.tomography.reconstruction_graph import ReconstructionCheckpoint
from bentray_kernels.tomography.result import Iteration, Progress
from bentray_kernels.tomography.sart import sart_step
from bentray_workers.cluster.checkpoints import Checkpoints
from bentray_workers.reconstruction import reconstruction_run

pytestmark = pytest.mark.browser

# Of the image of each iteration.
CONTRASTS_MPS = (20.0, 40.0, 20.0, 30.0, 40.0, 50.0)
ITERATIONS = len(CONTRASTS_MPS)


@pytest.fixture
def turns(work, monkeypatch):
    """A queue; for each of its items a reconstruction makes one iteration and saves its image."""
    waiting: queue.Queue[None] = queue.Queue()

    def reconstruct(client, path, settings, on_progress, stop, work_dir, on_saved, share):
        kept, history = Checkpoints(work_dir / reconstruction_run.CHECKPOINTS), ()
        on_progress(Progress(0, 8 * ITERATIONS, (), "reconstructing"))
        for sweep in range(1, ITERATIONS + 1):
            while True:
                if stop():
                    raise Cancelled
                try:
                    waiting.get(timeout=0.05)
                    break
                except queue.Empty:
                    pass
            speed = 1500.0 + CONTRASTS_MPS[sweep - 1] * np.linspace(0.0, 1.0, 48).reshape(8, 6)
            state = replace(sart_step.begin(1.0 / speed), sweep=sweep)
            kept.save("0-00000", ReconstructionCheckpoint(0, 0, (), state, ()))
            history += (Iteration(0, sweep, 2e-6 / sweep, 8),)
            on_progress(Progress(8 * sweep, 8 * ITERATIONS, history, "reconstructing"))
        return work(client, path, settings, on_progress, stop, work_dir, on_saved, share)

    monkeypatch.setattr(reconstruction_run, "reconstruct", reconstruct)
    return waiting


def started(address, scan):
    stream = {"Content-Type": "application/x-hdf5"}
    with httpx.Client(base_url=address, timeout=60) as http:
        sent = http.post("/v1/datasets", content=scan().read_bytes(), headers=stream).json()
        asked = {"kind": "reconstruction", "dataset": sent["id"], "settings": {"method": "sart", "nodes": 16}}
        return http.post("/v1/jobs", json=asked).json()


def test_it_sharpens_until_the_result_is_shown(page, serve, scan, turns):
    address = serve()
    page.goto(f"{address}/#/jobs/{started(address, scan)['id']}")
    page.get_by_text("The image appears after the first iteration").wait_for()
    page.get_by_text("0 % of this step").wait_for()
    page.get_by_role("heading", level=1, name="SART, bent rays").wait_for()
    picture, curve = page.locator("canvas.preview"), page.locator(".misfit svg")
    turns.put(None)
    expect(picture).to_have_attribute("aria-label", "Sound speed so far, 1500 to 1520 m/s")
    # The image has x to the right and y up: the largest value is at the upper right.
    assert picture.evaluate("it => [it.width, it.height]") == [8, 6]
    corner = "it => [...it.getContext('2d').getImageData(7, 0, 1, 1).data]"
    # The last colour of viridis.
    np.testing.assert_allclose(picture.evaluate(corner), [253, 231, 37, 255], atol=2)
    expect(page.locator(".colour-bar .ticks")).to_have_text("150015101520")
    page.get_by_text("2.00e+3 ns in the first iteration").wait_for()
    turns.put(None)
    expect(curve).to_have_attribute("data-points", "2")
    page.get_by_text("iteration 2 of at most").wait_for()
    share = float(page.get_by_label("Progress").get_attribute("value"))
    assert share >= 2 / ITERATIONS
    expect(picture).to_have_attribute("aria-label", "Sound speed so far, 1500 to 1540 m/s")
    # The range widens at once, and narrows half of the way.
    expect(page.locator(".colour-bar .ticks")).to_have_text("150015201540")
    turns.put(None)
    expect(curve).to_have_attribute("data-points", "3")
    expect(page.locator(".colour-bar .ticks")).to_have_text("150015151530")
    label = "Misfit of 3 iterations: 2.00e+3 to 667 ns"
    expect(page.get_by_role("img", name=label)).to_be_visible()
    assert curve.locator("path.curve").get_attribute("d").count("L") == 2
    assert float(page.get_by_label("Progress").get_attribute("value")) > share
    page.get_by_text("left", exact=False).and_(page.locator(".live-time")).wait_for()
    for _ in range(ITERATIONS - 3):
        turns.put(None)
    page.locator("#result-viewer canvas").first.wait_for()
    assert page.locator(".live-views").count() == 0


def test_it_can_be_cancelled_and_run_again(page, serve, scan, turns):
    address = serve()
    job = started(address, scan)
    page.goto(f"{address}/#/jobs/{job['id']}")
    page.get_by_text("The image appears after the first iteration").wait_for()
    page.get_by_role("button", name="Cancel").click()
    page.get_by_text("Cancelled", exact=True).wait_for()
    again = page.get_by_role("link", name="Run again with changes")
    assert again.get_attribute("href") == f"#/scans/{job['dataset']}?from={job['id']}"
    assert page.locator("main .error:visible").count() == 0


def test_a_failure_is_explained(page, serve, scan, work):
    work.error = InvalidInput("settings", "no finite speed at 3 nodes", "smaller relaxation")
    address = serve()
    page.goto(f"{address}/#/jobs/{started(address, scan)['id']}")
    reason = page.get_by_role("alert").filter(
        has_text="no finite speed at 3 nodes; accepted: smaller relaxation"
    )
    expect(reason).to_contain_text("Change this and run it again")
    page.locator(".live-time").get_by_text("took ").wait_for()
    page.get_by_role("link", name="Examine the scan").click()
    page.get_by_role("heading", level=1, name="Sixteen elements").wait_for()


def test_progress_between_two_reports_is_even(page, serve):
    page.goto(serve())
    shares, left, next_phase = page.evaluate(
        """async () => {
          const { ProgressEstimate } = await import("/static/parts/progress_estimate.js");
          const one = new ProgressEstimate();
          const shares = [];
          for (let now = 0; now <= 40; now += 1) {
            // A report of 10 tasks every 5 s.
            if (now % 5 === 0) one.add(now, { done: 2 * now, total: 100, phase: "picking" }, now);
            shares.push(one.share(now));
          }
          const left = one.left(40);
          one.add(41, { done: 0, total: 7, phase: "reconstructing" }, 41);
          return [shares, left, one.share(41)];
        }"""
    )
    assert np.all(np.diff(shares) >= 0.0)
    # From the second report on each second is one fiftieth.
    np.testing.assert_allclose(np.diff(shares)[5:], 0.02, atol=1e-9)
    assert left == pytest.approx(10.0)
    assert next_phase == 0
