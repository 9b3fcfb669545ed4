"""Guided picking: better picks in noise, progress, resumed runs, slices and repeated results."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform, pick
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.reconstruction import reconstruction_run
from bentray_workers.reconstruction.memory import picking_memory

from ...kernels.acquisition.traces import RADIUS_M, blob_delay, scan
from ..cluster.tearing import torn_runs

ELEMENTS = 16
ALONE = Settings.of(
    method="gauss-newton", rays="straight", nodes=24, iterations=2, penalty="laplacian", examine=False
)
PLAN = ALONE.changed(guided_rounds=2)


@cache
def noisy():
    return scan(blob_delay(ELEMENTS), elements=ELEMENTS, noise=0.15, seed=4)


@pytest.fixture
def path(tmp_path, monkeypatch):
    # A few emissions a call.
    monkeypatch.setattr(picking_memory, "TASK_SAMPLES", 50_000)
    write_dataset(tmp_path / "scan.h5", noisy())
    return tmp_path / "scan.h5"


def test_in_noise_guided_picks_are_more_and_no_worse(path, tmp_path):
    unguided = reconstruction_run.reconstruct(None, path, ALONE)
    seen = []
    result = reconstruction_run.reconstruct(None, path, PLAN, seen.append, work_dir=tmp_path / "work")
    assert not np.array_equal(unguided.speed, result.speed)
    assert result.settings == replace(PLAN, decomposition="slices")
    last = sorted((tmp_path / "work").glob("*-picked.h5"))[-1]
    delay, far = blob_delay(ELEMENTS), noisy().distance_m() > RADIUS_M
    guided, alone = (
        np.abs(one.delta_tof_s - delay)[far & ~np.eye(ELEMENTS, dtype=bool)]
        for one in (read_dataset(last), pick(noisy()))
    )
    assert (guided < 1.5e-7).sum() >= (alone < 1.5e-7).sum()
    assert (guided >= 1.5e-7).sum() <= (alone >= 1.5e-7).sum()
    done = [progress.done for progress in seen if progress.phase == reconstruction_run.RECONSTRUCTING]
    assert done == sorted(done)
    assert done[-1] == seen[-1].total


def test_interrupted_run_resumes_to_the_same_bits(cluster, path, tmp_path):
    def go_on(tear):
        return reconstruction_run.reconstruct(cluster.client, path, PLAN, tear, work_dir=tmp_path / "work")

    result, reached = torn_runs(go_on, (2, 3, 4))
    assert len(reached) > 2
    assert reached[-1] > 0, "something was restored"
    whole = reconstruction_run.reconstruct(None, path, PLAN)
    np.testing.assert_array_equal(result.speed, whole.speed)
    assert result.history == whole.history


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


def test_settings_reproduce_a_guided_result(path):
    plan = PLAN.changed(method="auto", rays="curved", guided_rounds=1)
    first = reconstruction_run.reconstruct(None, path, plan)
    assert first.settings.method != "auto"
    assert first.settings.numerics.guided_rounds == 1
    assert len(first.trials) > 1
    again = reconstruction_run.reconstruct(None, path, first.settings)
    np.testing.assert_array_equal(again.speed, first.speed)


def test_provided_times_are_not_picked_again(tmp_path):
    known = replace(noisy(), waveform=None, delta_tof_s=blob_delay(ELEMENTS))
    write_dataset(tmp_path / "known.h5", known)
    plain, guided = (
        reconstruction_run.reconstruct(None, tmp_path / "known.h5", plan) for plan in (ALONE, PLAN)
    )
    np.testing.assert_array_equal(guided.speed, plain.speed)


@pytest.mark.parametrize(("rounds", "decomposition"), [(-1, "slices"), (11, "slices"), (1, "volume")])
def test_rejects_scans_that_cannot_be_guided(rounds, decomposition):
    with pytest.raises(InvalidInput, match="guided_rounds"):
        Settings.of(method="sart", guided_rounds=rounds, decomposition=decomposition)
