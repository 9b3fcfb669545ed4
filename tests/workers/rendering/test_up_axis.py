"""The axis that is up: the base on which an object stands, and pictures that it turns."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.requests.request_fields import choices_of
from bentray_kernels.splines import Spline
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.rendering import up_axis
from bentray_workers.rendering.field_picture import picture_png as mesh_png
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.histogram import volume_histogram
from bentray_workers.rendering.refraction import picture_png
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.up_axis import EXAMINED, UPRIGHT, standing_axis, standing_axis_of

from ...kernels.meshes.examples import bunny
from ..pixels import pixels_of
from .field_folders import stored

SIZE = {"width": 48, "height": 40}


def cone(count=400):
    """A mesh with its base below and its tip above."""
    around = 2.0 * np.pi * np.arange(count) / count
    rim = np.column_stack([np.cos(around), 0.7 * np.sin(around), np.zeros(count)])
    own, after = np.arange(count), (np.arange(count) + 1) % count
    top, bottom = np.full(count, count), np.full(count, count + 1)
    faces = np.vstack([np.column_stack([own, after, top]), np.column_stack([after, own, bottom])])
    return TriangleMesh(np.vstack([rim, [(0.2, 0.0, 1.5), (0.0, 0.0, 0.0)]]), faces.astype(np.int32))


@pytest.mark.parametrize("axis", UPRIGHT)
def test_an_object_stands_on_its_base(tmp_path, axis):
    upright = cone()
    leaning = TriangleMesh(upright.vertices @ UPRIGHT[axis], upright.faces)
    assert standing_axis(leaning.vertices) == axis
    for folder in ("upright", "leaning"):
        (tmp_path / folder).mkdir()
    views = [FieldView(**SIZE, mode="diffuse", scene="two-mirrors", up=up) for up in ("z", "auto", axis)]
    expected = pixels_of(mesh_png(stored(tmp_path / "upright", upright), views[0]))
    source = stored(tmp_path / "leaning", leaning)
    for view in views[1:]:
        assert (pixels_of(mesh_png(source, view)) != expected).any(axis=2).mean() < 0.01
    other = replace(views[1], up="-z" if axis != "-z" else "z")
    assert (pixels_of(mesh_png(source, other)) != expected).any(axis=2).mean() > 0.02


@pytest.mark.parametrize("axis", UPRIGHT)
def test_a_volume_stands_on_its_base(tmp_path, axis):
    nodes = 24
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, nodes)] * 3, indexing="ij"), axis=-1)
    # The values at places of the grid that are turned back.
    x, y, z = np.moveaxis(grid @ UPRIGHT[axis].T, -1, 0)
    values = np.clip(3.0 * np.minimum(0.4 - 0.5 * z - np.hypot(x, y), z + 0.6), -1.0, 1.0)
    write_volume(tmp_path / "v.h5", Volume.from_values(values, (1e-3,) * 3))
    assert volume_histogram(tmp_path / "v.h5", "value", 8)["up"] == axis
    view = RefractionView(**SIZE, iso=(0.0,), mode="shaded")
    image, same, other = (
        pixels_of(picture_png(tmp_path / "v.h5", replace(view, up=up))).astype(int)
        for up in ("auto", axis, "z" if axis == "-z" else "-z")
    )
    np.testing.assert_array_equal(image, same)
    assert (image != other).any()
    # Broad below, narrow above.
    widths = (image != image[0, 0]).any(axis=2).sum(axis=1)
    shown = widths[widths > 0]
    assert shown[-6:].mean() > 1.5 * shown[:6].mean()


def test_a_volume_is_examined_once_at_no_more_nodes_than_stated(monkeypatch):
    examined = []
    monkeypatch.setattr(up_axis, "standing_axis", lambda points: examined.append(points) or "x")
    spline = Spline(np.ones((2 * EXAMINED - 9, 4, 4)))
    for _ in range(2):
        assert standing_axis_of(spline, (1e-3,) * 3) == "x"
    (points,) = examined
    assert 0.5 * EXAMINED <= len(np.unique(points[:, 0])) <= EXAMINED


def test_a_ball_stands_on_z():
    for surface in (sphere(24, 24), bumpy_ball(2000), torus(24, 16)):
        assert standing_axis(surface.vertices) == "z"


def test_the_bunny_is_upright():
    assert standing_axis(bunny().vertices) == "y"


def test_every_axis_is_a_choice():
    for view in (FieldView, RefractionView):
        assert set(choices_of(view)["up"]) == {"auto", *UPRIGHT}
