"""Layouts of disks: conformal where the answer is known, embeddings that cannot fold, folds smoothed out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.geometry_field.layout.conformal import Disk, closed_curve, corner_angles, stiffness
from bentray_kernels.geometry_field.layout.distortion import (
    crosses_itself,
    quasi_conformal_factors,
    signed_areas,
)
from bentray_kernels.geometry_field.layout.embedding import relaxed, round_embedding, unfolded
from bentray_kernels.meshes.opening import OpenMesh

from ....effort import effort
from ...meshes.examples import flat_patch, mesh


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


@given(st.integers(2, 9), st.integers(2, 9), st.integers(0, 1000))
@settings(deadline=None, max_examples=effort(20, 30))
def test_no_face_of_a_crumpled_patch_flips(nx, ny, seed):
    patch = flat_patch(nx, ny)
    crumpled = patch.vertices + np.random.default_rng(seed).normal(0.0, 2.0, patch.vertices.shape)
    disk = disk_of(mesh(crumpled, patch.faces))
    plane = round_embedding(disk)
    assert (signed_areas(plane[disk.faces]) > 0.0).all()
    assert not crosses_itself(plane[disk.boundary])
    np.testing.assert_allclose(np.linalg.norm(plane[disk.boundary], axis=1), 1.0)


def test_inner_vertices_lie_in_the_middle():
    disk = disk_of(flat_patch(5, 5))
    plane = round_embedding(disk)
    near = np.unique(disk.faces[(disk.faces == 12).any(axis=1)])
    np.testing.assert_allclose(plane[12], plane[near[near != 12]].mean(axis=0), atol=1e-12)


def test_a_small_fold_goes_and_the_rest_stays():
    disk = disk_of(flat_patch(30, 30))
    plane = disk.vertices[:, :2].copy()
    plane[30 * 12 + 12] += (1.4, 0.3)
    assert (signed_areas(plane[disk.faces]) < 0.0).any()
    mended = unfolded(plane, disk)
    assert (signed_areas(mended[disk.faces]) > 0.0).all()
    moved = np.linalg.norm(mended - disk.vertices[:, :2], axis=1) > 1e-9
    assert moved.sum() < 40
    np.testing.assert_array_equal(mended[disk.boundary], plane[disk.boundary])


def test_a_layout_without_folds_stays_as_it_is():
    disk = disk_of(flat_patch(6, 6))
    plane = disk.vertices[:, :2].copy()
    np.testing.assert_array_equal(unfolded(plane, disk), plane)
    # One that is folded all over is left to others.
    np.testing.assert_array_equal(unfolded(-plane * (1, -1), disk), -plane * (1, -1))


def test_fixed_vertices_stay():
    disk = disk_of(flat_patch(5, 5))
    plane = np.random.default_rng(0).uniform(size=(25, 2))
    moved = relaxed(plane, disk.faces, np.array([6, 12]))
    np.testing.assert_array_equal(np.flatnonzero((moved != plane).any(axis=1)), [6, 12])
    assert moved[12] == pytest.approx(np.vstack((moved[6], plane[[7, 11, 13, 17, 18]])).mean(axis=0))
    np.testing.assert_array_equal(relaxed(plane, disk.faces, np.array([], int)), plane)


def test_the_boundary_goes_round_the_circle_once_each_side_with_its_share():
    patch = flat_patch(7, 4)
    disk = disk_of(mesh(patch.vertices * (1.0, 3.0, 1.0), patch.faces))
    plane = round_embedding(disk)[disk.boundary]
    lengths = np.linalg.norm(np.roll(plane, -1, axis=0) - plane, axis=1)
    turns = 2.0 * np.arcsin(0.5 * lengths)
    assert turns.sum() == pytest.approx(2.0 * np.pi)
    assert np.sort(turns) == pytest.approx(2.0 * np.pi * np.sort(disk.side_lengths) / disk.side_lengths.sum())
