"""The ingest process: its verdict on a file."""

import errno
import subprocess
import sys

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_service.ingest import ingest_process
from bentray_workers.files.dataset.counts import LONGEST_TEXT

from ..rows.conftest import SUMMARY


def test_summary_of_a_good_file(scan, tmp_path):
    answer = ingest_process.convert_upload("dataset", scan(), tmp_path / "out.h5", {})
    counts = answer["ok"].pop("counts")
    assert (counts["emissions"], counts["elements"], counts["width_m"]) == (16, 16, 0.1)
    sixteen = {"title": "Sixteen elements", **dict.fromkeys(("elements", "ntx", "nrx"), 16)}
    assert answer["ok"] == {**SUMMARY, **sixteen}
    assert h5py.is_hdf5(tmp_path / "out.h5")


def test_the_canonical_file_says_the_same(scan, tmp_path):
    first = ingest_process.convert_upload("dataset", scan(), tmp_path / "once.h5", {})
    assert ingest_process.convert_upload("dataset", tmp_path / "once.h5", tmp_path / "twice.h5", {}) == first


@pytest.mark.parametrize("error", [RuntimeError("odd"), MemoryError()])
def test_a_reader_that_breaks_is_the_fault_of_the_file(scan, tmp_path, monkeypatch, error):
    def broken(source, target, on_size, given):
        raise error

    monkeypatch.setattr("bentray_workers.foreign_scans.convert_dataset", broken)
    answer = ingest_process.convert_upload("dataset", scan(), tmp_path / "out.h5", {})
    assert answer["error"]["field"] == "file"


def test_a_full_disk_is_no_fault_of_the_file(scan, tmp_path, monkeypatch):
    def full(source, target, on_size, given):
        raise OSError(errno.ENOSPC, "No space left on device", str(target))

    monkeypatch.setattr("bentray_workers.foreign_scans.convert_dataset", full)
    assert ingest_process.convert_upload("dataset", scan(), tmp_path / "out.h5", {}) == {"full": True}


def test_a_volume(tmp_path):
    np.save(tmp_path / "v.npy", np.arange(60.0).reshape(3, 4, 5))
    given = {"title": "A head", "spacing_m": [2e-3], "shape": None, "dtype": None}
    answer = ingest_process.convert_upload("volume", tmp_path / "v.npy", tmp_path / "out.h5", given)
    assert answer["ok"] == {
        "title": "A head",
        "shape": [3, 4, 5],
        "spacing_m": [2e-3] * 3,
        "origin_m": [0.0] * 3,
        "value_range": [0.0, 59.0],
    }
    again = ingest_process.convert_upload("volume", tmp_path / "out.h5", tmp_path / "again.h5", {})
    assert again == answer


@given(st.text())
def test_text_from_a_file_is_printable_and_short(value):
    clean = ingest_process.text(value)
    assert len(clean) <= LONGEST_TEXT
    assert clean.isprintable()
    clean.encode()


def test_reading_a_scan_loads_no_compiled_kernels(scan, tmp_path):
    """Each upload starts a process: they would take most of its time, and have no place to be kept."""
    program = (
        "import importlib, sys; from pathlib import Path\n"
        "from bentray_service.ingest.ingest_process import READERS, convert_upload\n"
        "found = convert_upload('dataset', Path(sys.argv[1]), Path(sys.argv[2]), {})\n"
        "importlib.import_module(READERS['volume'])\n"
        "print(sorted(found), sorted({'numba', 'scipy', 'distributed'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", program, str(scan()), str(tmp_path / "canonical.h5")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "['ok'] []\n"
