"""`bentray quality`: report, page and exit codes; an unusable scan fails with a reason."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from bentray_workers.files.dataset import read_dataset, write_dataset

from ...kernels.acquisition.traces import blob_delay, scan
from .conftest import Run


def test_faults_are_reported_and_the_rest_continues(bentray: Run, tmp_path: Path) -> None:
    faulty = scan(blob_delay(24), elements=24, noise=0.01)
    faulty.waveform.object[:, 5] = faulty.waveform.water[:, 5] = 0.0
    faulty.waveform.object[9] *= -1.0
    faulty.waveform.water[9] *= -1.0
    write_dataset(tmp_path / "scan.h5", faulty)
    result = bentray("quality", tmp_path / "scan.h5", "-o", tmp_path / "out", "--json")
    said = json.loads(result.stdout)
    assert said["verdict"] == "usable"
    results = {(f["check"], tuple(f["elements"]), f["role"], f["action"]) for f in said["findings"]}
    assert ("dead elements", (5,), "reception", "left out") in results
    assert ("polarity", (9,), "emission", "corrected") in results
    assert json.loads((tmp_path / "out" / "quality.json").read_text()) == said
    assert (tmp_path / "out" / "quality.png").read_bytes().startswith(b"\x89PNG\r\n")
    picked = read_dataset(tmp_path / "out" / "picked.h5")
    assert np.isnan(picked.differential_tof()[:, 5]).all()
    assert np.isfinite(picked.differential_tof()[9]).sum() > 15
    table = bentray("quality", tmp_path / "scan.h5", "-o", tmp_path / "out")
    assert "dead elements" in table.stdout
    assert "picked.h5" in table.stdout


def test_a_refused_scan_fails_with_the_reason_and_leaves_its_report(bentray: Run, tmp_path: Path) -> None:
    write_dataset(tmp_path / "scan.h5", replace(scan(elements=16), sampling_rate_hz=4.0e6))
    result = bentray("quality", tmp_path / "scan.h5", "-o", tmp_path / "out", code=1)
    assert "sampling rate: arrivals in water at" in " ".join(result.stderr.split())
    told = json.loads((tmp_path / "out" / "quality.json").read_text())
    assert told["verdict"] == "refused"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["quality.json", "quality.png"]


def test_a_scan_without_findings_is_told_what_was_checked(bentray: Run, tmp_path: Path) -> None:
    times = scan(elements=16)
    write_dataset(tmp_path / "scan.h5", replace(times, waveform=None, delta_tof_s=np.zeros((16, 16))))
    result = bentray("quality", tmp_path / "scan.h5", "-o", tmp_path / "out")
    first, second = result.stdout.splitlines()[:2]
    assert first == "scan.h5: clean"
    first = "checked: impossible times, order of the elements, time zero of the object scan, "
    assert second.startswith(first)


def test_a_calibration_puts_the_elements_where_the_water_shot_has_them(bentray: Run, tmp_path: Path) -> None:
    drawn = scan(blob_delay(24), elements=24, noise=0.01)
    # The drawing is wrong, the traces are right.
    wrong = 3e-4 * np.random.default_rng(2).standard_normal((24, 2))
    wrong -= wrong.mean(axis=0)
    write_dataset(tmp_path / "scan.h5", replace(drawn, element_position_m=drawn.element_position_m + wrong))
    bentray("quality", tmp_path / "scan.h5", "-o", tmp_path / "out", "--calibrate", "stated")
    told = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert told["water_speed_mps"] == drawn.water_speed_mps
    assert 0.0 < np.median(told["position_sigma_m"]) < 3e-5
    dataset = read_dataset(tmp_path / "out" / "picked.h5").element_position_m
    np.testing.assert_array_equal(dataset, told["element_position_m"])
    off = dataset - drawn.element_position_m
    turn = np.column_stack((-drawn.element_position_m[:, 1], drawn.element_position_m[:, 0]))
    off -= off.mean(axis=0)
    off -= turn * (off * turn).sum() / (turn * turn).sum()
    assert np.sqrt((off**2).mean()) < 0.2 * np.sqrt((wrong**2).mean())


def test_a_calibration_needs_a_water_shot(bentray: Run, tmp_path: Path) -> None:
    times = replace(scan(elements=16), waveform=None, delta_tof_s=blob_delay(16))
    write_dataset(tmp_path / "scan.h5", times)
    result = bentray("quality", tmp_path / "scan.h5", "-o", tmp_path / "out", "--calibrate", "fitted", code=2)
    assert "waveform/object: found no traces" in result.stderr
