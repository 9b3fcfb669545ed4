"""`bentray reproduce`: the same bits from a result's own record; differences are located."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.reconstruction import read_reconstruction, write_reconstruction
from bentray_workers.reconstruction.reconstruction_run import reconstruct

from .conftest import Run

WAYS = {
    "gauss-newton": {"method": "gauss-newton"},
    "auto": {"method": "auto"},
    "fixed numerical parameters": {"subset": 4, "coarser_grids": 0},
}


@pytest.fixture(params=WAYS.values(), ids=list(WAYS))
def made(request: pytest.FixtureRequest, scan_file: Path, tmp_path: Path) -> Path:
    """A result of each way to choose what is done."""
    path = tmp_path / "reconstruction.h5"
    settings = Settings.from_values(nodes=24, iterations=2, **{"method": "sart", **request.param})
    write_reconstruction(path, reconstruct(None, scan_file, settings))
    return path


def test_result_is_reproduced(bentray: Run, made: Path, scan_file: Path) -> None:
    ended = bentray("reproduce", made, scan_file)
    assert ended.stdout.count("identical") >= 4


def test_a_single_bit_is_seen(bentray: Run, made: Path, scan_file: Path) -> None:
    with h5py.File(made, "r+") as file:
        file["speed_mps"][3, 4] = np.nextafter(file["speed_mps"][3, 4], 0.0)
    ended = bentray("reproduce", made, scan_file, "--json", code=1)
    found = json.loads(ended.stdout)["differences"]
    assert 0.0 < found.pop("speed_mps") < 1e-9
    assert set(found.values()) == {None}
    assert "was not reproduced" in ended.stderr


def test_other_scan_or_version_is_reported(bentray: Run, made: Path, scan_file: Path, tmp_path: Path) -> None:
    scan = read_dataset(scan_file)
    write_dataset(tmp_path / "other.h5", replace(scan, delta_tof_s=0.5 * scan.delta_tof_s))
    assert "the scan may be another one" in bentray("reproduce", made, tmp_path / "other.h5", code=1).stderr
    with h5py.File(made, "r+") as file:
        told = json.loads(file.attrs["provenance"]) | {"numpy": "1.0.0"}
        file.attrs["provenance"] = json.dumps(told)
    assert "numpy: 1.0.0 then, " in bentray("reproduce", made, scan_file).stdout


def test_result_without_an_array_is_reported(bentray: Run, made: Path, scan_file: Path) -> None:
    with h5py.File(made, "r+") as file:
        del file["residuals"]
    assert "only now" in bentray("reproduce", made, scan_file, code=1).stdout
    assert read_reconstruction(made).residuals is None
