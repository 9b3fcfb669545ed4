"""MATLAB files: contents, and identical bytes on every write."""

import numpy as np
import pytest
from scipy.io import loadmat

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export import mat_writing
from bentray_workers.files.export.content import Content
from bentray_workers.files.volume_axes import Grid

SPEED = np.arange(24.0).reshape(2, 3, 4)
CONTENT = Content(SPEED, Grid((1.0, 2.0, 3.0), (0.0,) * 3), "a title", {"speed_mps": SPEED})


def test_arrays_come_back_by_name(tmp_path):
    mat_writing.write(tmp_path / "v.mat", CONTENT)
    arrays = loadmat(tmp_path / "v.mat")
    np.testing.assert_array_equal(arrays["speed_mps"], SPEED)
    np.testing.assert_array_equal(arrays["spacing_m"], [[1.0, 2.0, 3.0]])
    assert (arrays["axes"].item(), arrays["title"].item()) == ("x,y,z", "a title")


def test_the_same_arrays_give_the_same_bytes(tmp_path, monkeypatch):
    mat_writing.write(tmp_path / "once.mat", CONTENT)
    monkeypatch.setattr("time.asctime", lambda *when: "another time")
    mat_writing.write(tmp_path / "twice.mat", CONTENT)
    assert (tmp_path / "once.mat").read_bytes() == (tmp_path / "twice.mat").read_bytes()


def test_rejects_arrays_too_large_for_the_version(tmp_path, monkeypatch):
    monkeypatch.setattr(mat_writing, "LARGEST_BYTES", 191)
    with pytest.raises(InvalidInput, match="speed_mps of 192 bytes"):
        mat_writing.write(tmp_path / "v.mat", CONTENT)
    assert not list(tmp_path.iterdir())
