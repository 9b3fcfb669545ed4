"""A ray continued from block to block is the ray of the whole grid."""

import numpy as np
import pytest

from bentray_kernels import eikonal
from bentray_kernels.rays.block_tracing import (
    GUARD,
    BlockPlanes,
    WaitingRays,
    back_project_block,
    trace_block,
)
from bentray_kernels.rays.descent import ARRIVED, CAUGHT, LEFT
from bentray_kernels.rays.sensitivity import sensitivities

from ...effort import effort

SHAPE, SPACING = (40, 11, 9), 2e-3


def one_ray(tof, slowness, bounds, source, receiver):
    """Length of a ray in each node, m, its predicted time, s, and the blocks that it passed."""
    weights, predicted, passed = np.zeros(SHAPE), 0.0, []
    position, count, by_nodes = receiver, 1, False
    end = LEFT
    while end != ARRIVED:
        block = int(np.searchsorted(bounds, position[0], side="right")) - 1
        block = min(block, len(bounds) - 2)
        planes = BlockPlanes.from_range(bounds[block], bounds[block + 1], SHAPE[0])
        own = slice(planes.low, planes.high)
        rays = WaitingRays(position[None], np.array([count]), np.array([by_nodes]))
        paths = trace_block(tof[own], slowness[own], SPACING, planes, source, rays)
        end = paths.ends[0]
        if end == CAUGHT:
            assert not by_nodes, "from node to node every ray arrives"
            weights[:], predicted, passed = 0.0, 0.0, []
            position, count, by_nodes = receiver, 1, True
            continue
        assert np.array_equal(paths.starts, [0, len(paths.points)])
        sums = np.zeros(tof[own].shape)
        back_project_block(sums.shape, paths.points, paths.starts, np.zeros(1), sums, weights[own])
        assert weights[own].sum() >= 0.999 * paths.lengths[0]
        low, high = planes.limits(GUARD)
        inside = paths.places[0, 0]
        assert (end == LEFT) == (not low <= inside < high) or end == ARRIVED
        position, count = paths.places[0], count + len(paths.points) - 1
        predicted += paths.predicted[0]
        passed.append(block)
    return weights * SPACING, predicted, passed, by_nodes


@pytest.mark.parametrize("rough", [False, True])
def test_rays_are_those_of_the_whole_grid(rough):
    nodes_alone = 0
    differences = []
    for seed in range(effort(4, 20)):
        rng = np.random.default_rng(seed)
        speed = rng.uniform(100.0, 3000.0, SHAPE) if rough else rng.uniform(1480.0, 1520.0, SHAPE)
        extent = np.array(SHAPE) - 1.0
        source, receivers = rng.uniform(0.0, 1.0, 3) * extent, rng.uniform(0.0, 1.0, (12, 3)) * extent
        receivers[0] = np.round(receivers[0])
        receivers[1, 0] = 20.0
        tof = eikonal.solve(speed, SPACING, SPACING * source, "fsm")
        expected = sensitivities(tof, SPACING, SPACING * receivers, SPACING * source)
        cuts = np.sort(rng.choice(np.arange(1, SHAPE[0]), 3, replace=False))
        bounds = [0, *cuts.tolist(), SHAPE[0]]
        for k, receiver in enumerate(receivers):
            computed, predicted, passed, by_nodes = one_ray(tof, 1.0 / speed, bounds, source, receiver)
            whole = expected[[k]].toarray()[0]
            differences.append(np.abs(computed.ravel() - whole).max() / SPACING)
            assert predicted == pytest.approx(float((computed / speed).sum()), rel=1e-12)
            assert len(passed) <= 2 * len(bounds), "no block many times"
            nodes_alone += by_nodes
    assert nodes_alone or not rough
    # Rough media amplify rounding along some rays, as much as if their receivers were moved by it.
    assert np.median(differences) < 1e-10
    assert np.quantile(differences, 0.8) < 1e-6
    assert rough or np.max(differences) < 1e-10


def test_straight_parts_of_all_blocks_are_the_whole_ray():
    rng = np.random.default_rng(5)
    slowness = 1.0 / rng.uniform(1400.0, 1600.0, SHAPE)
    # Along a boundary, across all blocks, and none at all.
    receivers = np.array([[20.0, 1.0, 1.0], [39.0, 10.0, 8.0], [0.0, 0.5, 0.5], [20.0, 9.0, 8.0]])
    source = receivers[3]
    expected = sensitivities(np.ones(SHAPE), SPACING, SPACING * receivers, SPACING * source, kind="straight")
    corrections = np.array([1.0, -2.0, 3.0, np.nan])
    total, predicted = np.zeros((2, *SHAPE)), np.zeros(4)
    for start, stop in ((0, 20), (20, 21), (21, 40)):
        planes = BlockPlanes.from_range(start, stop, SHAPE[0])
        own = slice(planes.low, planes.high)
        rays = WaitingRays(receivers, np.ones(4, np.int64), np.zeros(4, np.bool_))
        paths = trace_block(None, slowness[own], SPACING, planes, source, rays)
        predicted += paths.predicted
        back_project_block(total[0, own].shape, paths.points, paths.starts, corrections, *total[:, own])
    assert np.allclose(predicted, expected @ slowness.ravel(), rtol=1e-12, atol=0.0)
    sums, weights = SPACING * total
    assert np.allclose(sums.ravel(), np.nan_to_num(corrections) @ expected, rtol=0.0, atol=1e-15)
    assert np.allclose(weights.ravel(), expected[:3].sum(axis=0), rtol=0.0, atol=1e-15)
