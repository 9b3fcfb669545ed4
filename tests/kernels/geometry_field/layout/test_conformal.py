"""Conformal layouts: exact where the answer is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.geometry_field.layout.conformal import Disk, closed_curve, corner_angles, stiffness
from bentray_kernels.geometry_field.layout.distortion import quasi_conformal_factors, signed_areas
from bentray_kernels.meshes.opening import OpenMesh

from ...meshes.examples import flat_patch


def disk_of(surface):
    return Disk.from_mesh(
        surface.vertices, OpenMesh(surface.faces.astype(np.int64), np.arange(len(surface.vertices)))
    )


def cap(turn=1.2, rings=40, around=80):
    """Part of the unit sphere about the pole, to a polar angle."""
    plane = flat_patch(rings + 1, around + 1)
    polar, azimuth = turn * plane.vertices[:, 0] / rings, 2 * np.pi * plane.vertices[:, 1] / around
    points = np.column_stack(
        (np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar))
    )
    _, first, inverse = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    faces = inverse.ravel()[plane.faces]
    whole = (np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)
    return type(plane)(points[first], faces[whole].astype(np.int32))


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
@settings(max_examples=20)
def test_a_tilted_plane_is_laid_out_as_it_is(slope, other):
    disk = disk_of(flat_patch(height=lambda x, y: slope * x + other * y))
    points = disk.isometric_layout()
    distances = [np.linalg.norm(at[:, np.newaxis] - at, axis=-1) for at in (disk.vertices, points)]
    np.testing.assert_allclose(distances[0], distances[1], atol=1e-9)
    assert (signed_areas(points[disk.faces]) > 0.0).all()


def test_a_rolled_strip_unrolls():
    disk = disk_of(flat_patch(40, 9))
    rolled = disk.vertices.copy()
    rolled[:, 0], rolled[:, 2] = 10 * np.sin(disk.vertices[:, 0] / 10), 10 * np.cos(disk.vertices[:, 0] / 10)
    bent = Disk(rolled, disk.faces, corner_angles(rolled[disk.faces]))
    points = bent.layout(bent.isometric_turning)
    span = np.linalg.norm(points[0] - points[-1])
    assert span == pytest.approx(np.hypot(39 * 20 * np.sin(0.05), 8), rel=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_cap_is_projected_stereographically(share):
    """By symmetry its boundary is a circle with any rounding, and a conformal map of it is unique."""
    surface = cap()
    disk = disk_of(surface)
    assert disk.isometric_turning == pytest.approx(disk.round_turning(), rel=1e-6)
    points = disk.layout((1.0 - share) * disk.isometric_turning + share * disk.round_turning())
    polar = np.arccos(np.clip(surface.vertices[:, 2], -1.0, 1.0))
    pole = points[np.argmin(polar)]
    radius = np.linalg.norm(points - pole, axis=1)
    edge = radius[polar > 1.199].mean()
    np.testing.assert_allclose(radius / edge, np.tan(polar / 2) / np.tan(0.6), atol=2e-3)
    assert np.median(quasi_conformal_factors(surface.corners, points[disk.faces])) < 1.01


def test_the_turning_of_every_layout_is_whole():
    disk = disk_of(flat_patch(9, 7, lambda x, y: np.sin(x) + np.cos(y)))
    assert disk.isometric_turning.sum() == pytest.approx(2 * np.pi)
    assert disk.round_turning().sum() == pytest.approx(2 * np.pi)
    # Gauss and Bonnet.
    assert disk.turning.sum() == pytest.approx(2 * np.pi)


def test_the_error_of_angles_falls_with_the_size_of_the_faces():
    worst = []
    for n in (9, 33):
        scale = 8 / (n - 1)
        bumpy = flat_patch(n, n, lambda x, y, s=scale: np.sin(s * x) * np.cos(s * y) / s)
        points = disk_of(bumpy)
        factors = quasi_conformal_factors(
            bumpy.corners, points.layout(points.isometric_turning)[points.faces]
        )
        worst.append(np.median(factors) - 1.0)
    assert worst[1] < 0.4 * worst[0]


@given(st.lists(st.tuples(st.floats(-0.5, 1.5), st.floats(0.5, 2.0)), min_size=3, max_size=20))
def test_curves_close(corners):
    turning, lengths = np.array(corners).T
    turning = turning + (2 * np.pi - turning.sum()) / len(turning)
    directions = np.cumsum(turning)
    spread = np.stack((np.cos(directions), np.sin(directions)))
    if np.linalg.cond((lengths * spread) @ spread.T) > 1e6:
        return
    curve = closed_curve(turning, lengths, lengths)
    steps = np.roll(curve, -1, axis=0) - curve
    np.testing.assert_allclose((steps * spread.T[:, ::-1] * (1, -1)).sum(axis=1), 0.0, atol=1e-8)


def test_the_stiffness_of_a_right_angle():
    corners = np.array([[(0.0, 0, 0), (1, 0, 0), (0, 1, 0)]])
    angles = corner_angles(corners)
    assert np.degrees(angles[0]) == pytest.approx([90.0, 45.0, 45.0])
    expected = [(1.0, -0.5, -0.5), (-0.5, 0.5, 0.0), (-0.5, 0.0, 0.5)]
    matrix = stiffness(np.array([(0, 1, 2)]), angles, 3).toarray()
    np.testing.assert_allclose(matrix, expected, atol=1e-12)


def test_the_isometric_layout_is_the_same_either_way():
    disk = disk_of(flat_patch(9, 7, lambda x, y: np.sin(x) + np.cos(y)))
    result, other = disk.isometric_layout(), disk.layout(disk.isometric_turning)
    np.testing.assert_allclose(result, other, atol=1e-9)
    lengths = np.linalg.norm(np.roll(result[disk.boundary], -1, axis=0) - result[disk.boundary], axis=1)
    np.testing.assert_allclose(lengths, disk.side_lengths, rtol=0.02)


def test_harmonic_functions_are_found_again():
    disk = disk_of(flat_patch(12, 12))
    x, y = disk.vertices[:, :2].T
    values = np.column_stack((x * x - y * y, x - 3.0 * y))
    np.testing.assert_allclose(disk.extended(values), values, atol=1e-9)
