"""Pictures of geometry fields: every scene, material and lookup; tiles; cached scenes."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.example_surfaces import bumpy_ball, torus
from bentray_kernels.requests.request_fields import choices_of
from bentray_workers.files.geometry_field_folder import (
    GeometryMaps,
    read_geometry_image,
    write_geometry_image,
)
from bentray_workers.rendering import field_cache, field_picture, tiles
from bentray_workers.rendering.field_cache import world_at
from bentray_workers.rendering.field_picture import map_png, picture_png, tasks_of, tile_image
from bentray_workers.rendering.field_scenes import PLACES
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import LOOKUPS, FieldView

from ..pixels import pixels_of
from .field_folders import field_of, stored

CHOICES = choices_of(FieldView)

SIZE = {"width": 48, "height": 40}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A ring that sees itself."""
    settings = FieldSettings(samples=10, inner_samples=6, divisions=8, image_size=65)
    return field_of(tmp_path_factory.mktemp("field"), torus(24, 16), settings)


def drawn(folder, **how):
    return pixels_of(picture_png(folder, FieldView(**{**SIZE, **how}))).astype(int)


@pytest.mark.parametrize(
    "name",
    [
        *(name for name in CHOICES if name != "device"),
        "index",
        "share",
        "azimuth_deg",
        "elevation_deg",
        "zoom",
        "depth",
    ],
)
def test_every_field_changes_the_picture(folder, name):
    plain = {"mode": "refract", "lookup": "nearest", "eye": "nearest"}
    numbers = {"index": 1.1, "share": 0.3, "azimuth_deg": 10, "elevation_deg": 60, "zoom": 2, "depth": 1}
    values = CHOICES.get(name, (getattr(FieldView(), name), numbers.get(name)))
    pictures = [drawn(folder, **{**plain, name: value}) for value in values]
    seen = {picture.tobytes() for picture in pictures}
    # Rays walk within the ring: of the lookups only those from outside differ there. It stands on z.
    assert len(seen) >= (2 if name in ("lookup", "eye") else len(values) - (name == "up"))


@pytest.mark.parametrize("scene", ["mirror-ball", "two-mirrors"])
def test_moved_objects_share_the_tables_and_are_where_they_were_put(folder, scene):
    still = FieldView(scene=scene)
    points = tuple(0.5 + place for pair in PLACES[scene] for place in pair)
    before, after = world_at(folder, still), world_at(folder, replace(still, positions_m=points))
    assert after.faces is before.faces
    assert after.known is before.known
    # All of them by half a metre along x and y, on the same ground; the inverse follows.
    moved = after.to_world - before.to_world
    expected = np.zeros_like(moved)
    expected[:, :2, 3] = 0.5
    np.testing.assert_allclose(moved, expected, atol=1e-12)
    back = np.einsum("nij,nj->ni", after.to_local[:, :, :3], after.to_world[:, :, 3])
    np.testing.assert_allclose(back, -after.to_local[:, :, 3], atol=1e-12)
    np.testing.assert_array_equal(world_at(folder, still).to_world, before.to_world)
    same = tuple(place for pair in PLACES[scene] for place in pair)
    np.testing.assert_array_equal(drawn(folder, scene=scene), drawn(folder, scene=scene, positions_m=same))
    assert (drawn(folder, scene=scene) != drawn(folder, scene=scene, positions_m=points)).any()


def test_the_picture_has_its_size(folder):
    assert drawn(folder, rays=2).shape == (40, 48, 3)


@pytest.mark.parametrize("mode", CHOICES["mode"])
@pytest.mark.parametrize("scene", CHOICES["scene"])
def test_the_accurate_lookup_is_nearly_exact(folder, scene, mode):
    how = {"scene": scene, "mode": mode, "azimuth_deg": -90.0}
    off = np.abs(drawn(folder, **how, eye="accurate") - drawn(folder, **how, lookup="exact")).max(axis=2)
    assert (off > 16).mean() < 0.03


def test_a_mesh_without_field_is_drawn_by_exact_intersection(folder, tmp_path):
    mesh = stored(tmp_path, torus(24, 16))
    for mode in ("diffuse", "refract"):
        view = FieldView(**SIZE, mode=mode, lookup="exact", scene="two-mirrors")
        off = np.abs(pixels_of(picture_png(mesh, view)).astype(int) - pixels_of(picture_png(folder, view)))
        assert (off > 2).mean() < 0.005


def test_edges_of_glass_are_smoothed(folder, monkeypatch):
    glass = {"mode": "refract", "index": 1.7}
    smooth, mirror = drawn(folder, **glass), drawn(folder)
    monkeypatch.setattr(field_picture, "smooth_edges", lambda *_: None)
    noisy, fine = drawn(folder, **glass), drawn(folder, **glass, rays=8)
    np.testing.assert_array_equal(drawn(folder), mirror)
    before, after = (np.sqrt(np.mean((image - fine) ** 2)) for image in (noisy, smooth))
    assert after < 0.8 * before


def test_threads_draw_the_same_picture(folder):
    view = FieldView(**SIZE, scene="mirror-ball", mode="self")
    first, three = (tile_image(folder, view, 0, 40, threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(three.image, first.image)


@pytest.mark.parametrize("mode", ["reflect", "refract"])
def test_tiles_equal_parts_of_the_whole(folder, cluster, monkeypatch, mode):
    view = FieldView(**SIZE, rays=2, mode=mode)
    whole = picture_png(folder, view)
    parts = [tile_image(folder, view, first, first + 8) for first in range(0, 40, 8)]
    off = np.abs(np.concatenate([part.image for part in parts]).astype(int) - pixels_of(whole)).max(axis=2)
    assert (off > 2).mean() < 0.002
    monkeypatch.setattr(tiles, "TASK_RAYS", 8 * 48 * 4)
    assert len(tiles.tile_rows(view)) == 5
    assert Image.open(io.BytesIO(tiles.submit(cluster.client, tasks_of(folder, view), 0).result())).size == (
        48,
        40,
    )


def test_self_reflection_alone_is_dark_around(folder):
    dark = drawn(folder, mode="self-only")
    assert (dark[0] < 20).all()
    assert drawn(folder, mode="self")[0].mean() > 60


def test_colours_of_the_mesh_are_its_texture(folder, tmp_path):
    coloured = tmp_path / "coloured"
    coloured.mkdir()
    for file in folder.iterdir():
        (coloured / file.name).write_bytes(file.read_bytes())
    maps = read_geometry_image(coloured / "geometry-image.h5")
    pure = np.zeros((*maps.valid.shape, 3), np.float32)
    pure[..., 1] = 1.0
    write_geometry_image(
        coloured / "geometry-image.h5", GeometryMaps(maps.positions, maps.normals, maps.valid, pure)
    )
    middle = drawn(coloured, mode="diffuse", zoom=2.0, elevation_deg=60)[8:12, 20:28]
    assert (middle[..., 1] > 40).all()
    assert (middle[..., [0, 2]] == 0).all()


def test_maps(folder):
    positions, normals = (map_png(folder, what) for what in ("positions", "normals"))
    assert positions != normals
    assert Image.open(io.BytesIO(normals)).size == (65, 65)
    with pytest.raises(InvalidInput, match="colours"):
        map_png(folder, "colours")


def test_a_scene_is_made_once_and_tables_are_not_copied(folder, monkeypatch):
    monkeypatch.setattr(field_cache, "_WORLDS", field_cache.MemoryCache(2**30))
    monkeypatch.setattr(field_cache, "_SHAPES", field_cache.MemoryCache(2**30))
    view = FieldView(scene="mirror-ball")
    world = world_at(folder, view)
    assert world_at(folder, FieldView(scene="mirror-ball", azimuth_deg=3.0)) is world
    other = world_at(folder, FieldView(scene="two-mirrors"))
    assert other is not world
    assert np.shares_memory(other.faces, world.faces)
    assert np.shares_memory(other.inner_faces, world.inner_faces)
    assert field_cache._WORLDS.held() >= 2 * (6 * 100) ** 2


def test_published_tables_are_made_where_a_view_reads_them(folder, monkeypatch):
    for name in ("_WORLDS", "_SHAPES"):
        monkeypatch.setattr(field_cache, name, field_cache.MemoryCache(2**30))
    plain = world_at(folder, FieldView(scene="two-mirrors"))
    assert plain.uv.size == plain.images.size == plain.inner_uv.size == 1
    before = field_cache._SHAPES.held()
    first, other = (
        world_at(folder, FieldView(scene=scene, eye="uv-linear")) for scene in ("two-mirrors", "object")
    )
    assert first.uv.size == 2 * (6 * 100) ** 2
    assert first.images.size == 6 * 65**2
    assert first.inner_uv.size == 2 * first.inner_faces.size
    assert np.shares_memory(first.uv, other.uv)
    made = first.uv.nbytes + first.images.nbytes + first.inner_uv.nbytes
    assert field_cache._SHAPES.held() == before + made


def test_published_lookups_of_a_mesh_are_nearly_exact(folder):
    exact = drawn(folder, mode="diffuse")
    off = {name: np.abs(drawn(folder, mode="diffuse", eye=name) - exact).max(axis=2) for name in LOOKUPS}
    assert (off["uv-linear"] > 16).mean() < 0.2
    assert (off["accurate"] > 16).mean() < (off["uv-linear"] > 16).mean()


@pytest.mark.parametrize("mode", ["refract", "self"])
def test_published_lookups_serve_rays_that_leave_the_mesh(folder, mode):
    pictures = {name: drawn(folder, mode=mode, lookup=name) for name in ("exact", "uv-nearest", "uv-linear")}
    off = {name: np.abs(picture - pictures["exact"]).max(axis=2) > 16 for name, picture in pictures.items()}
    for name in ("uv-nearest", "uv-linear"):
        assert 0.0 < off[name].mean() < 0.5


def test_oversize_entries_are_not_cached(folder, monkeypatch):
    monkeypatch.setattr(field_cache, "_WORLDS", field_cache.MemoryCache(10))
    view = FieldView(scene="two-mirrors")
    assert world_at(folder, view) is not world_at(folder, view)
    assert field_cache._WORLDS.held() == 0


def test_tables_of_another_surface_are_rejected(folder, tmp_path):
    other = field_of(tmp_path, bumpy_ball(300))
    (other / "chart.h5").write_bytes((folder / "chart.h5").read_bytes())
    with pytest.raises(InvalidInput, match="faces"):
        picture_png(other, FieldView(**SIZE))


def test_every_lookup_is_a_choice():
    assert set(LOOKUPS) == set(CHOICES["lookup"])
