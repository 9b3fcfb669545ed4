"""Geometry images survive their files, and their pictures show what they hold."""

import io
from dataclasses import replace

import h5py
import numpy as np
import pytest
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.example_surfaces import sphere
from bentray_workers.files.geometry_field_folder import (
    GeometryMaps,
    quantity_png,
    read_geometry_image,
    write_geometry_image,
)


@pytest.fixture(scope="module")
def maps():
    surface = sphere(9, 10)
    chart = parameterise(surface).chart
    return GeometryMaps.from_geometry_image(geometry_image(chart, 32), chart.mesh.vertices)


@pytest.mark.parametrize("coloured", [True, False])
def test_maps_survive_their_file(tmp_path, maps, coloured):
    kept = maps if coloured else replace(maps, colours=None)
    write_geometry_image(tmp_path / "a.h5", kept)
    read = read_geometry_image(tmp_path / "a.h5")
    for name in ("positions", "normals", "valid", "colours"):
        np.testing.assert_array_equal(getattr(read, name), getattr(kept, name))
    assert read.positions.dtype == np.float32
    assert read.valid.dtype == bool


def test_colours_follow_the_surface(maps):
    # Each vertex has its own place for a colour.
    np.testing.assert_allclose(maps.colours, maps.positions, atol=1e-6)
    assert maps.valid.any()
    assert not maps.valid.all()


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("valid", np.zeros((4, 5), np.uint8), "valid: found shape .4, 5."),
        ("positions", np.zeros((4, 4, 3)), "positions: found shape .4, 4, 3."),
        ("normals", np.full((32, 32, 3), np.nan), "normals: found not finite"),
        ("colours", np.zeros((32, 32, 4)), "colours: found shape"),
        ("positions", None, "positions: found nothing"),
        ("valid", None, "valid: found nothing"),
    ],
)
def test_other_files_are_rejected(tmp_path, maps, name, values, words):
    write_geometry_image(tmp_path / "a.h5", maps)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file[name]
        if values is not None:
            file[name] = values
    with pytest.raises(InvalidInput, match=words):
        read_geometry_image(tmp_path / "a.h5")


@pytest.mark.parametrize(("attribute", "value"), [("format", "bentray-volume"), ("format_version", "9.0")])
def test_other_formats_are_rejected(tmp_path, maps, attribute, value):
    write_geometry_image(tmp_path / "a.h5", maps)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs[attribute] = value
    with pytest.raises(InvalidInput, match=f"@{attribute}: found '{value}'"):
        read_geometry_image(tmp_path / "a.h5")


def pixels_of(png):
    with Image.open(io.BytesIO(png)) as image:
        assert image.mode == "RGBA"
        return np.asarray(image).astype(float) / 255.0


def test_pictures_have_u_to_the_right_and_v_up(maps):
    i, j = np.argwhere(maps.valid)[7]
    for png, expected in (
        (quantity_png(maps, "positions"), maps.positions[i, j]),
        (quantity_png(maps, "normals"), 0.5 * (maps.normals[i, j] + 1.0)),
        (quantity_png(maps, "colours"), maps.colours[i, j]),
    ):
        pixels = pixels_of(png)
        assert pixels.shape == (32, 32, 4)
        np.testing.assert_allclose(pixels[31 - j, i, :3], expected, atol=0.003)
        np.testing.assert_array_equal(pixels[..., 3], maps.valid.T[::-1])
        assert (pixels[pixels[..., 3] == 0.0] == 0.0).all()


def test_no_colours_no_picture(maps):
    with pytest.raises(InvalidInput, match="colours: found none"):
        quantity_png(replace(maps, colours=None), "colours")
