"""Regions: statistics of discs and balls, and regions of interest that an image leaves or fills."""

import math

import numpy as np
import pytest

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import RoundRegion, Settings, reconstruct, region_statistics

from ..straight_scans import ring_scan

GRID = ((41, 41), (1e-3, 1e-3), (-0.02, -0.02))


def test_a_lesion_has_the_contrast_that_was_put_in() -> None:
    x, y = np.meshgrid(*(1e-3 * np.arange(41) - 0.02,) * 2, indexing="ij")
    away = np.hypot(x - 0.004, y + 0.002)
    # Alternating nodes give the surroundings a known spread.
    values = np.where(away <= 0.0052, 1560.0, 1500.0 + 3.0 * (-1.0) ** np.add(*np.indices((41, 41))))
    inside, beside = RoundRegion((0.004, -0.002), 0.0052).nodes(*GRID)
    statistics = region_statistics(values, inside, GRID[1], beside, np.full((41, 41), 2.5))
    assert statistics.nodes == (away <= 0.0052).sum()
    assert statistics.size == pytest.approx(statistics.nodes * 1e-6)
    assert statistics.size == pytest.approx(math.pi * 0.0052**2, rel=0.1)
    assert (statistics.mean, statistics.spread) == (pytest.approx(1560.0), 0.0)
    assert statistics.contrast == pytest.approx(60.0, abs=0.5)
    assert statistics.contrast_to_noise == pytest.approx(20.0, rel=0.02)
    assert statistics.uncertainty == 2.5


def test_the_gap_between_region_and_surroundings_does_not_count() -> None:
    inside, beside = RoundRegion((0.0, 0.0), 0.008).nodes(*GRID)
    distance = np.hypot(*np.meshgrid(*(1e-3 * np.arange(41) - 0.02,) * 2))
    assert not (inside & beside).any()
    assert distance[inside].max() <= 0.008
    assert 0.010 < distance[beside].min() < 0.0105
    assert 0.0155 < distance[beside].max() <= 0.016


def test_a_ball_has_a_volume() -> None:
    inside, _ = RoundRegion((0.0, 0.0, 0.01), 0.006).nodes(
        (21, 21, 11), (1e-3, 1e-3, 2e-3), (-0.01, -0.01, 0.0)
    )
    statistics = region_statistics(np.ones((21, 21, 11)), inside, (1e-3, 1e-3, 2e-3))
    assert statistics.size == pytest.approx(4 / 3 * math.pi * 0.006**3, rel=0.1)
    assert (statistics.contrast, statistics.contrast_to_noise, statistics.uncertainty) == (None, None, None)


def test_nodes_without_a_value_do_not_count() -> None:
    values = np.array([[1.0, np.nan, 3.0]])
    statistics = region_statistics(values, np.ones((1, 3), bool), (1.0, 1.0))
    assert (statistics.nodes, statistics.mean, statistics.spread) == (2, 2.0, 1.0)
    with pytest.raises(InvalidInput, match="overlaps"):
        region_statistics(values, np.isnan(values), (1.0, 1.0))


def test_bad_regions_are_named() -> None:
    for centre, radius, field in (
        ((0.0,), 1.0, "centre_m"),
        ((0.0, math.nan), 1.0, "centre_m"),
        ((0.0, 0.0), 0.0, "radius_m"),
        ((0.0, 0.0), math.inf, "radius_m"),
    ):
        with pytest.raises(InvalidInput, match=f"^{field}: found"):
            RoundRegion(centre, radius)
    with pytest.raises(InvalidInput, match="2 coordinates"):
        RoundRegion((0.0, 0.0, 0.0), 1.0).nodes(*GRID)
    with pytest.raises(InvalidInput, match="between all nodes"):
        RoundRegion((0.0005, 0.0005), 1e-4).nodes(*GRID)
    with pytest.raises(InvalidInput, match="uneven slices"):
        RoundRegion((0.0, 0.0, 0.0), 1.0).nodes((3, 3, 3), (1.0, 1.0, math.nan), (0.0, 0.0, 0.0))


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
