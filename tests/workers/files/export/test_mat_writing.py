"""MATLAB files: contents, and identical bytes on every write."""

import numpy as np
import pytest
from scipy.io import loadmat

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export import mat_writing
from bentray_workers.files.export.mat_writing import write_mat

ARRAYS = {
    "speed_mps": np.arange(24.0).reshape(2, 3, 4),
    "spacing_m": np.array([1.0, 2.0, 3.0]),
    "axes": "x,y,z",
}


def test_arrays_come_back_by_name(tmp_path):
    write_mat(tmp_path / "v.mat", ARRAYS)
    found = loadmat(tmp_path / "v.mat")
    np.testing.assert_array_equal(found["speed_mps"], ARRAYS["speed_mps"])
    np.testing.assert_array_equal(found["spacing_m"], [[1.0, 2.0, 3.0]])
    assert found["axes"].item() == "x,y,z"


def test_the_same_arrays_give_the_same_bytes(tmp_path, monkeypatch):
    write_mat(tmp_path / "once.mat", ARRAYS)
    monkeypatch.setattr("time.asctime", lambda *when: "another time")
    write_mat(tmp_path / "twice.mat", ARRAYS)
    assert (tmp_path / "once.mat").read_bytes() == (tmp_path / "twice.mat").read_bytes()


def test_rejects_arrays_too_large_for_the_version(tmp_path, monkeypatch):
    monkeypatch.setattr(mat_writing, "LARGEST_BYTES", 191)
    with pytest.raises(InvalidInput, match="speed_mps of 192 bytes"):
        write_mat(tmp_path / "v.mat", ARRAYS)
    assert not list(tmp_path.iterdir())
