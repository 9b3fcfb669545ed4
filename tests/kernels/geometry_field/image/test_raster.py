"""Rasterisation: each pixel holds the value of its point of the surface."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.raster import INSIDE, OUTSIDE, SEAM, rasterised, seam_sides
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.meshes.mesh import Chart

from ...meshes.examples import flat_patch, mesh


def flat_chart(patch, turn=0.0):
    """A flat patch laid out as it is, a little turned about its middle."""
    size = np.ptp(patch.vertices[:, :2], axis=0).max()
    c, s = np.cos(turn), np.sin(turn)
    points = (patch.vertices[:, :2] / size - 0.5) @ np.array([(c, s), (-s, c)]) / (abs(c) + abs(s)) + 0.5
    return Chart(patch, points[patch.faces])


@given(st.floats(-0.7, 0.7), st.integers(8, 40))
@settings(deadline=None)
def test_inside_the_values_are_those_of_the_place(turn, size):
    chart = flat_chart(flat_patch(6, 6), turn)
    raster = rasterised(chart, size)
    # The layout is linear: so is what is read from it.
    points = raster.sampled(chart.uv)
    lattice = np.stack(np.meshgrid(*(np.arange(size),) * 2, indexing="ij"), axis=-1) / (size - 1)
    inside = raster.kind == INSIDE
    np.testing.assert_allclose(points[inside], lattice[inside], atol=1e-9)
    # Next to the boundary a pixel stands for the nearest point of it.
    seam = raster.kind == SEAM
    steps = np.linalg.norm(points[seam] - lattice[seam], axis=-1) * (size - 1)
    assert (steps <= 1.5 + 1e-9).all()
    np.testing.assert_allclose(raster.weights[raster.kind != OUTSIDE].sum(axis=-1), 1.0)
    assert (raster.face[raster.kind == OUTSIDE] == -1).all()
    corners = raster.kind != OUTSIDE
    whole = corners[:-1, :-1] & corners[1:, :-1] & corners[:-1, 1:] & corners[1:, 1:]
    assert (whole | ~raster.cells).all()


def test_a_square_fills_every_pixel():
    raster = rasterised(flat_chart(flat_patch(5, 5)), 17)
    assert (raster.kind == INSIDE).all()
    assert raster.cells.all()


def test_seam_points_lie_on_both_sides_of_the_cut():
    """A pixel by the seam stands for a point of an edge that is cut, or lies on the boundary."""
    layout = parameterise(torus(20, 16))
    raster = rasterised(layout.chart, 64)
    rows = np.flatnonzero((raster.kind == SEAM).ravel())
    weights = raster.weights.reshape(-1, 3)[rows]
    assert (np.sort(weights, axis=1)[:, 0] == 0.0).all()
    assert len(seam_sides(layout.chart)) == 2 * layout.cut.sum()


def test_the_sides_of_an_open_patch_are_its_seam():
    chart = flat_chart(flat_patch(4, 3))
    assert len(seam_sides(chart)) == 10


def test_a_small_image_is_rejected_and_a_flipped_face_is_left_out():
    chart = flat_chart(flat_patch(4, 4))
    with pytest.raises(InvalidInput, match="size: found 7"):
        rasterised(chart, 7)
    flipped = Chart(mesh(np.eye(3), [(0, 1, 2)]), np.array([[(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)]]))
    assert (rasterised(flipped, 9).kind != INSIDE).all()
