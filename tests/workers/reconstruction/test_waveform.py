"""Refinement by waveforms on a cluster: the same bits as in one process, progress, stopping, going on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform, pick
from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Cancelled
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_kernels.tomography.comparison import compare
from bentray_kernels.tomography.waveform.inversion_state import Image
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.picking_files import reference_path
from bentray_workers.reconstruction import reconstruction_run
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

from ...kernels.tomography.waveform.scans import error, scan, water
from ..cluster.tearing import torn_runs

PLAN = Settings.from_values(method="waveform", nodes=32, iterations=2, bands=3, emitters=5)
# Fewer of everything, where less proves as much.
SHORT = Settings.from_values(method="waveform", nodes=32, iterations=1, bands=2, emitters=3)
HEIGHTS = np.array([0.0, 0.002])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    target = tmp_path_factory.mktemp("scans") / "scan.h5"
    write_dataset(target, scan())
    return target


@pytest.fixture(scope="module")
def expected():
    return reconstruct_here(replace(pick(scan()), waveform=scan().waveform), PLAN)


def same(result, expected):
    for name in ("speed", "coverage", "attenuation"):
        assert np.array_equal(getattr(result, name), getattr(expected, name)), name
    for name in ("history", "spacing_m", "origin_m", "settings", "trials"):
        assert getattr(result, name) == getattr(expected, name), name
    stated = {
        "quality": "nothing found",
        "frequency_hz": repr(scan().center_frequency_hz),
        "pairs": "252 of 276 pairs used, 0 left out",
    }
    assert {**expected.provenance, **stated} == {**result.provenance}


@pytest.mark.nightly
@pytest.mark.opencl
def test_waves_of_a_device_make_the_image_of_compiled_code(path, tmp_path):
    expected = reconstruct_here(replace(pick(scan()), waveform=scan().waveform), SHORT)
    with open_cluster(workers=1, local_directory=tmp_path, processes=False) as cluster:
        computed = reconstruction_run.reconstruct(cluster.client, path, replace(SHORT, device="opencl"))
    assert 0.0 < np.abs(computed.speed - expected.speed).max() < 0.01
    assert computed.settings == replace(expected.settings, device="opencl")
    assert "on OpenCL devices" in computed.provenance["waveform"]
    assert "on OpenCL devices" not in expected.provenance["waveform"]


def test_waves_make_the_image_of_rays_better(expected):
    heard = replace(pick(scan()), waveform=scan().waveform)
    rays = reconstruct_here(heard, replace(PLAN, method="auto"))
    by_rays, by_waves = (error(Image(one.speed, one.spacing_m[0], one.origin_m)) for one in (rays, expected))
    assert by_waves < 0.75 * by_rays
    assert expected.settings == replace(PLAN, decomposition="slices")
    assert expected.trials == rays.trials
    assert expected.residuals is None
    stated = expected.provenance["waveform"]
    assert stated.startswith("full waveform, 62 to 281 kHz, predicts held-out emitters ")
    assert "% better than its initial image (bent rays, " in stated
    assert expected.speed.shape == expected.coverage.shape != rays.speed.shape
    assert expected.history[: len(rays.history)] == rays.history
    waves = expected.history[len(rays.history) :]
    of_speed = {sweep.band_hz for sweep in waves if not sweep.of_attenuation}
    assert of_speed == {(62500.0, 187500.0), (62500.0, 281250.0)}
    losses = [sweep for sweep in waves if sweep.of_attenuation]
    assert {(sweep.stage, sweep.band_hz) for sweep in losses} == {(waves[-1].stage, (187500.0, 281250.0))}
    assert {sweep.residual_rms_s for sweep in losses} == {expected.residual_rms_s}
    assert "; attenuation is experimental" in stated
    # There is none, nor do the wrong parts of the speed make much of it.
    assert 0.0 <= expected.attenuation.min() <= expected.attenuation.mean() < 0.5
    assert min(sweep.stage for sweep in waves) > max(sweep.stage for sweep in rays.history)


@pytest.mark.nightly
def test_an_object_that_nearly_fills_the_array_is_made_better_too(tmp_path):
    """Its outermost nodes are nearer to the elements than any that a band of long waves changes."""
    full = simulate(WaveSimulationSettings(2e5, 0.06, 48, 16, nodes=48, snr=30.0))
    write_dataset(tmp_path / "full.h5", full)
    rays, waves = (
        reconstruction_run.reconstruct(
            None, tmp_path / "full.h5", Settings.from_values(method=method, nodes=48)
        )
        for method in ("auto", "waveform")
    )
    by_rays, by_waves = (compare(result, full.truth).rms for result in (rays, waves))
    assert by_waves < 0.6 * by_rays


def test_a_file_gives_the_bits_of_the_kernels(path, expected):
    seen = []
    same(reconstruction_run.reconstruct(None, path, PLAN, seen.append), expected)
    seen = [progress for progress in seen if progress.phase == reconstruction_run.RECONSTRUCTING]
    done = [progress.done for progress in seen]
    assert done == sorted(done)
    assert done[-1] == seen[-1].total
    parts = [progress.done / progress.total for progress in seen]
    assert parts == sorted(parts)
    assert seen[-1].history == expected.history


@pytest.mark.nightly
def test_interrupted_run_resumes_to_the_same_bits(cluster, path, tmp_path, expected):
    def go_on(tear):
        return reconstruction_run.reconstruct(cluster.client, path, PLAN, tear, work_dir=tmp_path / "work")

    # While rays are tried, in the first band that is gone through, and in the last.
    result, reached = torn_runs(go_on, (20, 120, 60, 90))
    assert reached == sorted(reached)
    assert reached[-1] > 0, "something was restored"
    same(result, expected)


def test_stop_ends_it_among_the_waves(cluster, path):
    seen = []

    def stop():
        return bool(seen and seen[-1].history and seen[-1].history[-1].band_hz)

    with pytest.raises(Cancelled):
        reconstruction_run.reconstruct(cluster.client, path, PLAN, seen.append, stop)
    assert seen[-1].done < seen[-1].total


@pytest.mark.nightly
def test_slices_are_refined_by_themselves(cluster, tmp_path, expected):
    one = scan()
    other = scan(seed=1, noise=0.05)
    both = [np.stack([getattr(part.waveform, name) for part in (one, other)]) for name in ("object", "water")]
    stacked = replace(one, waveform=Waveform(*both), slice_z_m=HEIGHTS)
    write_dataset(tmp_path / "stack.h5", stacked)
    result = reconstruction_run.reconstruct(cluster.client, tmp_path / "stack.h5", PLAN)
    assert result.speed.shape == (*expected.speed.shape, 2)
    assert result.spacing_m[2] == pytest.approx(0.002)
    for k in range(2):
        image = Image(result.speed[..., k], result.spacing_m[0], result.origin_m[:2])
        assert error(image) < 0.75 * error(water())
    assert {sweep.slice for sweep in result.history if sweep.band_hz} == {0, 1}


@pytest.mark.nightly
@pytest.mark.parametrize(
    "picked",
    [
        pytest.param(False, marks=pytest.mark.nightly, id="traces alone"),
        pytest.param(True, id="times and traces"),
    ],
)
def test_without_a_water_shot_the_image_is_nearly_as_good(picked, tmp_path, expected):
    bare = replace(pick(scan()) if picked else scan(), waveform=Waveform(scan().waveform.object))
    write_dataset(tmp_path / "bare.h5", bare)
    result = reconstruction_run.reconstruct(None, tmp_path / "bare.h5", PLAN)
    assert "water shot: none" in result.provenance["quality"]
    with_water, without = (
        error(Image(one.speed, one.spacing_m[0], one.origin_m)) for one in (expected, result)
    )
    assert without < 1.3 * with_water


def test_times_do_not_need_a_water_shot_that_cannot_be_estimated(tmp_path):
    """Chords through water are searched only where they are needed."""
    silent = np.random.default_rng(0).standard_normal(scan().waveform.object.shape).astype(np.float32)
    write_dataset(tmp_path / "times.h5", replace(pick(scan()), waveform=Waveform(silent)))
    rays = Settings.from_values(nodes=32, iterations=2, method="auto")
    result = reconstruction_run.reconstruct(None, tmp_path / "times.h5", rays)
    assert "waveform" not in result.provenance
    with pytest.raises(InvalidInput, match=r"waveform/water: found no traces, and \d+ chords"):
        reconstruction_run.reconstruct(None, tmp_path / "times.h5", PLAN)


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(path.read_bytes()[:-900])])
def test_lost_reference_is_recomputed(tmp_path, damage):
    write_dataset(tmp_path / "bare.h5", replace(scan(), waveform=Waveform(scan().waveform.object)))
    rays = Settings.from_values(method="sart", nodes=32, iterations=2, examine=False)
    work = tmp_path / "work"
    work.mkdir()
    first = reconstruction_run.reconstruct(None, tmp_path / "bare.h5", rays, work_dir=work)
    assert "water shot: none" in first.provenance["quality"]
    whole = reference_path(work, 0).read_bytes()
    damage(reference_path(work, 0))
    again = reconstruction_run.reconstruct(None, tmp_path / "bare.h5", rays, work_dir=work)
    assert reference_path(work, 0).read_bytes() == whole
    assert np.array_equal(again.speed, first.speed)


def test_a_scan_without_traces_is_rejected_before_any_work(tmp_path):
    write_dataset(tmp_path / "times.h5", replace(pick(scan()), waveform=None))
    seen = []
    with pytest.raises(InvalidInput, match="'waveform' for a scan without traces"):
        reconstruction_run.reconstruct(None, tmp_path / "times.h5", PLAN, seen.append)
    assert not seen
