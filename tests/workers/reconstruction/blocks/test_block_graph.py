"""SART in blocks: the image of the whole volume, the same bits on every pool, and after an interruption."""

import base64
import shutil

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import ThreadPool, run
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_kernels.tomography.scan import MemorySource, Scan
from bentray_workers.reconstruction import reconstruction_run
from bentray_workers.reconstruction.blocks.block_files import BLOCKS
from bentray_workers.reconstruction.blocks.block_graph import BlockSartGraph
from bentray_workers.reconstruction.preview import checkpoint_image

from ....effort import effort
from ...cluster.tearing import torn_runs

ELEMENTS, HEIGHTS = 5, 2
PLAN = Settings.from_values(method="sart", nodes=20, decomposition="volume", iterations=2, relaxation=0.5)
WAYS = {
    "curved": ({"iterations": effort(1, 2)}, 3),
    "straight": ({"rays": "straight", "iterations": 1}, 3),
    "several emitters an update, wide smoothing": ({"subset": 3, "smoothing_nodes": 2.5, "iterations": 2}, 4),
    "many blocks": ({"iterations": 1}, effort(6, 20)),
}


@pytest.fixture
def scan():
    every, rng = np.arange(ELEMENTS), np.random.default_rng(3)
    chord = np.sin(np.pi * (every[:, None] - every[None, :]) / ELEMENTS) ** 2
    delta = -1e-6 * chord * rng.uniform(0.5, 3.0, (HEIGHTS, ELEMENTS, ELEMENTS))
    delta[:, 1, 3] = np.nan
    # Some emitters without data, for speed, also by reciprocity.
    delta[0, 2:], delta[0, :, 2:] = np.nan, np.nan
    return Dataset(
        Ring(ELEMENTS, 0.08).positions(),
        every,
        every,
        1500.0,
        delta_tof_s=delta,
        slice_z_m=0.01 * np.arange(HEIGHTS),
    )


@pytest.mark.parametrize(("changes", "blocks"), WAYS.values(), ids=WAYS)
def test_blocks_give_the_image_of_the_whole_volume(scan, path, changes, blocks):
    settings = PLAN.changed(**changes)
    expected = reconstruct_here(scan, settings.changed(eikonal="fsm"))
    result = reconstruction_run.reconstruct(None, path, settings.changed(blocks=blocks))
    assert np.ptp(result.speed) > 5.0, "the image has contrast"
    assert np.allclose(result.speed, expected.speed, rtol=1e-12, atol=0.0)
    assert np.allclose(result.coverage, expected.coverage, rtol=0.0, atol=1e-12)
    assert np.array_equal(result.residuals, expected.residuals)
    assert (result.spacing_m, result.origin_m) == (expected.spacing_m, expected.origin_m)
    assert len(result.history) == len(expected.history) == settings.iterations
    for mine, theirs in zip(result.history, expected.history, strict=True):
        assert mine.residual_rms_s == pytest.approx(theirs.residual_rms_s, rel=1e-12)
        assert (mine.sweep, mine.emitters) == (theirs.sweep, theirs.emitters)


def test_bits_depend_neither_on_workers_nor_on_interruptions(cluster, path, tmp_path):
    plan = PLAN.changed(blocks=2, iterations=effort(1, 2))
    expected = reconstruction_run.reconstruct(None, path, plan, threads=effort(1, 3))

    def go_on(tear):
        return reconstruction_run.reconstruct(cluster.client, path, plan, tear, work_dir=tmp_path / "work")

    result, reached = torn_runs(go_on, effort((30,), (25, 60, 9, 3, 40)))
    assert reached[0] == 0
    assert reached == sorted(reached)
    assert reached[-1] > 0, "something was restored"
    for name in ("speed", "coverage", "residuals"):
        assert np.array_equal(getattr(result, name), getattr(expected, name)), name
    assert result.history == expected.history
    left = sorted(one.name for one in (tmp_path / "work" / BLOCKS).iterdir() if one.is_dir())
    updates = 7 * plan.iterations
    assert left == [f"state-{updates - 1:07d}", f"state-{updates:07d}"]


def test_the_order_of_results_does_not_matter(scan, tmp_path):
    plan = PLAN.changed(blocks=4, iterations=1)
    found = []
    for turn in (1, -1):
        graph = BlockSartGraph(Scan(MemorySource(scan), plan), 0, tmp_path / f"{turn}")
        tasks = graph.first()
        while tasks:
            results = [(task, task.function(*task.arguments)) for task in tasks]
            following = [graph.after(*one) for one in results[::turn]]
            assert not any(following[:-1]), "the next round begins when all results are there"
            tasks = following[-1]
        found.append(graph.state)
    assert np.array_equal(found[0].slowness, found[1].slowness)
    assert found[0].history == found[1].history


def test_a_run_whose_files_are_gone_begins_again(scan, tmp_path):
    plan = PLAN.changed(blocks=2, iterations=1)
    graph = BlockSartGraph(Scan(MemorySource(scan), plan), 0, tmp_path / BLOCKS)
    run({"": graph}, ThreadPool(1))
    reached = graph.checkpoint
    again = BlockSartGraph(Scan(MemorySource(scan), plan), 0, tmp_path / BLOCKS)
    again.restore(reached)
    assert again.done == again.total == 7
    assert again.first() == []
    assert np.array_equal(again.state.slowness, graph.state.slowness)
    other = BlockSartGraph(Scan(MemorySource(scan), plan.changed(blocks=3)), 0, tmp_path / BLOCKS)
    other.restore(reached)
    shutil.rmtree(tmp_path / BLOCKS)
    gone = BlockSartGraph(Scan(MemorySource(scan), plan), 0, tmp_path / BLOCKS)
    gone.restore(reached)
    assert other.done == gone.done == 0


def test_an_unfinished_volume_has_a_preview(path, tmp_path, monkeypatch):
    monkeypatch.setattr("bentray_workers.reconstruction.preview.MAX_NODES", 7)
    work = tmp_path / "work"
    seen = []

    def look():
        seen.append(checkpoint_image(work / reconstruction_run.CHECKPOINTS))

    plan = PLAN.changed(blocks=3, iterations=1)
    result = reconstruction_run.reconstruct(None, path, plan, work_dir=work, on_saved=look)
    assert seen[0] is None, "before the first update there is no image"
    last = seen[-1]
    assert (last["every"], last["shape"], last["iteration"]) == (3, [7, 7], 1)
    speed = np.frombuffer(base64.b64decode(last["speed"]), "<f4").reshape(7, 7)
    assert np.allclose(speed, result.speed[::3, ::3, result.speed.shape[2] // 2], rtol=1e-6, atol=0.0)
    assert last["spacing_m"] == pytest.approx([3 * result.spacing_m[0]] * 2)
    assert last["origin_m"] == list(result.origin_m[:2])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"method": "gauss-newton"}, "1, with method gauss-newton"),
        ({"decomposition": "slices"}, "1, with decomposition slices"),
        ({"eikonal": "hafmm"}, "1, with eikonal hafmm"),
        ({"speed_range_mps": (1400.0, 1600.0)}, "speed_range"),
        ({"ray_gradient": "bspline"}, "1, with other gradients"),
        ({"coarser_grids": 1, "nodes": 32}, "1, with coarser grids"),
        ({"uncertainty": True}, "uncertainty"),
        ({"resolution_check": True}, "resolution_check"),
    ],
)
def test_what_has_no_blocks_is_refused(scan, tmp_path, changes, words):
    plan = PLAN.changed(blocks=2, **changes)
    with pytest.raises(InvalidInput, match=f"blocks: found 2.*{words}"):
        BlockSartGraph(Scan(MemorySource(scan), plan), 0, tmp_path / BLOCKS)
