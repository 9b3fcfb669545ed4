"""Turning a view in the web page with Chromium: previews a second on the canvas, and the wait at rest."""

import importlib
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE_MS = 300_000
# Movements of the pointer a second, as of a mouse; more would only take the processor from the pictures.
MOVES_HZ = 125.0
# Pixels that the pointer moves at a time, and between its turning points.
STEP_PX, SWING_PX = 3, 150
CORNER_PX = 5

# Notes each picture and each movement of the pointer, with its time.
OBSERVER = """canvas => {
    window.seen = { pictures: [], moved: 0 };
    const note = () => window.seen.pictures.push([performance.now(), canvas.dataset.quality]);
    new MutationObserver(note).observe(canvas, { attributeFilter: ["data-pictures"] });
    addEventListener("pointermove", () => { window.seen.moved = performance.now(); }, true);
}"""

# Whether the full picture was shown after the last movement.
RESTED = "() => window.seen.pictures.some(([at, quality]) => quality === 'full' && at > window.seen.moved)"


@dataclass(frozen=True)
class Turned:
    """Pictures shown during a turn.

    Attributes:
        rate: previews a second.
        previews: their number.
        rests_s: time from the last movement of the pointer to the full picture, s, of each motion.
    """

    rate: float
    previews: int
    rests_s: tuple[float, ...]


def missing() -> str:
    """Why no page can be opened; empty if one can."""
    if _browser() is None:
        return "no Chromium is installed"
    try:
        importlib.import_module("playwright.sync_api")
    except ImportError as error:
        return f"playwright is not installed ({error})"
    return ""


def _browser() -> str | None:
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


@contextmanager
def opened() -> Iterator[Any]:
    """A page of a headless Chromium."""
    playwright = importlib.import_module("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=_browser(), args=["--no-sandbox"])
        try:
            page = browser.new_page()
            page.set_default_timeout(PATIENCE_MS)
            yield page
        finally:
            browser.close()


def turn(page: Any, address: str, seconds: float, motions: int) -> Turned:
    """Open a view of the page and turn it by the pointer, several times, with rests between.

    Args:
        page: of ``opened``.
        address: of the view.
        seconds: of each motion.
        motions: how many.
    """
    page.goto("about:blank")
    page.goto(address)
    canvas, full = page.locator("#stage canvas"), page.locator("#stage canvas[data-quality=full]")
    full.wait_for()
    canvas.evaluate(OBSERVER)
    box = page.locator("#stage").bounding_box()
    # In a corner, where no object is dragged instead.
    x, y = box["x"] + CORNER_PX, box["y"] + CORNER_PX
    shown, moving_s, rests = 0, 0.0, []
    for _ in range(motions):
        page.evaluate("window.seen.pictures = []")
        page.mouse.move(x, y)
        page.mouse.down()
        begun = time.perf_counter()
        at = 0
        while time.perf_counter() - begun < seconds:
            at += STEP_PX
            page.mouse.move(x + abs(at % (2 * SWING_PX) - SWING_PX), y)
            time.sleep(max(0.0, begun + at / STEP_PX / MOVES_HZ - time.perf_counter()))
        moving_s += time.perf_counter() - begun
        page.mouse.up()
        page.wait_for_function(RESTED)
        seen = page.evaluate("window.seen")
        # Previews of the last views may be shown after the pointer has stopped.
        shown += sum(quality == "preview" and at <= seen["moved"] for at, quality in seen["pictures"])
        rests.append((seen["pictures"][-1][0] - seen["moved"]) / 1e3)
    return Turned(shown / moving_s, shown, tuple(rests))
