"""The image of an unfinished reconstruction: the values of its newest checkpoint, read without a trace."""

import base64
from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.reconstruction_graph import ReconstructionCheckpoint
from bentray_kernels.tomography.sart import sart_step
from bentray_kernels.tomography.waveform import band_inversion
from bentray_kernels.tomography.waveform.inversion_state import (
    ActiveBand,
    BandEnd,
    Image,
    RefinementCheckpoint,
)
from bentray_workers.cluster.checkpoints import Checkpoints
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction import reconstruction_run
from bentray_workers.reconstruction.preview import checkpoint_image


def speeds(*shape, seed=0):
    return 1500.0 + 30.0 * np.random.default_rng(seed).standard_normal(shape)


def by_rays(speed, sweep=2, stage=1):
    state = replace(sart_step.begin(1.0 / speed), iteration=sweep)
    return ReconstructionCheckpoint(stage, 0, (), state, (None,), 2e-3, (-0.01, -0.02, 0.03)[: speed.ndim])


def shown(record):
    values = np.frombuffer(base64.b64decode(record["speed"]), dtype="<f4").reshape(record["shape"])
    assert record["range_mps"] == pytest.approx([values.min(), values.max()])
    return values


def test_the_values_are_those_of_the_checkpoint(tmp_path):
    speed = speeds(7, 5)
    Checkpoints(tmp_path).save("0-00000", by_rays(speed))
    record = checkpoint_image(tmp_path)
    np.testing.assert_allclose(shown(record), speed, rtol=1e-6)
    assert [record[name] for name in ("every", "stage", "iteration")] == [1, 2, 2]
    assert [record[name] for name in ("reconstruction", "part", "parts")] == [1, 1, 1]


@pytest.mark.parametrize("order", ["C", "F"])
def test_large_images_are_reduced_to_nodes_of_them(tmp_path, order):
    speed = np.asarray(speeds(300, 520), order=order)
    Checkpoints(tmp_path).save("0-00000", by_rays(speed))
    record = checkpoint_image(tmp_path)
    assert record["every"] == 3
    assert record["spacing_m"] == pytest.approx([6e-3, 6e-3])
    assert record["origin_m"] == [-0.01, -0.02]
    np.testing.assert_allclose(shown(record), speed[::3, ::3], rtol=1e-6)


@pytest.mark.parametrize("order", ["C", "F"])
def test_the_middle_plane_of_a_volume(tmp_path, order):
    speed = np.asarray(speeds(6, 5, 4), order=order)
    Checkpoints(tmp_path).save("0-00000", by_rays(speed))
    np.testing.assert_allclose(shown(checkpoint_image(tmp_path)), speed[..., 2], rtol=1e-6)


def test_the_middle_slice_of_the_newest_group(tmp_path):
    kept = Checkpoints(tmp_path)
    for group, graph in ((9, 0), (10, 0), (10, 1), (10, 2)):
        kept.save(f"{group}-{graph:05d}", by_rays(speeds(4, 4, seed=10 * group + graph)))
    record = checkpoint_image(tmp_path)
    assert [record[name] for name in ("reconstruction", "part", "parts")] == [11, 2, 3]
    np.testing.assert_allclose(shown(record), speeds(4, 4, seed=101), rtol=1e-6)


def test_full_waveform_images(tmp_path):
    first, second = speeds(6, 6, seed=1), speeds(9, 9, seed=2)
    kept = Checkpoints(tmp_path)
    active = ActiveBand(band_inversion.begin(first), 3e-3, (0.01, 0.02), 4)
    kept.save("0-00000", RefinementCheckpoint((), active))
    record = checkpoint_image(tmp_path)
    np.testing.assert_allclose(shown(record), first, rtol=1e-6)
    assert (record["spacing_m"], record["origin_m"]) == ([3e-3, 3e-3], [0.01, 0.02])
    end = BandEnd(Image(second, 1e-3, (0.0, 0.0)), False, (band_inversion.Evaluation(0.5, 0.6, True),))
    kept.save("0-00000", RefinementCheckpoint((end,), None))
    record = checkpoint_image(tmp_path)
    np.testing.assert_allclose(shown(record), second, rtol=1e-6)
    assert (record["stage"], record["iteration"]) == (1, 1)
    assert (record["spacing_m"], record["origin_m"]) == ([1e-3, 1e-3], [0.0, 0.0])
    # While the attenuation is refined, the state holds no speed.
    losses = ActiveBand(band_inversion.begin(np.zeros((9, 9))), 1e-3, (0.0, 0.0), 4, frozen=second)
    kept.save("0-00000", RefinementCheckpoint((end,), losses))
    np.testing.assert_allclose(shown(checkpoint_image(tmp_path)), second, rtol=1e-6)


def test_a_damaged_file_gives_the_one_before_it(tmp_path):
    kept = Checkpoints(tmp_path)
    for sweep in (1, 2):
        kept.save("0-00000", by_rays(speeds(40, 40, seed=sweep), sweep))
    newest = max(tmp_path.iterdir())
    newest.write_bytes(newest.read_bytes()[:5000])
    record = checkpoint_image(tmp_path)
    assert record["iteration"] == 1
    np.testing.assert_allclose(shown(record), speeds(40, 40, seed=1), rtol=1e-6)


def test_without_a_checkpoint_there_is_none_and_nothing_is_made(tmp_path):
    assert checkpoint_image(tmp_path / "absent") is None
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "0-00000-000001.npz").write_bytes(b"no archive")
    assert checkpoint_image(tmp_path) is None


def test_a_running_reconstruction_sharpens(scan, tmp_path):
    write_dataset(tmp_path / "scan.h5", scan)
    work, seen = tmp_path / "work", []
    work.mkdir()
    plan = Settings(method="sart", nodes=32, iterations=3)
    result = reconstruction_run.reconstruct(
        None,
        tmp_path / "scan.h5",
        plan,
        work_dir=work,
        on_saved=lambda: seen.append(checkpoint_image(work / reconstruction_run.CHECKPOINTS)),
    )
    middle = result.speed[..., result.speed.shape[2] // 2]
    np.testing.assert_allclose(shown(seen[-1]), middle, rtol=1e-6)
    of_it = {step["iteration"]: np.abs(shown(step) - middle).max() for step in seen if step["part"] == 2}
    assert of_it[1] > of_it[2] > of_it[3]
    assert tuple(seen[-1]["spacing_m"]) == result.spacing_m[:2]
    assert tuple(seen[-1]["origin_m"]) == result.origin_m[:2]
