"""`bentray convert`: a scan of another program becomes a dataset file, or the field at fault is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.io import savemat
from typer.testing import Result

from bentray_workers.files.dataset import read_dataset

from ...workers.foreign_scans.scans import delta_tof, travel_times


def test_a_matlab_file_is_converted(bentray: Callable[..., Result], tmp_path: Path) -> None:
    savemat(tmp_path / "scan.mat", travel_times())
    result = bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5", "--json")
    assert result.exit_code == 0
    said = json.loads(result.stdout)
    assert (said["elements"], said["travel_times"], said["traces"]) == (8, True, False)
    assert "assumed" in said["source"]
    np.testing.assert_array_equal(read_dataset(tmp_path / "scan.h5").delta_tof_s, delta_tof())
    again = bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5")
    assert again.exit_code == 2
    forced = bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5", "--force")
    assert forced.exit_code == 0
    assert forced.stdout.split()[-1].endswith("scan.h5")


def test_the_field_at_fault_is_named(bentray: Callable[..., Result], tmp_path: Path) -> None:
    savemat(tmp_path / "scan.mat", {"delta_tof": delta_tof()})
    result = bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5")
    assert result.exit_code == 2
    assert "element_positions: found nothing; accepted: (N, 2) numbers in m" in result.stderr
    assert not (tmp_path / "scan.h5").exists()


def test_a_file_is_not_converted_into_itself(bentray: Callable[..., Result], tmp_path: Path) -> None:
    savemat(tmp_path / "scan.h5", travel_times(), appendmat=False)
    before = (tmp_path / "scan.h5").read_bytes()
    result = bentray("convert", tmp_path / "scan.h5", "-o", tmp_path / "scan.h5", "--force")
    assert result.exit_code == 2
    assert (tmp_path / "scan.h5").read_bytes() == before
