"""The table of readers: each documented with shapes and units, none confused by names of other formats."""

from importlib import import_module
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from bentray_workers.files.dataset import read_dataset
from bentray_workers.foreign_scans import ScanMetadata, convert_dataset, is_upload_format
from bentray_workers.foreign_scans.conversion import READERS

from .hdf5_scans import openusct_fields, write_fields, zea_fields
from .scans import delta_tof, positions, refused, travel_times, write_matlab73

DOCS = Path(__file__).parents[3] / "docs"


def test_every_reader_is_documented(monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    page = (DOCS / "reference" / "scan-file.md").read_text()
    assert "<!-- from the code: scan readers -->" in page
    text = import_module("from_code.scan_readers").scan_readers()
    for reader in READERS:
        assert f"### {reader.title}\n" in text
        for row in reader.variables:
            assert f"| `{row.name}` | {row.shape} | {row.unit} | {row.meaning} | {row.required} |" in text
            assert row.shape
        assert any(variable.required == "yes" for variable in reader.variables)
    assert len({reader.title for reader in READERS}) == len(READERS)


def test_arrays_with_names_of_groups_of_other_formats_are_no_such_formats(tmp_path):
    more = {name: np.ones((2, 2)) for name in ("data", "scan", "geometry", "acquisition", "tracks", "probe")}
    write_matlab73(tmp_path / "scan", travel_times() | more)
    convert_dataset(tmp_path / "scan", tmp_path / "canonical.h5")
    np.testing.assert_array_equal(read_dataset(tmp_path / "canonical.h5").delta_tof_s, delta_tof())
    write_matlab73(tmp_path / "own", {"data": delta_tof(), "geometry": positions()}, header=False)
    given = ScanMetadata.from_options(map=("element_position=geometry", "delta_tof=data"))
    convert_dataset(tmp_path / "own", tmp_path / "canonical.h5", given=given)
    np.testing.assert_array_equal(read_dataset(tmp_path / "canonical.h5").delta_tof_s, delta_tof())


@pytest.mark.parametrize("fields", [zea_fields(), openusct_fields()], ids=["zea", "openusct"])
def test_links_of_hdf5_are_not_followed(tmp_path, fields):
    position = next(name for name in fields if name.endswith(("raw_data", "/data")))
    write_fields(tmp_path / "other.h5", {position: fields[position]})
    write_fields(tmp_path / "scan", {name: value for name, value in fields.items() if name != position})
    for link in (h5py.ExternalLink(str(tmp_path / "other.h5"), position), h5py.SoftLink("/scan")):
        with h5py.File(tmp_path / "scan", "a") as file:
            file.pop(position, None)
            file[position] = link
        refused(tmp_path / "scan")


def test_files_that_need_no_conversion_are_known(tmp_path):
    savemat(tmp_path / "scan.mat", travel_times())
    convert_dataset(tmp_path / "scan.mat", tmp_path / "scan.h5")
    assert is_upload_format(tmp_path / "scan.h5")
    assert not is_upload_format(tmp_path / "scan.mat")
    assert not is_upload_format(tmp_path)
