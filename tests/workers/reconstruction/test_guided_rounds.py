"""Times read again about those that an image predicts: as in memory, whole, torn, and told as it goes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.guided_picking import reconstruct_guided
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.reconstruction import reconstruction_run
from bentray_workers.reconstruction.memory import picking_memory

from ...kernels.acquisition.traces import blob_delay, scan
from ..cluster.tearing import torn_runs

ELEMENTS = 16
ALONE = Settings.of(
    method="gauss-newton", rays="straight", nodes=24, iterations=2, penalty="laplacian", examine=False
)
PLAN = ALONE.changed(guided_rounds=2)


@cache
def noisy():
    return scan(blob_delay(ELEMENTS), elements=ELEMENTS, noise=0.15, seed=4)


@cache
def expected():
    return reconstruct_guided(noisy(), ALONE, rounds=2)


@pytest.fixture
def path(tmp_path, monkeypatch):
    # A few emissions a call.
    monkeypatch.setattr(picking_memory, "TASK_SAMPLES", 50_000)
    write_dataset(tmp_path / "scan.h5", noisy())
    return tmp_path / "scan.h5"


def test_a_file_gives_what_alternating_in_memory_gives(path, tmp_path):
    picked, image = expected()
    unguided = reconstruction_run.reconstruct(None, path, ALONE)
    assert not np.array_equal(unguided.speed, image.speed)
    seen = []
    result = reconstruction_run.reconstruct(None, path, PLAN, seen.append, work_dir=tmp_path / "work")
    np.testing.assert_array_equal(result.speed, image.speed)
    assert (result.history, result.settings) == (image.history, PLAN)
    last = sorted((tmp_path / "work").glob("*-picked.h5"))[-1]
    np.testing.assert_allclose(read_dataset(last).delta_tof_s, picked.delta_tof_s, atol=1e-9)
    seen = [progress for progress in seen if progress.phase == reconstruction_run.RECONSTRUCTING]
    done = [progress.done for progress in seen]
    assert done == sorted(done)
    assert done[-1] == seen[-1].total


def test_a_torn_run_is_gone_on_from_to_the_same_bits(cluster, path, tmp_path):
    def go_on(tear):
        return reconstruction_run.reconstruct(cluster.client, path, PLAN, tear, work_dir=tmp_path / "work")

    result, reached = torn_runs(go_on, (2, 3, 4))
    assert len(reached) > 2
    assert reached[-1] > 0, "something was restored"
    np.testing.assert_array_equal(result.speed, expected()[1].speed)
    assert result.history == expected()[1].history


def test_slices_are_guided_by_their_own_images_and_faults_stay_corrected(path, tmp_path):
    both = [np.stack([part, part]) for part in (noisy().waveform.object, noisy().waveform.water)]
    for traces in both:
        traces[1, :, 3] *= -1.0
    stacked = replace(noisy(), waveform=Waveform(*both), slice_z_m=np.array([0.0, 0.01]))
    write_dataset(tmp_path / "two.h5", stacked)
    plan = PLAN.changed(guided_rounds=1, examine=True)
    one, two = (reconstruction_run.reconstruct(None, file, plan) for file in (path, tmp_path / "two.h5"))
    for k in range(2):
        np.testing.assert_array_equal(two.speed[..., k], one.speed)
    assert "slice 1: polarity: 1 inverted in reception (3), corrected" in two.provenance["quality"]


def test_the_settings_of_a_guided_result_make_it_again(path):
    plan = PLAN.changed(method="auto", rays="curved", guided_rounds=1)
    first = reconstruction_run.reconstruct(None, path, plan)
    assert first.settings.method != "auto"
    assert first.settings.numerics.guided_rounds == 1
    assert len(first.trials) > 1
    again = reconstruction_run.reconstruct(None, path, first.settings)
    np.testing.assert_array_equal(again.speed, first.speed)


def test_times_that_came_with_the_scan_are_not_sought_again(tmp_path):
    known = replace(noisy(), waveform=None, delta_tof_s=blob_delay(ELEMENTS))
    write_dataset(tmp_path / "known.h5", known)
    plain, guided = (
        reconstruction_run.reconstruct(None, tmp_path / "known.h5", plan) for plan in (ALONE, PLAN)
    )
    np.testing.assert_array_equal(guided.speed, plain.speed)


@pytest.mark.parametrize(("rounds", "decomposition"), [(-1, "slices"), (11, "slices"), (1, "volume")])
def test_what_cannot_be_guided_is_refused(rounds, decomposition):
    with pytest.raises(InvalidInput, match="guided_rounds"):
        Settings.of(guided_rounds=rounds, decomposition=decomposition)
