"""From the button Reconstruct to an image by rays, on to full waveforms in its place, and a stop."""

from dataclasses import replace

import httpx
import pytest
from playwright.sync_api import expect

from bentray_kernels.tomography.result import Candidate
from bentray_kernels.tomography.waveform.validation import Validation
from bentray_kernels.tomography.waveform.waveform_cost import advice
from bentray_workers.reconstruction import reconstruction_run

from .live_results import ITERATIONS, in_turns, uploaded

pytestmark = pytest.mark.browser

RAYS = Candidate({"rays": "curved", "method": "gauss-newton"}, 1e-7, 9e-8, 8e-8)


@pytest.fixture
def turns(work, monkeypatch):
    """Of the second job, one item an iteration; the first has an image that is not enough."""
    queue = in_turns(work, monkeypatch, band_hz=(6e4, 1.2e5))
    by_waves = reconstruction_run.reconstruct

    def reconstruct(client, path, settings, **control):
        if settings.minutes:
            return by_waves(client, path, settings, **control)
        made = work(client, path, settings, **control)
        advised = advice(Validation(misfit=0.32, water=0.02), RAYS, 1e-8, 1.0)
        return replace(made, trials=(RAYS,), provenance={**made.provenance, **advised})

    monkeypatch.setattr(reconstruction_run, "reconstruct", reconstruct)
    return queue


def test_fast_is_drawn_and_best_follows_in_its_place_until_it_is_stopped(page, address, scan, turns):
    page.goto(f"{address}/#/scans/{uploaded(address, scan())['id']}")
    page.get_by_role("button", name="Reconstruct", exact=True).click()
    image, waves = page.locator("#result-viewer"), page.locator(".live-views")
    stop = page.get_by_role("button", name="Stop")
    stop.wait_for()
    expect(image).to_be_visible()
    turns.put(None)
    expect(waves).to_be_visible()
    expect(image).to_be_hidden()
    expect(page.locator(".live-what")).to_contain_text("60 to 120 kHz, iteration 1")
    stop.click()
    expect(image).to_be_visible()
    expect(page.locator(".live-what")).to_contain_text("Cancelled")
    page.reload()
    expect(page.locator("#onward")).to_contain_text(
        "not enough for this scan (held-out misfit 16 \N{MULTIPLICATION SIGN} noise)"
    )
    fast = page.url
    page.get_by_role("button", name="Go on to Best").click()
    stop.wait_for()
    for _ in range(ITERATIONS):
        turns.put(None)
    page.wait_for_function("(before) => location.href.split('?')[0] !== before", arg=fast.split("?")[0])
    expect(image).to_be_visible()
    expect(page.locator("#onward")).to_have_count(0)
    jobs = httpx.get(f"{address}/v1/jobs").json()["jobs"]
    assert [job["state"] for job in jobs] == ["succeeded", "cancelled", "succeeded"], "all are kept"
