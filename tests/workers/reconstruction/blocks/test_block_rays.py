"""Rays handed from block to block are those of the whole grid, in smooth and in rough media."""

import numpy as np
import pytest

from bentray_kernels import eikonal
from bentray_kernels.rays.descent import ARRIVED, CAUGHT, LEFT
from bentray_kernels.rays.sensitivity import sensitivities
from bentray_workers.reconstruction.blocks.block_files import (
    SLOWNESS,
    BlockFiles,
    file_name,
    read_planes,
    write_array,
    write_first,
)
from bentray_workers.reconstruction.blocks.block_rays import RaysInBlocks, in_nodes
from bentray_workers.reconstruction.blocks.block_tasks import (
    TracedParts,
    back_project_in_block,
    sum_names,
    trace_rays_in_block,
)

from ....effort import effort

SHAPE, SPACING = (19, 12, 9), 1.5e-3


def traced(files, tof, receivers, source, *, curved):
    """Rays through all blocks; also how many visits were made, and how many rays were caught."""
    for block in range(files.blocks):
        start, stop = files.bounds(block)
        write_array(files.scratch(0) / file_name("tof", block), tof[start:stop])
    at_source = in_nodes(source, SPACING, SHAPE)
    rays = RaysInBlocks(files, in_nodes(receivers, SPACING, SHAPE), at_source, curved=curved, name="0")
    visits, caught = 0, 0
    while blocks := rays.next_blocks():
        for block, some, mine, points in [(block, *rays.visit(block)) for block in blocks]:
            versions = ["tof"] * files.blocks if curved else []
            result = trace_rays_in_block(files, 0, block, SPACING, versions, at_source, some, points)
            rays.visited(block, mine, points, result)
            visits, caught = visits + 1, caught + int((result.ends == CAUGHT).sum())
    return rays, visits, caught


def whole_sums(files, rays, corrections):
    """Σ c·w and Σ w of all nodes, from the sums of all blocks."""
    total = np.zeros((2, *SHAPE))
    for block, parts in rays.back_projected(corrections).items():
        back_project_in_block(files, 0, block, parts, "sums")
        planes = files.planes(block)
        for number, name in enumerate(sum_names("sums")):
            total[number, planes.low : planes.high] += read_planes(files.scratch(0) / file_name(name, block))
    return total


@pytest.mark.parametrize("kind", ["curved", "straight"])
@pytest.mark.parametrize("contrast", [0.05, 0.9], ids=["smooth", "rough"])
@pytest.mark.parametrize("blocks", effort([2, 7], [1, 2, 7, 19]))
def test_rays_equal_those_of_the_whole_grid(tmp_path, kind, contrast, blocks):
    computed = []
    chaotic = contrast > 0.5 and kind == "curved"
    differences = []
    for seed in range(effort(2, 10)):
        rng = np.random.default_rng(seed)
        speed = 1500.0 * rng.uniform(1.0 - contrast, 1.0 + contrast, SHAPE)
        extent = SPACING * (np.array(SHAPE) - 1)
        # Some on nodes, where two blocks meet, and on the faces of the grid.
        points = rng.uniform(0.0, 1.0, (24, 3)) * extent
        points[::3] = np.round(points[::3] / SPACING) * SPACING
        points[::8, 0] = extent[0]
        source, receivers = points[1], points
        tof = eikonal.solve(speed, SPACING, source, "fsm")
        expected = sensitivities(tof, SPACING, receivers, source, kind=kind)
        files = BlockFiles(tmp_path / f"{seed}", SHAPE, blocks)
        write_first(files, 1.0 / speed, np.ones(SHAPE, np.bool_))
        files.begin(0)
        rays, visits, caught = traced(files, tof, receivers, source, curved=kind == "curved")
        predicted = expected @ (1.0 / speed).ravel()
        differences += (np.abs(rays.predicted - predicted) / predicted.max()).tolist()
        corrections = rng.uniform(-1.0, 1.0, len(receivers))
        sums, weights = whole_sums(files, rays, corrections)
        if not chaotic:
            assert np.allclose(sums.ravel() * SPACING, corrections @ expected, rtol=0.0, atol=1e-13)
            assert np.allclose(weights.ravel() * SPACING, expected.sum(axis=0), rtol=0.0, atol=1e-13)
        assert weights.sum() == pytest.approx(rays.lengths.sum(), rel=1e-12)
        assert sums.sum() == pytest.approx(corrections @ rays.lengths, rel=1e-9, abs=1e-9)
        computed.append((visits, caught))
    # Rough media amplify rounding along some rays.
    assert np.median(differences) < 1e-12
    assert np.max(differences) < (1e-2 if chaotic else 1e-12)
    if chaotic:
        assert any(caught for _, caught in computed), "some rays go from node to node"
    if kind == "curved":
        assert all(visits <= 3 * blocks + 4 for visits, _ in computed), "each block is visited about once"


def test_a_caught_ray_begins_again_and_its_first_parts_count_nothing(tmp_path):
    files = BlockFiles(tmp_path, SHAPE, 3)
    receivers = np.array([[17.0, 5.0, 5.0], [14.0, 5.0, 5.0]])
    rays = RaysInBlocks(files, receivers, np.array([1.0, 5.0, 5.0]), curved=True, name="0")
    assert rays.next_blocks() == [2]
    some, mine, points = rays.visit(2)
    assert some.counts.tolist() == [1, 1]
    reached, starts = np.array([[7.0, 5.0, 5.0]] * 2), np.array([0, 11, 19])
    left = TracedParts(starts, np.array([LEFT, LEFT]), reached, np.array([1.0, 2.0]), np.array([10.0, 7.0]))
    rays.visited(2, mine, points, left)
    assert rays.next_blocks() == [1]
    some, mine, points = rays.visit(1)
    assert some.counts.tolist() == [11, 8]
    ends, ended = np.array([CAUGHT, ARRIVED]), np.array([[0.0] * 3, [1.0, 5.0, 5.0]])
    rays.visited(
        1, mine, points, TracedParts(np.array([0, 0, 7]), ends, ended, np.array([0.0, 3.0]), np.ones(2))
    )
    assert rays.predicted.tolist() == [0.0, 5.0]
    assert rays.lengths.tolist() == [0.0, 8.0]
    assert rays.next_blocks() == [2], "at its receiver"
    some, mine, _ = rays.visit(2)
    assert (mine.tolist(), some.counts.tolist(), some.by_nodes.tolist()) == ([0], [1], [True])
    assert np.array_equal(some.places, receivers[:1])
    first, second = rays.back_projected(np.array([0.5, 0.25]))[2][0], rays.back_projected(np.ones(2))[1][0]
    assert np.isnan(first.corrections[0])
    assert first.corrections[1] == 0.25
    assert np.isnan(second.corrections[0])


def test_a_block_without_valid_rays_adds_nothing(tmp_path):
    files = BlockFiles(tmp_path / "blocks", SHAPE, 3)
    write_first(files, 1.0 / 1500.0, np.ones(SHAPE, np.bool_))
    files.begin(0)
    source = np.array([1.0, 1.0, 1.0]) * SPACING
    tof = eikonal.solve(np.full(SHAPE, 1500.0), SPACING, source, "fsm")
    rays, _, _ = traced(files, tof, np.array([source, 8.0 * source]), source, curved=True)
    assert rays.lengths[0] == 0.0
    sums, weights = whole_sums(files, rays, np.array([np.nan, np.nan]))
    assert not sums.any()
    assert not weights.any()


def test_reads_the_state_of_every_block(tmp_path):
    files = BlockFiles(tmp_path / "blocks", SHAPE, 5)
    slowness = np.random.default_rng(1).uniform(size=SHAPE)
    write_first(files, slowness, np.ones(SHAPE, np.bool_))
    assert np.array_equal(files.read(files.state(0), SLOWNESS), slowness)
    for low, high in ((0, 1), (3, 12), (18, 19), (4, 4)):
        assert np.array_equal(files.read(files.state(0), SLOWNESS, low, high), slowness[low:high])
    assert [files.block_of(x) for x in (0.0, 2.99, 3.0, 18.0)] == [0, 0, 1, 4]


def test_a_short_file_is_rejected(tmp_path):
    path = tmp_path / "array.npy"
    write_array(path, np.ones((4, 5)))
    path.write_bytes(path.read_bytes()[:-8])
    assert read_planes(path, 0, 3).shape == (3, 5)
    with pytest.raises(ValueError, match="shorter"):
        read_planes(path)
