"""Embeddings that cannot fold, and folds that are smoothed out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.geometry_field.layout.distortion import crosses_itself, signed_areas
from bentray_kernels.geometry_field.layout.embedding import relaxed, round_embedding, unfolded

from ....effort import effort
from ...meshes.examples import flat_patch, mesh
from .test_conformal import disk_of


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
