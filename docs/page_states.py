"""Pictures of the states of the web page: `.venv/bin/python docs/page_states.py FOLDER [NAME …]`, minutes.

Each in light and dark colours, on a laptop and on a telephone, to be looked at after changes of the page;
`story` is one scan in eight steps, from a dropped file to an export. They are not part of the documentation,
whose pictures are made by `pictures.py`.
"""

import io
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import trimesh
from browser import browser
from pictures import SAMPLE, _Service, _service, _stored

from bentray_kernels.phantoms import TWO_HOLES, sampled
from bentray_workers.files.dataset import write_dataset
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate

SIZES = {"laptop": (1400, 900), "telephone": (390, 844)}
PATIENCE_MS = 60_000
SCHEMES = ("light", "dark")
MARKS = "profile=-75,0,75,0&ellipse=-12,12,18,44"
SART = {"method": "sart", "nodes": 96}
UNDER_WAY = {"method": "sart", "nodes": 128, "iterations": 1000}

# Address of a state, what is there once it is complete, and what is done before that.
State = tuple[str, str, Callable[[Any], None]]


def stay(page: Any) -> None:
    """Nothing is done."""


def refused(page: Any) -> None:
    """Upload a file that is no scan."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "notes.h5").write_text("only text")
        page.set_input_files("#scan-file", Path(folder) / "notes.h5")
        page.locator("#scan-error").wait_for()


def corrected(page: Any) -> None:
    """Open the form of a corrected copy."""
    page.get_by_role("button", name="Correct units, frequency or order").click()


def correction_refused(page: Any) -> None:
    """Send it with values that are not plausible."""
    corrected(page)
    page.get_by_label("Lengths in the original file").select_option("um")
    page.get_by_role("button", name="Make a corrected copy").click()
    page.locator("#correct-error").wait_for()


def settings_open(page: Any) -> None:
    """Open all settings."""
    page.get_by_text("All settings").click()


def rendered(page: Any) -> None:
    """Wait for the picture in full quality."""
    page.locator("[data-quality=full]").wait_for()


def away(page: Any) -> None:
    """The service does not answer."""
    page.context.set_offline(True)
    page.get_by_text("does not answer").first.wait_for()


def states(service: _Service) -> dict[str, State]:
    """Every state by its name; the service gets what they show."""
    client = service.client
    usual = simulate(SimulationSettings(nodes=96, elements=64, coupling_mps=1375.0), lambda _: None)
    scan = service.uploaded(usual)
    httpx.patch(f"{service.url}/v1/datasets/{scan}", json={"title": "Breast phantom"}).raise_for_status()
    assert usual.delta_tof_s is not None
    write_dataset(
        service.folder / "wrong.h5", replace(usual, delta_tof_s=1e-3 * usual.delta_tof_s, tof_s=None)
    )
    wrong = client.upload(service.folder / "wrong.h5").id
    lost = service.uploaded(replace(usual, title="Lost"))
    (service.folder / "data" / "tenants" / "local" / "datasets" / f"{lost}.h5").write_bytes(b"damaged")
    traced = client.wait(client.simulate(SAMPLE).id).dataset
    ways = [client.wait(client.submit(scan, {**SART, "rays": rays}).id).id for rays in ("straight", "curved")]
    failed = client.submit(lost, SART).id
    httpx.get(f"{service.url}/v1/jobs/{failed}").raise_for_status()
    volume = client.simulate({"phantom": "table7", "nodes": 32, "elements": 32, "slices": 4})
    stack = client.wait(
        client.submit(str(client.wait(volume.id).dataset), {"method": "sart", "nodes": 48}).id
    ).id
    content = io.BytesIO()
    np.save(content, np.round(255.0 * sampled(TWO_HOLES, 96)).astype(np.uint8))
    ball = _stored(service, "/v1/volumes?title=Ball with two holes", content.getvalue())
    ring = trimesh.creation.torus(1.0, 0.4, major_sections=96, minor_sections=48)
    mesh = _stored(service, "/v1/meshes?title=Torus", ring.export(file_type="ply"))
    asked = {"kind": "geometry-field", "mesh": mesh, "settings": {}}
    client.wait(httpx.post(f"{service.url}/v1/jobs", json=asked).raise_for_status().json()["id"])
    running, cancelled = (client.submit(scan, UNDER_WAY).id for _ in range(2))
    client.cancel(cancelled)
    pair = ",".join(ways)
    return {
        # First, since it ends.
        "job-running": (f"/jobs/{running}", "Cancel", stay),
        "scans": ("/", "Breast phantom", stay),
        "scans-refused": ("/", "Breast phantom", refused),
        "scan": (f"/scans/{traced}", "Receiving element 0", stay),
        "scan-settings": (f"/scans/{scan}", "Fast", settings_open),
        "scan-correction": (f"/scans/{wrong}", "Were times", corrected),
        "scan-correction-refused": (f"/scans/{wrong}", "Were times", correction_refused),
        "batch": ("/batch", "Breast phantom", stay),
        "job-cancelled": (f"/jobs/{cancelled}", "ancelled", stay),
        "job-failed": (f"/jobs/{failed}", "damaged", stay),
        "result": (f"/jobs/{ways[0]}?{MARKS}", "node ", stay),
        "result-overlay": (f"/jobs/{ways[0]}?over=coverage&interpolation=linear&{MARKS}", "node ", stay),
        "result-planes": (f"/jobs/{stack}?planes=3", "node ", stay),
        "comparison": (f"/compare/{pair}?{MARKS}", "m/s · B", stay),
        "comparison-difference": (f"/compare/{pair}?mode=difference", "Swipe", stay),
        "comparison-swipe": (f"/compare/{pair}?mode=swipe", "Swipe", stay),
        "rendering-planes": (f"/rendering/{ball}", "node ", stay),
        "rendering-lit": (f"/rendering/{ball}?view=surface", "azimuth", rendered),
        "rendering-glass": (f"/rendering/{ball}?mode=refract", "azimuth", rendered),
        "surfaces": (f"/surfaces/{mesh}?scene=mirror-ball&mode=self", "azimuth", rendered),
        "jobs": ("/jobs", "Lost", stay),
        "service": ("/service", "worker", stay),
        "unknown": ("/jobs/job-00000000000000000000", "job-0000", stay),
        "service-away": ("/jobs", "Lost", away),
    }


def story(page: Any, service: _Service, folder: Path) -> None:
    """From a dropped file over Fast and Best to measures and an export, each step in every look."""
    sample = service.client.wait(service.client.simulate(SAMPLE).id).dataset
    file = service.folder / "patient-17-left.h5"
    file.write_bytes(httpx.get(f"{service.url}/v1/datasets/{sample}/file").raise_for_status().content)
    page.goto("about:blank")
    page.goto(f"{service.url}/#/")
    page.locator("#scans .thumbnail").wait_for()
    looks(page, folder, "story-1-drop")
    page.set_input_files("#scan-file", file)
    page.get_by_text("Receiving element 0").wait_for()
    page.locator(".verdict").wait_for()
    looks(page, folder, "story-2-scan")
    page.locator("#start").click()
    page.locator(".job .state.succeeded").wait_for()
    page.locator(".job h2 a").click()
    page.locator(".readout").get_by_text("node ").wait_for()
    looks(page, folder, "story-3-fast")
    page.get_by_role("button", name="Go on to Best").click()
    page.get_by_text("Full waveform, ").wait_for()
    looks(page, folder, "story-4-best")
    page.locator(".screen canvas.plane").wait_for(timeout=10 * PATIENCE_MS)
    looks(page, folder, "story-5-result")
    page.goto(page.url.partition("?")[0] + "?" + MARKS)
    page.locator(".readout").get_by_text("node ").wait_for()
    looks(page, folder, "story-6-measure")
    page.get_by_text("Export", exact=True).click()
    looks(page, folder, "story-7-export")
    page.goto(f"{service.url}/#/jobs")
    page.locator(".job-table .thumbnail").first.wait_for()
    looks(page, folder, "story-8-jobs")


def main(folder: Path, names: list[str]) -> None:
    """Write the pictures of the named states, or of all."""
    folder.mkdir(parents=True, exist_ok=True)
    with _service() as service, browser(SIZES["laptop"]) as page:
        page.set_default_timeout(PATIENCE_MS)
        # Before there is anything.
        photograph(page, service, {"start": ("/", "No scan yet", stay)}, names, folder)
        if not names or "story" in names:
            story(page, service, folder)
        if set(names) != {"story"}:
            photograph(page, service, states(service), names, folder)


def photograph(page: Any, service: _Service, shown: dict[str, State], names: list[str], folder: Path) -> None:
    """The pictures of those of some states that are named, or of all."""
    for name, (address, text, act) in shown.items():
        if names and name not in names:
            continue

        def reach(address: str = address, text: str = text, act: Callable[[Any], None] = act) -> None:
            # A page of its own for each.
            page.goto("about:blank")
            page.goto(f"{service.url}/#{address}")
            page.locator("main").get_by_text(text).first.wait_for()
            act(page)

        looks(page, folder, name, reach)
        page.context.set_offline(False)


def looks(page: Any, folder: Path, name: str, reach: Callable[[], None] = lambda: None) -> None:
    """Pictures of a state in every look, which is reached before each."""
    for scheme, (size, (width, height)) in product(SCHEMES, SIZES.items()):
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": height})
        reach()
        page.wait_for_timeout(700)
        page.screenshot(path=folder / f"{name}-{scheme}-{size}.png", full_page=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
