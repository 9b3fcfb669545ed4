"""A file in a wrong order is refused with the command that corrects a copy; impossible times stay counted."""

import json

import h5py
import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import Correction, correct_dataset, read_dataset, write_dataset
from bentray_workers.files.dataset.copy import copy_dataset
from bentray_workers.files.dataset.counts import record_of
from bentray_workers.reconstruction.scan_views import scan_geometry

from ....kernels.acquisition.test_arrangement import kind_of, on_ring, scan


def test_a_file_in_a_wrong_order_is_refused_proposed_and_corrected(tmp_path):
    right = kind_of(scan(on_ring(32)), "absolute")
    path, copy = tmp_path / "scan.h5", tmp_path / "copy.h5"
    write_dataset(path, right)
    with h5py.File(path, "a") as file:
        file["traveltime/tof_s"][...] = np.roll(right.tof_s, 1, axis=1)
    with pytest.raises(InvalidInput, match=r"--arrangement receivers-shifted-by-1$"):
        read_dataset(path)
    (proposal,) = scan_geometry(path)["proposed_corrections"]
    assert (proposal["what"], proposal["arrangement"]) == ("arrangement", "receivers-shifted-by-1")
    made = correct_dataset(path, copy, Correction(arrangement=proposal["arrangement"]))
    assert "receivers shifted by 1 before" in made.source
    again = read_dataset(copy)
    np.testing.assert_array_equal(again.rx, np.roll(np.arange(32), 1))
    # Times of elements to themselves looked like failed picks before.
    assert again.impossible_times == {}
    with pytest.raises(InvalidInput, match="arrangement"):
        correct_dataset(path, copy, Correction(arrangement="receivers-inside-out"))


def test_impossible_times_of_a_file_are_counted_wherever_it_goes(tmp_path):
    right = kind_of(scan(on_ring(32)), "absolute")
    path, copy, again = (tmp_path / f"{name}.h5" for name in ("scan", "copy", "again"))
    write_dataset(path, right)
    with h5py.File(path, "a") as file:
        file["traveltime/tof_s"][3, 5:9] = 0.0
        file["traveltime/tof_s"][4, 9] = -9999.0
    stored = copy_dataset(path, copy)
    assert stored.impossible_times == {"zero or negative": 5}
    assert record_of(stored)["source"].startswith("impossible times left out: 5 zero or negative")
    assert copy_dataset(copy, again).impossible_times == {"zero or negative": 5}
    assert scan_geometry(again)["impossible_times"] == {"zero or negative": 5}
    with h5py.File(copy, "a") as file:
        assert json.loads(file["traveltime"].attrs["impossible_times"]) == {"zero or negative": 5}
        file["traveltime"].attrs["impossible_times"] = "[1"
    with pytest.raises(InvalidInput, match="traveltime@impossible_times"):
        read_dataset(copy)
