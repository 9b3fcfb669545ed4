"""`bentray convert`: a scan of another program becomes a dataset file, or the field at fault is named."""

import json
from pathlib import Path

import numpy as np
from scipy.io import savemat

from bentray_workers.files.dataset import read_dataset

from ...workers.foreign_scans.scans import delta_tof, positions, travel_times
from .conftest import Run


def test_a_matlab_file_is_converted(bentray: Run, tmp_path: Path) -> None:
    savemat(tmp_path / "scan.mat", travel_times())
    result = bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5", "--json")
    said = json.loads(result.stdout)
    assert (said["elements"], said["travel_times"], said["traces"]) == (8, True, False)
    assert "assumed" in said["source"]
    np.testing.assert_array_equal(read_dataset(tmp_path / "scan.h5").delta_tof_s, delta_tof())
    bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5", code=2)
    forced = bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5", "--force")
    assert forced.stdout.split()[-1].endswith("scan.h5")


def test_the_field_at_fault_is_named(bentray: Run, tmp_path: Path) -> None:
    savemat(tmp_path / "scan.mat", {"delta_tof": delta_tof()})
    result = bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5", code=2)
    assert "element_positions: found nothing; accepted: (N, 2) numbers in m" in result.stderr
    assert not (tmp_path / "scan.h5").exists()


def test_a_file_is_not_converted_into_itself(bentray: Run, tmp_path: Path) -> None:
    savemat(tmp_path / "scan.h5", travel_times(), appendmat=False)
    before = (tmp_path / "scan.h5").read_bytes()
    bentray("convert", tmp_path / "scan.h5", "-o", tmp_path / "scan.h5", "--force", code=2)
    assert (tmp_path / "scan.h5").read_bytes() == before


def test_a_dataset_file_is_corrected(bentray: Run, tmp_path: Path) -> None:
    savemat(tmp_path / "scan.mat", travel_times())
    bentray("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5")
    words = ("correct", tmp_path / "scan.h5", "-o", tmp_path / "new.h5")
    result = bentray(*words, "--frequency", 5e5)
    assert " ".join(result.stdout.split()).startswith("Corrected copy of scan.h5: frequency 500000 Hz. ")
    made, wrong = read_dataset(tmp_path / "new.h5"), read_dataset(tmp_path / "scan.h5")
    assert made.center_frequency_hz == 5e5
    np.testing.assert_array_equal(made.delta_tof_s, wrong.delta_tof_s)
    nothing = bentray(*words, "--force", code=2)
    assert "which changes nothing" in nothing.stderr
    unit = bentray(*words, "--force", "--times-in", "min", code=2)
    assert "times_in: found 'min'; accepted: one of s, ms, us, ns" in " ".join(unit.stderr.split())


def own_variables(path: Path) -> tuple[object, ...]:
    """A file in mm and µs under own names; returns the options that describe it."""
    own = {"pos": 1e3 * positions(), "dtof": 1e6 * delta_tof()}
    savemat(path, own)
    return ("--map", "element_position=pos", "--map", "delta_tof=dtof", "--unit", "mm", "--unit", "us")


def test_own_variables_are_named_on_the_command_line(bentray: Run, tmp_path: Path) -> None:
    options = own_variables(tmp_path / "scan.mat")
    words = ("convert", tmp_path / "scan.mat", "-o", tmp_path / "scan.h5")
    assert "own names of variables: --map element_position=NAME" in bentray(*words, code=2).stderr
    assert "write m, or state the unit: --unit mm" in bentray(*words, *options[:4], code=2).stderr
    bentray(*words, *options, "--temperature", 24, "--frequency", 1e6)
    dataset = read_dataset(tmp_path / "scan.h5")
    np.testing.assert_allclose(dataset.delta_tof_s, delta_tof())
    assert (dataset.water_temperature_c, dataset.center_frequency_hz) == (24.0, 1e6)


def test_a_foreign_scan_is_reconstructed_and_its_assumption_comes_first(bentray: Run, tmp_path: Path) -> None:
    options = own_variables(tmp_path / "scan.mat")
    quick = ("--nodes", 32, "--iterations", 1, "--rays", "straight", "--method", "sart", "--workers", 1)
    words = ("reconstruct", tmp_path / "scan.mat", "-o", tmp_path / "out", *options, *quick)
    result = bentray(*words)
    first = " ".join(result.stdout.split()).partition(". ")[0]
    assert first.startswith("The water temperature is not stated in the scan: 20 °C (1482.4 m/s) is assumed")
    assert first.endswith("one degree more raises every speed by 3 m/s")
    assert sorted(path.suffix for path in (tmp_path / "out").iterdir()) == [".h5", ".json", ".png"]
    stated = bentray(*words, "--temperature", 20, "--json")
    assert "water" not in json.loads(stated.stdout)["provenance"]
