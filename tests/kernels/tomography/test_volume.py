"""Volumes: rays in space give the object back, whether the ring moves or many rings hear each other."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels import eikonal, rays
from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Problem, Settings, reconstruct, rmse

NODES, WATER = 24, 1500.0
RING, HEIGHTS = Ring(16, 0.04), np.array([-0.012, -0.004, 0.004, 0.012])
PLAN = Settings.from_values(method="sart", nodes=NODES, decomposition="volume", iterations=4, relaxation=0.3)


def problem_of(dataset, plan=PLAN):
    return Problem.from_dataset(dataset, plan)


def positions():
    return np.concatenate([np.column_stack((RING.positions(), np.full(16, z))) for z in HEIGHTS])


def ball(problem):
    """A ball 40 m/s faster than water, off the axis and between the rings."""
    lines = [
        o + problem.spacing * np.arange(n) for o, n in zip(problem.origin, problem.region.shape, strict=True)
    ]
    x, y, z = np.meshgrid(*lines, indexing="ij")
    return WATER + 40.0 * np.exp(-((x - 0.008) ** 2 + y**2 + (z - 0.001) ** 2) / (2 * 0.008**2))


def scanned(moved):
    """Times through the ball on the reconstruction's own grid: enough to test the way back."""
    count = len(RING.positions())
    everyone = np.arange(count if moved else 4 * count)
    shape = (4, count, count) if moved else (4 * count, 4 * count)
    empty = Dataset(
        RING.positions() if moved else positions(),
        everyone,
        everyone,
        WATER,
        delta_tof_s=np.zeros(shape),
        slice_z_m=HEIGHTS if moved else None,
        array_type="ring" if moved else "rings",
    )
    problem = problem_of(empty)
    speed = ball(problem)
    delta = np.full((4 * count, problem.receivers.shape[1]), np.nan)
    for k, source in enumerate(problem.emitters):
        tof = eikonal.solve(speed, problem.spacing, source)
        heard = problem.receivers_of(k)
        times = rays.travel_times(tof, speed, problem.spacing, heard, source)
        delta[k] = times - np.linalg.norm(heard - source, axis=1) / WATER
    return replace(empty, delta_tof_s=delta.reshape(shape)), speed


@pytest.fixture(scope="module", params=[True, False], ids=["moved", "rings"])
def scan(request):
    return scanned(request.param)


@pytest.mark.parametrize("method", ["sart", "gauss-newton"])
def test_the_ball_comes_back(scan, method):
    dataset, speed = scan
    result = reconstruct(dataset, replace(PLAN, method=method))
    assert result.speed.shape == speed.shape
    assert result.origin_m == problem_of(dataset).origin
    inside = speed > WATER + 5.0
    assert rmse(result.speed, speed, inside) < 0.45 * rmse(np.full_like(speed, WATER), speed, inside)


def test_between_slices_the_volume_is_more_accurate(scan):
    """Slices of the same data know nothing of what lies between the rings."""
    dataset, speed = scan
    volume = reconstruct(dataset, replace(PLAN, method="gauss-newton"))
    slices = reconstruct(dataset, replace(PLAN, method="gauss-newton", decomposition="slices"))
    assert slices.speed.shape == (NODES, NODES, 4)
    assert slices.origin_m[2] == pytest.approx(HEIGHTS[0])
    planes = np.rint((HEIGHTS - volume.origin_m[2]) / volume.spacing_m[2]).astype(int)
    inside = speed[..., planes] > WATER + 5.0
    assert rmse(slices.speed, speed[..., planes], inside) < 20.0


def test_a_region_of_interest_keeps_the_rest_water(scan):
    dataset, speed = scan
    problem = problem_of(dataset)
    roi = np.abs(speed - WATER) > 1.0
    truth = Truth(speed, (problem.spacing,) * 3, problem.origin, axes="x,y,z")
    complete = replace(dataset, roi=roi, truth=truth)
    result = reconstruct(complete, replace(PLAN, iterations=1, roi=True))
    assert np.allclose(result.speed[~roi], WATER)
    assert not np.allclose(result.speed[roi], WATER)
    slices = reconstruct(complete, replace(PLAN, iterations=1, roi=True, decomposition="slices"))
    assert (np.abs(slices.speed - WATER) > 1e-6).any()
    with pytest.raises(InvalidInput, match=r"^mask/roi: found"):
        reconstruct(dataset, replace(PLAN, roi=True))
    with pytest.raises(InvalidInput, match=r"^mask/roi: found"):
        reconstruct(replace(dataset, roi=roi), replace(PLAN, roi=True))
