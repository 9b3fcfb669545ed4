"""Reading scans in a Python session: every reader of the service, its messages, and no files left behind."""

import gc
import os
from pathlib import Path

import numpy as np
import pytest

import bentray
from bentray_service.interactive import scan as scan_module
from bentray_workers.foreign_scans import convert_dataset

from ...workers.foreign_scans.scans import delta_tof, positions, travel_times, write_matlab73


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def test_a_file_in_the_upload_format_is_read_where_it_is(
    simulated: bentray.Scan, tmp_path: Path, temporary: Path
) -> None:
    path = simulated.save(tmp_path / "scan.h5")
    scan = bentray.read(str(path))
    assert os.fspath(scan) == str(path)
    assert (scan.title, scan.water_speed_mps, scan.samples) == (simulated.title, 1375.0, 0)
    np.testing.assert_array_equal(scan.position_m, simulated.position_m)
    np.testing.assert_array_equal(scan.delta_tof_s(), simulated.delta_tof_s())
    assert scan.truth is not None
    assert list(temporary.iterdir()) == []


def test_a_scan_of_another_program_is_converted_and_cleaned_up(tmp_path: Path, temporary: Path) -> None:
    write_matlab73(tmp_path / "scan.mat", travel_times())
    scan = bentray.read(tmp_path / "scan.mat", temperature_c=30.0)
    np.testing.assert_array_equal(scan.delta_tof_s(), delta_tof())
    assert scan.water_speed_mps == pytest.approx(1509.1, abs=0.1)
    assert scan.path.parent.parent == temporary
    del scan
    gc.collect()
    assert list(temporary.iterdir()) == []


def test_own_variables_and_units_are_named(tmp_path: Path) -> None:
    own = {"pos": 1e3 * positions(), "dt": 1e6 * delta_tof()}
    write_matlab73(tmp_path / "scan.mat", own, header=False)
    scan = bentray.read(
        tmp_path / "scan.mat", map={"element_position": "pos", "delta_tof": "dt"}, unit=("mm", "us")
    )
    np.testing.assert_allclose(scan.position_m, positions())
    np.testing.assert_allclose(scan.delta_tof_s(), delta_tof())


def test_messages_are_those_of_the_service(tmp_path: Path, temporary: Path) -> None:
    broken = {**travel_times(), "element_positions": positions()[:, :1]}
    write_matlab73(tmp_path / "scan.mat", broken)
    with pytest.raises(bentray.InvalidInput) as there:
        convert_dataset(tmp_path / "scan.mat", tmp_path / "canonical.h5")
    with pytest.raises(bentray.InvalidInput) as here:
        bentray.read(tmp_path / "scan.mat")
    assert str(here.value) == str(there.value)
    assert list(temporary.iterdir()) == []
    with pytest.raises(bentray.InvalidInput, match=r"file: found .*none\.h5 \(no such file\)"):
        bentray.read(tmp_path / "none.h5")
    with pytest.raises(bentray.InvalidInput, match="unit: found 'inch'; accepted: one of m, s"):
        bentray.read(tmp_path / "scan.mat", unit="inch")


def test_a_scan_is_saved_as_hdf5_only(simulated: bentray.Scan, tmp_path: Path) -> None:
    with pytest.raises(
        bentray.InvalidInput, match=r"path: found .*scan\.mat; accepted: a name ending in \.h5"
    ):
        simulated.save(tmp_path / "scan.mat")
    assert list(tmp_path.iterdir()) == []


def test_a_notebook_shows_a_scan(simulated: bentray.Scan) -> None:
    assert repr(simulated) == (
        "<bentray.Scan 'table6': 24 elements, 24 emitters, 24 receivers, 1 slice; times and truth>"
    )
    shown = simulated._repr_html_()
    for words in ("2-D breast phantom", "1375.0 m/s", "times and truth", "made by bentray simulate"):
        assert words in shown


def test_an_unfinished_scan_leaves_nothing(temporary: Path) -> None:
    def fail(target: Path) -> None:
        target.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        scan_module.temporary_scan("half", fail)
    assert list(temporary.iterdir()) == []
