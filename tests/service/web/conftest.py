"""Debian's Chromium, and a page in it that must raise no error and keep to the Content-Security-Policy."""

import base64
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect, sync_playwright

from bentray_service.ingest import canonical
from bentray_service.settings import ServiceSettings
from bentray_workers.reconstruction import reconstruction_run

from ..conftest import FakeCluster, FakeWork, ingest_here, serving, write_scan

# Without windows, menus and their processes it takes two thirds of the time of the whole one.
PROGRAMS = Path("/usr/bin/chromium-headless-shell"), Path("/usr/bin/chromium")
CHROMIUM = next((path for path in PROGRAMS if path.exists()), PROGRAMS[0])
# A machine under load may be slow, and the first picture waits for kernels that are not compiled yet.
PATIENCE_MS = 60_000

expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture(scope="module")
def browser(request: pytest.FixtureRequest) -> Iterator[Any]:
    """Chromium without a graphics card; a file may name another one by ``FLAGS``."""
    if not CHROMIUM.exists():
        pytest.skip(f"no browser at {CHROMIUM}")
    flags = getattr(request.module, "FLAGS", ("--disable-gpu",))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", *flags], timeout=4 * PATIENCE_MS
        )
        yield browser
        browser.close()


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A page of its own context, so that no test sees cookies or storage of another."""
    with browser.new_context() as context:
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "console",
            lambda message: wrong.append(message.text) if "Security Policy" in message.text else None,
        )
        yield page
        assert wrong == []


def serious(page: Any, options: dict[str, Any] | None = None) -> dict[str, list[str]]:
    """Serious findings of axe on the page as it is, menus and details open: parts by the names of rules."""
    report = Axe().run(page, options=options).response
    assert report["passes"]
    return {
        rule["id"]: [node["html"][:120] for node in rule["nodes"][:3]]
        for rule in report["violations"]
        if rule["impact"] in ("serious", "critical")
    }


def tab_to(page: Any, goal: Any) -> None:
    """Press Tab until the first element of a locator has the focus."""
    goal.first.wait_for(state="attached")
    for _ in range(120):
        page.keyboard.press("Tab")
        if goal.first.evaluate("it => it === document.activeElement"):
            return
    raise AssertionError(f"{goal} has not been reached")


DROP = """([selector, files]) => {
    const dataTransfer = new DataTransfer();
    for (const [name, text] of files) {
        dataTransfer.items.add(new File([Uint8Array.from(atob(text), (one) => one.charCodeAt(0))], name));
    }
    const drop = new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true });
    document.querySelector(selector).dispatchEvent(drop);
}"""


def drop(page: Any, selector: str, suffix: str = ".h5", **files: bytes) -> None:
    """Drop files on an element, as if from the desktop: contents by their names without suffix."""
    contents = [[f"{name}{suffix}", base64.b64encode(content).decode()] for name, content in files.items()]
    page.evaluate(DROP, [selector, contents])


class SharedService(NamedTuple):
    """A service for all tests of a file, which change only scans and jobs of their own.

    Attributes:
        address: of the service.
        scan: writes the small scan.
        work: of its jobs.
        monkeypatch: of the file.
        folder: for files.
    """

    address: str
    scan: Callable[..., Path]
    work: FakeWork
    monkeypatch: pytest.MonkeyPatch
    folder: Path


@pytest.fixture(scope="module")
def shared_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SharedService]:
    """Serve like ``serve``, once for a file."""
    folder = tmp_path_factory.mktemp("shared")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(canonical, "ingest", ingest_here)
        work = FakeWork()
        monkeypatch.setattr(reconstruction_run, "reconstruct", work)
        # Tests look at it faster than a person.
        settings = ServiceSettings(
            data_dir=folder / "data", renders_per_minute=0, webhook_networks="127.0.0.0/8"
        )
        with serving(settings, FakeCluster()) as address:
            yield SharedService(address, partial(write_scan, folder / "scan.h5"), work, monkeypatch, folder)


@pytest.fixture
def address(shared_service: SharedService) -> str:
    """Address of the service of all tests of a file; each has scans and results of its own."""
    return shared_service.address
