"""Surface rendering: upload, geometry field, view."""

import re
from dataclasses import replace

import pytest
import trimesh
from playwright.sync_api import expect

from bentray_kernels.meshes.example_surfaces import torus
from bentray_service.jobs import kinds

pytestmark = pytest.mark.browser


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
    page.goto(serve() + "/#/surfaces")
    make = page.get_by_role("button", name="Build the geometry field")
    expect(make).to_be_disabled()
    page.set_input_files("#mesh-file", tmp_path / "ring.ply")
    page.get_by_text("ring.ply is stored").wait_for()
    page.get_by_text("320 faces · closed · 1 handle").wait_for()
    expect(page.get_by_label("Samples per edge")).to_have_value("24")
    page.get_by_label("Samples per edge").fill("6")
    make.click()
    job = page.locator(".job")
    job.get_by_role("heading", name="Geometry field").wait_for()
    job.get_by_text("6 samples per edge").wait_for()
    image = page.get_by_role("img", name="ring.ply, reflect")
    expect(image).to_have_js_property("naturalWidth", 512)
    assert job.get_by_role("link", name="Normal map").get_attribute("href").endswith("/normal-map.png")
    page.get_by_label("Scene").select_option("two-mirrors")
    page.get_by_label("Material").select_option("glass")
    image = page.get_by_role("img", name="ring.ply, refract")
    expect(image).to_have_attribute("src", re.compile("mode=refract&scene=two-mirrors&"))
    (tmp_path / "notes.txt").write_text("only text")
    page.set_input_files("#mesh-file", tmp_path / "notes.txt")
    expect(page.locator("#mesh-error")).to_contain_text("PLY")
