"""The ray caster in the browser, by WebGL2 in software: the pictures of the service, and when it is used."""

import base64
import io
from urllib.parse import urlencode

import httpx
import numpy as np
import pytest
from PIL import Image

from bentray_kernels.phantoms import ONE_HOLE, TWO_HOLES, sampled
from bentray_kernels.tomography import structural_similarity

from .live_results import stored_volume

pytestmark = pytest.mark.browser

# WebGL2 in software.
FLAGS = (
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-watchdog",
)
# On a machine under load the software renderer compiles for a minute.
PATIENCE_MS = 240_000

LOAD = """async ({ links, spacing, filter }) => {
    const { parseNpy } = await import("/static/viewer/npy.js");
    const { rayCaster } = await import("/static/webgl/ray_caster.js");
    const response = await fetch(`${links.coefficients}?filter=${filter}`);
    const { values, shape } = parseNpy(await response.arrayBuffer());
    window.caster = rayCaster(document.createElement("canvas"), { values, shape, spacing, filter });
}"""
DRAW = """view => {
    window.caster.draw(view);
    return window.caster.canvas.toDataURL("image/png");
}"""
WATCH = """canvas => {
    window.sources = [];
    const note = () => window.sources.push([canvas.dataset.source, canvas.dataset.quality]);
    new MutationObserver(note).observe(canvas, { attributeFilter: ["data-pictures"] });
}"""
PRESS_UNTIL_DRAWN = """async () => {
    const stage = document.querySelector("#stage");
    while (!window.sources.some(([source]) => source === "browser")) {
        stage.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
        await new Promise((go) => setTimeout(go, 400));
    }
}"""
SIZE = {"width": 128, "height": 128}
# Shares of red, green and blue.
GREY = (0.299, 0.587, 0.114)


@pytest.fixture
def page(page):
    page.set_default_timeout(PATIENCE_MS)
    return page


def holes():
    return np.round(255.0 * sampled(TWO_HOLES, 40)).astype(np.uint8)


def cut():
    """Two surfaces, the outer one cut by the faces of the grid; steps that differ between the axes."""
    x, y, z = np.ogrid[-1:1:24j, -1:1:30j, -1:1:20j]
    return (1.5 - x**2 - 0.3 * y**2 - 0.5 * z**2).astype(np.float32)


CASES = {
    "8-bit": (holes, "0.001", "bspline3", {"iso": [120.0], "index": [1.2]}),
    "layers": (cut, "0.001,0.0008,0.0015", "catmull-rom", {"iso": [0.9, 1.2], "index": [1.05, 1.1]}),
}


@pytest.mark.parametrize("name", ["8-bit", pytest.param("layers", marks=pytest.mark.nightly)])
def test_its_pictures_are_those_of_the_service(page, address, name):
    values, spacing, chosen, surfaces = CASES[name]
    volume = stored_volume(address, values(), f"?spacing_m={spacing}")
    page.goto(address)
    page.evaluate(LOAD, {"links": volume["links"], "spacing": volume["spacing_m"], "filter": chosen})
    views = [
        {"mode": "refract", "azimuth_deg": 120, "elevation_deg": -35, "zoom": 1.4, "up": "-y"},
        {"mode": "shaded", "azimuth_deg": 30, "elevation_deg": 20, "zoom": 1, "up": "x"},
    ]
    for view in views:
        here = page.evaluate(DRAW, {**view, **surfaces, **SIZE})
        computed = Image.open(io.BytesIO(base64.b64decode(here.partition(",")[2]))).convert("RGB")
        shown = surfaces if view["mode"] == "refract" else {"iso": surfaces["iso"]}
        query = urlencode({**view, **shown, **SIZE, "filter": chosen, "supersampling": "none"}, doseq=True)
        answer = httpx.get(f"{address}{volume['links']['refraction']}?{query}", timeout=120.0)
        expected = Image.open(io.BytesIO(answer.raise_for_status().content)).convert("RGB")
        assert np.ptp(np.asarray(expected)) > 100
        grey, other = (np.asarray(image) @ GREY for image in (computed, expected))
        assert structural_similarity(grey, other, np.ones(grey.shape, bool), 255.0) >= 0.98


def pretend(page, takes_ms, name="SwiftShader|"):
    """Let pictures take a given time by the clock of the caster, and pass for those of a graphics card."""

    def changed(route):
        body = route.fetch().text()
        for computed, instead in (("performance.now() - begun", takes_ms), (name, "")):
            assert computed in body
            body = body.replace(computed, instead)
        route.fulfill(body=body, content_type="text/javascript")

    page.route("**/ray_caster.js", changed)


def moved(page, address, tmp_path):
    """Store a volume in the page, and turn it once."""
    np.save(tmp_path / "ball.npy", sampled(ONE_HOLE, 12))
    page.goto(address + "/#/rendering")
    page.set_input_files("#volume-file", tmp_path / "ball.npy")
    page.get_by_text("ball.npy is stored").wait_for()
    page.get_by_role("button", name="Surface", exact=True).click()
    page.locator("#glass[data-quality=full]").wait_for()
    page.get_by_role("img", name="Histogram").wait_for()
    page.locator("#stage").focus()
    page.locator("#glass").evaluate(WATCH)
    page.keyboard.press("ArrowRight")


@pytest.mark.nightly
def test_the_page_draws_previews_here_once_the_volume_is_loaded(page, address, tmp_path):
    pretend(page, "1.0")
    with page.expect_response("**/coefficients*"):
        moved(page, address, tmp_path)
    page.evaluate(PRESS_UNTIL_DRAWN)
    # At rest the service draws.
    page.locator("#glass[data-quality=full][data-source=service]").wait_for()
    assert ["browser", "preview"] in page.evaluate("window.sources")
    assert ["browser", "full"] not in page.evaluate("window.sources")


@pytest.mark.nightly
@pytest.mark.parametrize("card", [True, False])
def test_the_service_draws_where_this_would_be_slow(page, address, tmp_path, card):
    loads = []
    page.on("request", lambda request: loads.append(request.url) if "coefficients" in request.url else None)
    if card:
        pretend(page, "26.0")
        with page.expect_response("**/coefficients*"):
            moved(page, address, tmp_path)
    else:
        moved(page, address, tmp_path)
    for azimuth in (40, 45, 50):
        page.keyboard.press("ArrowRight")
        page.locator(f"#glass[data-quality=full][data-address*='azimuth_deg={azimuth}&']").wait_for()
    assert len(loads) == card
    assert {source for source, _ in page.evaluate("window.sources")} == {"service"}
