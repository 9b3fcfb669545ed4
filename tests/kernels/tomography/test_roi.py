"""Regions of interest: one without a node in the image is refused, a slice beyond a region stays water."""

import numpy as np
import pytest

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings, reconstruct

from ..straight_scans import ring_scan

WATER = 1500.0
PLAN = Settings.from_values(
    method="sart", nodes=24, iterations=2, roi=True, resolution_check=True, edge_mps=5.0
)
WAYS = [
    {},
    {"method": "gauss-newton"},
    {"speed_range_mps": (1400.0, 1600.0)},
]


def scan(roi, slices=None):
    shape = (12, 12) if slices is None else (len(slices), 12, 12)
    names = "x,y,z"[: 2 * roi.ndim - 1]
    truth = Truth(np.full(roi.shape, WATER), (0.01,) * roi.ndim, (-0.05,) * roi.ndim, axes=names)
    measured = {"log_ratio_np": np.full(shape, 0.1), "slice_z_m": slices}
    return ring_scan(12, 0.05, np.full(shape, -1e-7), WATER, roi=roi, truth=truth, **measured)


@pytest.mark.parametrize("way", WAYS)
def test_a_region_without_a_node_in_the_image_is_rejected(way):
    outside = np.zeros((11, 11), bool)
    outside[0, 0] = True
    for roi in (outside, np.zeros_like(outside)):
        with pytest.raises(InvalidInput, match=r"^mask/roi: found"):
            reconstruct(scan(roi), PLAN.changed(**way))


@pytest.mark.parametrize("way", WAYS)
def test_a_slice_above_the_region_stays_water(way):
    roi = np.zeros((11, 11, 11), bool)
    roi[3:8, 3:8, 5] = True
    result = reconstruct(scan(roi, np.array([0.0, 0.02])), PLAN.changed(**way))
    assert result.speed[..., 0].max() > WATER + 1.0
    assert np.allclose(result.speed[..., 1], WATER)
    assert np.array_equal(result.recovery[..., 1], np.zeros((24, 24)))
    assert result.attenuation[..., 0].max() > 1.0
    assert not result.attenuation[..., 1].any()
