"""Held-out pairs: training and held-out parts make up the whole, symmetric in emitter and receiver."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.array_shapes import arc, facing_lines
from bentray_kernels.tomography.held_out import part_of

from ..straight_scans import ring_scan

PARTS = ("shown", "held-out", "views")
SPARSE = ("shown-sparse", "views-sparse")


def ring(elements):
    return ring_scan(elements, 0.1)


@pytest.mark.parametrize("parts", [PARTS, SPARSE], ids=["pairs and views", "sparse"])
@given(elements=st.integers(16, 96))
@settings(max_examples=20, deadline=None)
def test_the_parts_are_the_whole_and_share_no_pair(parts, elements):
    scan = ring(elements)
    result = [np.isfinite(part_of(scan, part).differential_tof()) for part in parts]
    assert np.array_equal(np.sum(result, axis=0), np.isfinite(scan.differential_tof()))
    assert all(np.array_equal(part, part.T) for part in result)


@pytest.mark.parametrize(("elements", "kept"), [(255, 1), (256, 2), (400, 3)])
def test_pairs_of_many_elements_are_those_of_some(elements, kept):
    parts = np.sum([np.isfinite(part_of(ring(elements), part).differential_tof()) for part in PARTS], axis=0)
    used = np.flatnonzero(parts.any(axis=0))
    assert np.array_equal(used, np.arange(0, elements, kept))
    expected = np.isfinite(ring(elements).differential_tof())[np.ix_(used, used)]
    assert np.array_equal(parts[np.ix_(used, used)], expected)


@pytest.mark.parametrize(("elements", "kept"), [(127, 1), (128, 2), (256, 4)])
def test_sparse_pairs_of_many_elements_are_those_of_fewer(elements, kept):
    parts = [np.isfinite(part_of(ring(elements), part).differential_tof()) for part in SPARSE]
    used = np.flatnonzero((parts[0] | parts[1]).any(axis=0))
    assert np.array_equal(used, np.arange(0, elements, kept))
    assert not (parts[0] & parts[1]).any()
    assert 0.08 < parts[1].sum() / (parts[0] | parts[1]).sum() < 0.11


def test_views_are_a_tenth_and_whole_sectors():
    held = np.isfinite(part_of(ring(64), "views").differential_tof())
    assert held.mean() == pytest.approx(6 / 64)
    blocks = held.reshape(8, 8, 8, 8).sum(axis=(1, 3))
    assert set(blocks.ravel()) == {0, 64}
    # No sector loses more than one of its eight views, and none that looks along the edge.
    assert (blocks > 0).sum(axis=1).max() == 1
    sent, received = np.nonzero(blocks)
    assert {3, 5} == set(np.abs(sent - received).tolist())


@pytest.mark.parametrize("array", [arc(64, 0.1, 200.0), facing_lines(32, 0.1, 0.1)], ids=["arc", "lines"])
def test_views_of_an_open_array_hold_as_many_pairs_as_those_of_a_ring(array):
    every = np.arange(64)
    scan = Dataset(array.position_m, every, every, 1500.0, delta_tof_s=np.zeros((64, 64)), array_type="free")
    held = np.isfinite(part_of(scan, "views").differential_tof())
    assert held.sum() == 6 * 64
    # Each element loses at most the eighth that faces it.
    assert set(held.sum(axis=0)) == {0, 8}


def test_held_out_pairs_are_a_tenth_and_of_all_elements():
    held = np.isfinite(part_of(ring(48), "held-out").differential_tof())
    assert 0.05 < held.sum() / (48 * 47) < 0.2
    assert held.sum(axis=1).max() < 0.4 * 48


def test_all_is_the_scan_itself():
    scan = ring(16)
    assert part_of(scan, "all") is scan
