"""Surface rendering: upload, geometry field, view."""

import re
from dataclasses import replace

import httpx
import numpy as np
import pytest
import trimesh
from playwright.sync_api import expect

from bentray_kernels.meshes.example_surfaces import torus
from bentray_service.jobs import kinds
from bentray_workers.rendering.field_scenes import PLACES, camera_of
from bentray_workers.rendering.field_view import FieldView

pytestmark = pytest.mark.browser


def seen_at(view, place_m):
    """u and v of a place in the picture of a view, by the service's own camera."""
    camera = camera_of(view)
    to = np.asarray(place_m) - camera.origin[0]
    along, right, down = np.linalg.solve(camera.direction.T, to)
    return right / along, down / along


def drag_and_turn(page):
    """Drag the first of two objects from its place over the ground to another one, then turn the view."""
    view, height = FieldView(scene="two-mirrors"), 0.55
    (x, y), other = PLACES["two-mirrors"]
    goal = (-0.9, -0.4)
    page.locator("#stage").evaluate("stage => stage.scrollIntoView({ block: 'center' })")
    box = page.locator("#stage").bounding_box()

    def pixel(place):
        u, v = seen_at(view, (*place, height))
        return box["x"] + (0.5 + u) * box["width"], box["y"] + (0.5 + v) * box["height"]

    page.mouse.move(*pixel((x, y)))
    page.mouse.down()
    page.mouse.move(*pixel((-0.7, -0.1)))
    page.mouse.move(*pixel(goal))
    page.mouse.up()
    for name, place in zip(("x", "y"), goal, strict=True):
        result = page.get_by_label(f"Object 1, {name}, m").input_value()
        assert float(result) == pytest.approx(place, abs=0.01)
        expect(page.get_by_label(f"Object 2, {name}, m")).to_have_value(f"{other[name == 'y']:g}")
    image = page.locator("#field-picture[data-quality=full][data-address*='positions_m']")
    image.wait_for()
    # Beside the objects the pointer turns the view, and keys do.
    page.mouse.move(box["x"] + 5, box["y"] + 5)
    page.mouse.down()
    page.mouse.move(box["x"] + 25, box["y"] + 5)
    page.mouse.up()
    expect(page.get_by_label("Azimuth, degrees")).to_have_value("-70")
    page.locator("#stage").focus()
    page.keyboard.press("ArrowUp")
    expect(image).to_have_attribute("data-address", re.compile("azimuth_deg=-70&elevation_deg=20&"))
    page.get_by_label("Object 2, x, m").fill("1.25")
    page.get_by_label("Object 2, x, m").press("Tab")
    expect(image).to_have_attribute("data-address", re.compile("positions_m=1.25&positions_m=-0.1&"))
    page.set_viewport_size({"width": 360, "height": 740})
    assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_a_mesh_is_uploaded_and_its_field_looked_at(page, serve, tmp_path, monkeypatch):
    build = kinds.geometry_field.build_field

    def small(_, mesh, settings, *folders, **control):
        # The settings of the page take seconds.
        coarse = replace(settings, inner_samples=4, divisions=4, image_size=33)
        return build(None, mesh, coarse, *folders, **control)

    monkeypatch.setattr(kinds.geometry_field, "build_field", small)
    ring = torus(16, 10)
    content = trimesh.Trimesh(ring.vertices, ring.faces, process=False).export(file_type="ply")
    (tmp_path / "ring.ply").write_bytes(content)
    address = serve()
    page.goto(address + "/#/surfaces")
    make = page.get_by_role("button", name="Build the geometry field")
    expect(make).to_be_disabled()
    page.set_input_files("#mesh-file", tmp_path / "ring.ply")
    page.get_by_text("ring.ply is stored").wait_for()
    page.get_by_text("320 faces · closed · 1 handle").wait_for()
    # It is drawn at once, as clay, without a field.
    image = page.locator("#field-picture[data-quality=full]")
    expect(image).to_have_attribute("data-address", re.compile("/v1/meshes/.*mode=diffuse&.*up=auto&"))
    expect(page.get_by_label("Field lookup")).to_be_disabled()
    page.get_by_label("Up axis").select_option("-x")
    expect(image).to_have_attribute("data-address", re.compile("up=-x&"))
    page.wait_for_url(re.compile("#/surfaces/mesh-.*up=-x&"))
    page.goto(f"{address}/#/surfaces")
    expect(image).to_have_attribute("data-address", re.compile("up=-x&"))
    page.get_by_label("Up axis").select_option("automatic")
    page.get_by_label("Material").select_option("mirror")
    expect(page.get_by_label("Samples per edge")).to_have_value("24")
    page.get_by_label("Samples per edge").fill("6")
    make.click()
    job = page.locator(".job")
    job.get_by_role("heading", name="Geometry field").wait_for()
    job.get_by_text("6 samples per edge").wait_for()
    expect(image).to_have_attribute("data-address", re.compile("/v1/geometry-fields/.*lookup=accurate&"))
    expect(image).to_have_js_property("width", 512)
    expect(page.get_by_role("img", name="ring.ply, reflect")).to_have_count(1)
    assert job.get_by_role("link", name="Normal map").get_attribute("href").endswith("/normal-map.png")
    figures = page.get_by_role("row", name="Geometry image off the surface, rms")
    record = httpx.get(f"{address}/v1/geometry-fields").json()["geometry_fields"][0]
    rms = float(figures.get_by_role("cell").inner_text().removesuffix(" %"))
    assert rms == pytest.approx(100.0 * record["errors"]["image_rms"], rel=0.06)
    page.locator("select[name=scene]").select_option("two-mirrors")
    page.locator("select[name=mode]").select_option("glass")
    expect(image).to_have_attribute("data-address", re.compile("mode=refract&scene=two-mirrors&"))
    drag_and_turn(page)
    page.once("dialog", lambda dialog: dialog.accept())
    gone = page.url
    page.get_by_role("button", name="Delete the mesh").click()
    expect(page.locator("#mesh")).to_have_text("No mesh uploaded yet")
    expect(page.get_by_role("button", name="Delete the mesh")).to_be_hidden()
    (tmp_path / "notes.txt").write_text("only text")
    page.set_input_files("#mesh-file", tmp_path / "notes.txt")
    expect(page.locator("#mesh-error")).to_contain_text("PLY")
    page.goto(gone)
    page.get_by_role("heading", name="Not found").wait_for()
