"""The web page in Chromium: time to its first paint, and to each slice while a volume is scrubbed."""

import os
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.client import Client

from . import _orbit_page
from ._http_load import served

# Slices of a 3-D breast phantom, along travel times.
SCAN = {"phantom": "table7", "nodes": 48, "elements": 32, "slices": 4}
NODES, QUICK_NODES = 256, 64
LOADS, QUICK_LOADS = 20, 3
STEPS, QUICK_STEPS = 400, 40
FIRST_PAINT_GOAL_MS, SCRUBBING_GOAL_MS = 1000.0, 50.0

PAINT = "() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
# From the event of the slider to the end of the frame in which the page has drawn the slice.
SCRUB = """async ([steps]) => {
    const slider = document.querySelector(".slices input");
    const taken = [];
    for (let step = 0; step < steps; step += 1) {
        const begun = performance.now();
        slider.value = step % (Number(slider.max) + 1);
        slider.dispatchEvent(new Event("input", { bubbles: true }));
        await new Promise(done => requestAnimationFrame(done));
        taken.push(performance.now() - begun);
        // The next one begins at another time of a frame.
        await new Promise(done => setTimeout(done, 7 * (step % 5)));
    }
    return taken;
}"""


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """First paint of the page of scans and of a result, and scrubbing, with the load that they began at."""
    nodes = QUICK_NODES if context.quick else NODES
    labels = (
        ("first paint, page of scans", FIRST_PAINT_GOAL_MS),
        ("first paint, page of a result", FIRST_PAINT_GOAL_MS),
        (f"scrubbing slices of {nodes}², p95", SCRUBBING_GOAL_MS),
    )
    if reason := _orbit_page.missing():
        yield from (Row(label, None, goal, "<", "ms", reason) for label, goal in labels)
        return
    with served() as (url, _), Client(url) as client:
        context.progress(0, 4, "reconstructing a volume")
        scan = client.wait(client.simulate(SCAN).id).dataset
        job = client.wait(client.submit(str(scan), {"method": "sart", "nodes": nodes, "iterations": 1}).id)
        yield from _measured(context, labels, url, f"{url}/#/jobs/{job.id}")


def _measured(
    context: BenchmarkContext, labels: tuple[tuple[str, float], ...], scans: str, result: str
) -> Iterator[Row]:
    detail = f"load average {os.getloadavg()[0]:.1f}; headless Chromium on the same machine"
    loads = QUICK_LOADS if context.quick else LOADS
    for number, address in enumerate((scans, result)):
        label, goal = labels[number]
        context.progress(1 + number, 4, label)
        taken = [_first_paint_ms(address) for _ in range(loads)]
        words = f"p95 of {loads} loads without a cache, median {np.median(taken):.0f} ms; {detail}"
        yield Row(label, float(np.percentile(taken, 95)), goal, "<", "ms", words)
    label, goal = labels[2]
    context.progress(3, 4, label)
    steps = QUICK_STEPS if context.quick else STEPS
    with _orbit_page.opened() as page:
        page.goto(result)
        page.locator(".readout").filter(has_text="mm").wait_for()
        taken = page.evaluate(SCRUB, [steps])
    words = f"{steps} steps, median {np.median(taken):.1f} ms, longest {max(taken):.1f} ms; {detail}"
    yield Row(label, float(np.percentile(taken, 95)), goal, "<", "ms", words)


def _first_paint_ms(address: str) -> float:
    """First contentful paint of a page in a browser that has just been started."""
    with _orbit_page.opened() as page:
        page.goto(address)
        page.locator("main h1").first.wait_for()
        page.wait_for_function(PAINT)
        painted_ms: Any = page.evaluate(PAINT)
        return float(painted_ms)
