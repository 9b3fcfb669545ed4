"""Checkpoints: two of each graph, the newest undamaged one is used, and none of other kernels."""

import errno
from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography.reconstruction_graph import ReconstructionCheckpoint
from bentray_kernels.tomography.result import Iteration
from bentray_kernels.tomography.sart import sart_step
from bentray_workers.cluster import checkpoints
from bentray_workers.cluster.checkpoints import INTERVAL_S, Checkpoints

from ...clock import Clock


def checkpoint(sweep, emitter=0, seed=0):
    image = np.random.default_rng((seed, sweep, emitter)).normal(size=(5, 4))
    history = tuple(Iteration(0, k + 1, 1.0 / 3.0**k, 8) for k in range(sweep))
    state = replace(
        sart_step.begin(image), iteration=sweep, emitter=emitter, squares=0.1 + emitter, history=history
    )
    values = None, image[:, 0], float("inf")
    return ReconstructionCheckpoint(
        1, 24, (Iteration(0, 1, float("nan"), 8),), state, values, 1e-3, (0.0, 0.0)
    )


def same(one, other):
    assert np.array_equal(one.state.slowness, other.state.slowness)
    assert one.state.slowness.dtype == other.state.slowness.dtype
    assert (one.stage, one.passes_before, one.state.squares) == (
        other.stage,
        other.passes_before,
        other.state.squares,
    )
    assert one.state.history == other.state.history
    assert (one.values[0], one.values[2]) == (None, float("inf"))
    assert np.array_equal(one.values[1], other.values[1])


def test_the_last_one_comes_back(tmp_path):
    saved = []
    kept = Checkpoints(tmp_path / "c", lambda: saved.append(None))
    assert kept.load("0-00001") is None
    for sweep in range(4):
        kept.save("0-00001", checkpoint(sweep))
    kept.save("0-00012", checkpoint(9))
    assert len(saved) == 5
    same(Checkpoints(tmp_path / "c").load("0-00001"), checkpoint(3))
    same(Checkpoints(tmp_path / "c").load("0-00012"), checkpoint(9))
    assert sorted(path.name for path in (tmp_path / "c").iterdir()) == [
        "0-00001-000003.npz",
        "0-00001-000004.npz",
        "0-00012-000001.npz",
    ]


def test_a_resumed_run_numbers_on(tmp_path):
    Checkpoints(tmp_path).save("a", checkpoint(1))
    Checkpoints(tmp_path).save("a", checkpoint(2))
    same(Checkpoints(tmp_path).load("a"), checkpoint(2))


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "text", "gone"])
def test_a_damaged_file_is_passed_over(tmp_path, damage, caplog):
    kept = Checkpoints(tmp_path)
    kept.save("a", checkpoint(1))
    kept.save("a", checkpoint(2))
    newest = tmp_path / "a-000002.npz"
    content = bytearray(newest.read_bytes())
    if damage == "flipped":
        # In the data of the first array, which only its check sum can tell.
        content[content.index(b"NUMPY") + 200] ^= 1
    newest.write_bytes({"cut": content[:-100], "empty": b"", "text": b"nothing"}.get(damage, bytes(content)))
    if damage == "gone":
        newest.unlink()
    same(Checkpoints(tmp_path).load("a"), checkpoint(1))
    assert ("a-000002.npz is not used" in caplog.text) is (damage != "gone")


def test_files_of_other_kernels_are_passed_over(tmp_path, monkeypatch):
    Checkpoints(tmp_path).save("a", checkpoint(1))
    monkeypatch.setattr(checkpoints, "digest", lambda module: "other")
    assert Checkpoints(tmp_path).load("a") is None


def test_within_a_pass_it_is_kept_now_and_then(tmp_path):
    saved, clock = [], Clock()
    kept = Checkpoints(tmp_path, lambda: saved.append(clock.now), clock)
    for emitter in range(100):
        kept.save("a", checkpoint(0, emitter))
        clock.now += 0.1 * INTERVAL_S
    assert 9 <= len(saved) <= 11
    # Nothing has moved: rows of an iteration are being gathered.
    still = checkpoint(1)
    kept.save("a", still)
    before = len(saved)
    for _ in range(100):
        kept.save("a", replace(still))
        clock.now += INTERVAL_S
    assert len(saved) == before


def test_a_full_disk_leaves_the_one_before(tmp_path, monkeypatch):
    kept = Checkpoints(tmp_path)
    kept.save("a", checkpoint(1))

    def full(file, **arrays):
        file.write(b"half")
        raise OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(checkpoints.np, "savez", full)
    with pytest.raises(OSError, match="full"):
        kept.save("a", checkpoint(2))
    same(kept.load("a"), checkpoint(1))
    assert len(list(tmp_path.iterdir())) == 1
