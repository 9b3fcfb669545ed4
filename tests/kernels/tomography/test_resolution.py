"""The resolution check: a checkerboard is recovered where rays cross and vanishes where none pass."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.resolution import checkerboard

from ..straight_scans import ring_scan

PLAN = Settings(method="sart", nodes=48, iterations=1, rays="straight", resolution_check=True)


def scan(keep=True):
    return ring_scan(96, 0.08, np.where(keep, np.zeros((96, 96)), np.nan))


@pytest.fixture(scope="module")
def everywhere():
    return reconstruct(scan(), PLAN)


def test_fields_of_four_nodes_alternate_along_each_axis():
    assert np.array_equal(checkerboard((12, 8)), np.kron([[1, -1], [-1, 1], [1, -1]], np.ones((4, 4))))


def test_many_rays_bring_most_of_it_back(everywhere):
    recovery = everywhere.recovery
    assert recovery.shape == everywhere.speed.shape
    centre = recovery[18:30, 18:30]
    assert centre.min() > 0.8
    assert recovery.max() < 1.1
    assert recovery[0, 0] == 0.0


def test_few_rays_bring_little_back(everywhere):
    few = np.zeros((96, 96), bool)
    few[::16, ::16] = True
    sparse = reconstruct(scan(few), PLAN).recovery
    assert sparse[18:30, 18:30].mean() < 0.5 * everywhere.recovery[18:30, 18:30].mean()


def test_recovery_is_zero_without_rays():
    """Emitters and receivers on the left half only: the right rim is never crossed."""
    left = scan().element_position_m[:, 0] < -0.01
    recovery = reconstruct(scan(left[:, None] & left[None, :]), PLAN).recovery
    assert np.abs(recovery[38:44, 20:28]).max() < 0.05
    assert recovery[10:14, 20:28].mean() > 0.25


def test_recovery_is_computed_only_on_request(everywhere):
    plain = reconstruct(scan(), replace(PLAN, resolution_check=False))
    assert plain.recovery is None
    assert np.array_equal(plain.speed, everywhere.speed)


def test_the_deviation_of_a_result_is_that_of_nodes_that_may_change(everywhere):
    assert everywhere.uncertainty_rms_mps is None
    for inside, expected in ((np.array([3.0, -4.0]), np.sqrt(12.5)), (np.zeros(2), 0.0)):
        deviation = np.zeros_like(everywhere.speed)
        deviation[20, 20:22] = inside
        assert replace(everywhere, uncertainty=deviation).uncertainty_rms_mps == pytest.approx(expected)


def test_residuals_are_counted(everywhere):
    assert everywhere.residuals.sum() == 96 * (96 - 1)
    middle = len(everywhere.residuals) // 2
    assert everywhere.residuals[middle] == everywhere.residuals.sum()
