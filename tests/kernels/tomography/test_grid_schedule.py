"""Image grids: automatic nodes, coarse grids and straight rays first, each from the image before."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography import Problem, Settings, reconstruct
from bentray_kernels.tomography.grid_schedule import initial_slowness, stages
from bentray_kernels.tomography.image_grid import MAX_NODES, MAX_NODES_3D, MIN_NODES, automatic_nodes
from bentray_kernels.tomography.stage_graphs import next_batch

from ...table6 import table6_scan
from ..straight_scans import ring_scan

WATER = 1375.0
PLAN = Settings(method="sart", nodes=48, iterations=2)


@pytest.fixture(scope="module")
def scan():
    return table6_scan(32, 48)


def test_default_has_one_stage(scan):
    assert stages(scan, PLAN) == (PLAN,)


def test_coarse_before_fine(scan):
    stage_plans = stages(scan, PLAN.changed(coarser_grids=1))
    assert [plan.nodes for plan in stage_plans] == [24, 48]
    assert len({plan.side_m for plan in stage_plans}) == 1


@pytest.mark.parametrize("method", ["sart", "gauss-newton"])
def test_each_stage_is_in_the_history_and_better_than_water(scan, method):
    plan = PLAN.changed(method=method, coarser_grids=1)
    seen = []
    result = reconstruct(scan, plan, seen.append)
    assert [(s.stage, s.sweep) for s in result.history] == [(0, 1), (0, 2), (1, 1), (1, 2)]
    first = {s.stage: s.residual_rms_s for s in result.history if s.sweep == 1}
    assert first[1] < 0.5 * first[0]
    assert seen[-1].done == seen[-1].total == 4 * 32
    assert result.speed.shape == (48, 48)
    assert result.residual_rms_s == min(s.residual_rms_s for s in result.history if s.stage == 1)


def test_a_finer_grid_begins_with_the_same_image(scan):
    coarse, fine = (Problem.from_dataset(scan, replace(PLAN, nodes=n, side_m=0.2)) for n in (25, 49))
    x = np.linspace(-1.0, 1.0, 25)
    image = 1.0 / WATER * (1.0 + 0.02 * np.exp(-((x[:, None] - 0.2) ** 2 + x[None, :] ** 2) / 0.05))
    slowness = initial_slowness(fine, image, coarse)
    again = slowness[::2, ::2]
    inside = coarse.region & fine.region[::2, ::2]
    assert np.allclose(again[inside], image[inside], rtol=0.0, atol=1e-12)
    assert np.allclose(slowness[~fine.region], 1.0 / WATER)
    assert np.array_equal(initial_slowness(fine, None), np.full((49, 49), 1.0 / WATER))


def test_a_finer_grid_of_a_volume_begins_with_the_same_image_at_the_same_heights():
    """Heights that no grid's spacing divides, so that every grid ends elsewhere."""
    heights = np.array([-0.01, 0.0, 0.0137])
    scan = ring_scan(32, 0.09, np.zeros((3, 32, 32)), WATER, slice_z_m=heights)
    plan = replace(PLAN, decomposition="volume", side_m=0.2)
    coarse, fine = (Problem.from_dataset(scan, replace(plan, nodes=n)) for n in (25, 48))

    def tilted(problem):
        z = problem.origin[2] + problem.spacing * np.arange(problem.region.shape[2])
        return np.broadcast_to((1.0 + z) / WATER, problem.region.shape)

    slowness = initial_slowness(fine, tilted(coarse), coarse)
    assert np.allclose(slowness[fine.region], tilted(fine)[fine.region], rtol=0.0, atol=1e-12)


def test_batches_aim_at_the_time_of_a_task():
    assert next_batch(8, 8, 0.5) == 8
    assert next_batch(8, 8, 0.25) == 16
    assert next_batch(8, 8, 0.001) == 32
    assert next_batch(8, 8, 60.0) == 1
    assert next_batch(8, -3, 0.1) == 8


MANY = 0.22, 0.0027  # width and pitch of 256 elements, m


@pytest.mark.parametrize(
    ("side", "pitch", "wavelength", "noise", "volume", "nodes", "why"),
    [
        (*MANY, None, 0.0, False, 168, "1.35 mm apart: half the pitch"),
        (*MANY, 0.0037, 0.0, False, 120, "1.85 mm apart: half a wavelength"),
        (0.22, 0.0005, 0.002, 0.0, False, 224, "half a wavelength"),
        (0.22, 0.0005, None, 0.0, False, MAX_NODES, "the most"),
        (0.22, 0.0, None, 0.0, False, MAX_NODES, "the most"),
        (*MANY, None, 6e-7, False, 120, "noisy times"),
        (0.05, 0.02, None, 0.0, False, MIN_NODES, "the fewest"),
        (0.3, MANY[1], None, 0.0, False, 224, "half the pitch"),
        (*MANY, None, 0.0, True, MAX_NODES_3D, "the most"),
        (float("inf"), 1.0, None, 0.0, False, MAX_NODES, "the most"),
    ],
)
def test_nodes_follow_the_finest_detail_that_the_data_hold(
    side, pitch, wavelength, noise, volume, nodes, why
):
    found, reason = automatic_nodes(side, pitch, wavelength, noise, 1500.0, 256, volume=volume)
    assert found == nodes
    assert why in reason


def test_the_result_states_the_nodes_that_were_used():
    result = reconstruct(ring_scan(16, 0.05), Settings(method="sart", iterations=1))
    assert result.settings.nodes == len(result.speed) == MIN_NODES
