"""`bentray simulate`: a dataset file with its truth, the same for the same words."""

import json
from pathlib import Path

import numpy as np
import pytest

from bentray_workers.files.dataset import read_dataset

from .conftest import Run

SOLID = ("--phantom", "table7", "--nodes", 16, "--elements", 8, "--slices", 2)
SMALL = ("--nodes", 24, "--elements", 12, "--coupling", 1400)


def test_file_holds_the_requested_scan(bentray: Run, tmp_path: Path) -> None:
    path = tmp_path / "phantom.h5"
    result = bentray("simulate", "-o", path, *SMALL, "--json")
    said = json.loads(result.stdout)
    assert said["output"] == str(path)
    assert said["settings"]["elements"] == 12
    dataset = read_dataset(path)
    assert dataset.water_speed_mps == 1400.0
    assert dataset.delta_tof_s is not None
    assert dataset.delta_tof_s.shape == (12, 12)
    assert dataset.truth is not None
    assert dataset.truth.sound_speed_mps.shape == (24, 24)


@pytest.mark.parametrize(
    ("words", "shape", "array"),
    [
        ((), (2, 8, 8), "ring"),
        (("--three-d", "--refinement", 2), (2, 8, 8), "ring"),
        (("--three-d", "--refinement", 2, "--array", "rings"), (16, 16), "rings"),
    ],
)
def test_a_scan_in_space(
    bentray: Run,
    tmp_path: Path,
    words: tuple[object, ...],
    shape: tuple[int, ...],
    array: str,
) -> None:
    path = tmp_path / "solid.h5"
    result = bentray("simulate", "-o", path, *SOLID, *words, "--attenuation", "--json")
    said = json.loads(result.stdout)["settings"]
    assert said["slices"] == 2
    assert said["three_d"] is ("--three-d" in words)
    dataset = read_dataset(path)
    assert dataset.title == "3-D breast phantom (Li 2008, Table 7), coupling 1500 m/s"
    assert dataset.array_type == array
    assert dataset.delta_tof_s is not None
    assert dataset.delta_tof_s.shape == shape
    assert dataset.log_ratio_np is not None
    assert dataset.truth is not None
    assert dataset.truth.sound_speed_mps.shape == (16, 16, 2)


def test_table_shows_how_the_scan_was_simulated(bentray: Run, tmp_path: Path) -> None:
    told = bentray("simulate", "-o", tmp_path / "solid.h5", *SOLID, "--snr", 20).stdout
    assert "2, one moving ring, 2-D wave fronts" in told
    assert "1/20 of the signal" in told
    told = bentray("simulate", "-o", tmp_path / "flat.h5", *SMALL, "--noise-ns", 5).stdout
    assert "5 ns" in told
    assert "slices" not in told


def test_noise_has_the_requested_size_and_seed(bentray: Run, tmp_path: Path) -> None:
    times = {}
    for name, words in {
        "clean": (),
        "noisy": ("--noise-ns", 50, "--seed", 1),
        "again": ("--noise-ns", 50, "--seed", 1),
        "other": ("--noise-ns", 50, "--seed", 2),
    }.items():
        bentray("simulate", "-o", tmp_path / name, *SMALL, *words)
        times[name] = read_dataset(tmp_path / name).differential_tof()
    assert np.nanstd(times["noisy"] - times["clean"]) == pytest.approx(50e-9, rel=0.3)
    np.testing.assert_array_equal(times["noisy"], times["again"])
    assert np.nanmax(np.abs(times["noisy"] - times["other"])) > 1e-9


@pytest.mark.parametrize("as_json", [True, False])
def test_waves_are_simulated_with_their_traces(bentray: Run, tmp_path: Path, as_json: bool) -> None:
    small = ("--nodes", 24, "--elements", 12, "--emissions", 3, "--frequency", 2e5, "--side", 0.04)
    path = tmp_path / "waves.h5"
    result = bentray("simulate", "-o", path, "--waveform", *small, *(["--json"] if as_json else []))
    if as_json:
        said = json.loads(result.stdout)
        assert said["settings"]["emissions"] == 3
        assert 0.0 < said["phase_speed_error"]["highest"] < 3e-3
    else:
        assert "dispersion" in result.stdout
    dataset = read_dataset(path)
    assert dataset.waveform is not None
    assert dataset.waveform.water is not None
    assert dataset.waveform.object.shape[:2] == (3, 12)
    assert dataset.center_frequency_hz == 2e5
    assert not dataset.picked
