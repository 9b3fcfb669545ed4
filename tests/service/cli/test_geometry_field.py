"""`bentray geometry-field`: a mesh in, a field and three pictures out, reused and resumed."""

import json
from pathlib import Path
from typing import Any

import pytest
import trimesh
from PIL import Image

from bentray_kernels.meshes.example_surfaces import torus
from bentray_workers.rendering import geometry_field

from .conftest import Run

SMALL = ("--samples", 6, "--inner-samples", 4, "--divisions", 4, "--image-size", 33)
PICTURE = ("--width", 32, "--height", 24)


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    ring = torus(16, 10)
    path = tmp_path / "ring.ply"
    path.write_bytes(trimesh.Trimesh(ring.vertices, ring.faces, process=False).export(file_type="ply"))
    return path


def test_a_field_and_its_pictures(bentray: Run, mesh: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = bentray("geometry-field", mesh, "-o", out, *SMALL, *PICTURE, "--mode", "refract")
    assert "320 faces, closed, genus 1" in result.stdout
    for name, size in (("image", (32, 24)), ("geometry-image", (33, 33)), ("normal-map", (33, 33))):
        assert Image.open(out / f"{name}.png").size == size
        assert str(out / f"{name}.png") in result.stdout.splitlines()
    record = json.loads((out / "geometry-field.json").read_text())
    assert (record["faces"], record["samples"], record["view"]["mode"]) == (320, 6, "refract")
    field = Path(record["outputs"]["field"])
    assert sorted(path.name for path in out.iterdir()) == sorted(
        [field.name, "image.png", "geometry-image.png", "normal-map.png", "geometry-field.json"]
    )


def test_a_field_is_made_once(
    bentray: Run, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"

    def figures(*words: object) -> dict[str, Any]:
        result = bentray("geometry-field", mesh, "-o", out, *SMALL, *PICTURE, "--json", *words)
        return dict(json.loads(result.stdout))

    first = figures()
    before = (out / "image.png").read_bytes()
    monkeypatch.setattr(geometry_field, "parameterise_mesh", None)
    second = figures("--scene", "two-mirrors")
    assert (out / "image.png").read_bytes() != before
    assert second["figures"] == first["figures"]
    assert second["outputs"] == first["outputs"]


def test_interrupted_field_is_resumed(
    bentray: Run, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(geometry_field, "finish", broken)
    bentray("geometry-field", mesh, "-o", tmp_path / "out", *SMALL, *PICTURE, code=130)
    monkeypatch.undo()
    monkeypatch.setattr(geometry_field, "parameterise_mesh", None)
    bentray("geometry-field", mesh, "-o", tmp_path / "out", *SMALL, *PICTURE)
    assert not list((tmp_path / "out").glob("*-unfinished"))
