"""`bentray reconstruct`: three files and honest figures, with no server about."""

import json
import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.requirements import check_scan
from bentray_service.cli.reconstruct import useful_workers
from bentray_workers.cluster import connection
from bentray_workers.files.reconstruction import read_reconstruction

from .conftest import Run

QUICK = ("--nodes", 32, "--iterations", 2)


@pytest.fixture(autouse=True)
def workers_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worker processes take long to start; their bits are in tests/workers/cluster/test_pipelines.py."""
    monkeypatch.setattr(connection, "open_cluster", partial(connection.open_cluster, processes=False))


def test_it_writes_volume_picture_and_figures(
    bentray: Run, scan_file: Path, tmp_path: Path, drawn: Any
) -> None:
    result = bentray(
        "reconstruct", scan_file, "-o", tmp_path / "new" / "out", *QUICK, "--rays", "straight", "--json"
    )
    said = json.loads(result.stdout)
    folder = tmp_path / "new" / "out"
    assert sorted(path.name for path in folder.iterdir()) == [
        "reconstruction.h5",
        "reconstruction.json",
        "reconstruction.png",
    ]
    assert json.loads((folder / "reconstruction.json").read_text()) == said
    assert (folder / "reconstruction.png").read_bytes().startswith(b"\x89PNG\r\n")
    volume = read_reconstruction(folder / "reconstruction.h5")
    assert volume.settings.rays == "straight"
    assert said["speed_range_mps"] == [volume.speed.min(), volume.speed.max()]
    assert [sweep["sweep"] for sweep in said["history"]] == [1, 2]
    assert said["history"][1]["residual_rms_s"] < said["history"][0]["residual_rms_s"]
    assert said["truth"]["region"] == "mask/roi of the file"
    assert 0 < said["truth"]["rmse_mps"] < 60
    assert f"Difference: {caption(said['truth'])}" in drawn.words(), "picture and figures agree"


def caption(errors: dict[str, Any]) -> str:
    return f"{100 * errors['mean_absolute_error_of_range']:.1f} % of range, {errors['rmse_mps']:.1f} m/s rms"


def test_without_json_it_ends_with_a_table_and_the_paths(
    bentray: Run, scan_file: Path, tmp_path: Path
) -> None:
    result = bentray("reconstruct", scan_file, "-o", tmp_path, *QUICK)
    assert result.stdout.splitlines()[-3:] == [
        str(tmp_path / f"reconstruction.{kind}") for kind in ("h5", "png", "json")
    ]
    assert "rms error" in result.stdout
    assert result.stderr == ""


def test_auto_prints_its_choice_and_reason_in_one_line(bentray: Run, scan_file: Path, tmp_path: Path) -> None:
    words = ("--method", "auto", "--resolution-check", "--workers", 1)
    result = bentray("reconstruct", scan_file, "-o", tmp_path, *QUICK, *words)
    told = [line for line in result.stdout.splitlines() if line.startswith("auto chose ")]
    said = json.loads((tmp_path / "reconstruction.json").read_text())
    assert told == [said["reason"]]
    chosen = said["trials"][0]["settings"]
    used = {**said["settings"], **said["settings"]["gauss_newton"]}
    assert chosen.items() <= used.items()
    assert 0.0 < said["recovery_mean"] <= 1.0
    assert 0.0 < said["residual_within_s"]["50"] < said["residual_within_s"]["99"]


def heights(slices: int) -> Dataset:
    """A scan of so many slices; 1 is a plain 2-D scan."""
    ring, everyone = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]]), np.arange(3)
    if slices == 1:
        return Dataset(ring, everyone, everyone, 1500.0, delta_tof_s=np.zeros((3, 3)))
    z, delta = 1e-3 * np.arange(slices), np.zeros((slices, 3, 3))
    return Dataset(ring, everyone, everyone, 1500.0, delta_tof_s=delta, slice_z_m=z)


@pytest.mark.parametrize(
    ("slices", "settings", "workers"),
    [
        (1, Settings(method="sart"), 1),
        (3, Settings(method="sart"), 3),
        (9, Settings(method="sart"), 4),
        (9, Settings(method="sart", decomposition="volume"), 1),
        (9, Settings(decomposition="volume", method="gauss-newton"), 4),
        (1, Settings(method="gauss-newton"), 1),
        (3, Settings(method="gauss-newton"), 3),
        (1, Settings(method="auto"), 4),
    ],
)
def test_there_are_as_many_workers_as_have_work_and_cores(
    monkeypatch: pytest.MonkeyPatch, slices: int, settings: Settings, workers: int
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(4)))
    assert useful_workers(heights(slices), settings) == workers


def test_a_volume_of_one_height_is_rejected_before_any_worker_starts() -> None:
    with pytest.raises(InvalidInput, match="decomposition"):
        useful_workers(heights(1), Settings(decomposition="volume", method="gauss-newton"))


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        (Settings(method="waveform"), "waveform' for a scan without traces"),
        (Settings.from_values(method="sart", amplitudes="ratio"), "waveform/object"),
        (Settings(method="sart", roi=True), "mask/roi"),
        (Settings(method="sart", speed_bounds_mps=(1600.0, 1800.0)), "speed_bounds_mps"),
        (Settings(method="sart", decomposition="volume"), "decomposition"),
    ],
)
def test_rejects_bad_headers_before_start(settings: Settings, field: str) -> None:
    with pytest.raises(InvalidInput, match=field):
        check_scan(heights(1), settings, 0)
