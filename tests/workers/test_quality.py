"""The quality tasks: report and page of a file, the slice with most faults, and a bound on traces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.errors import InvalidInput
from bentray_workers import quality
from bentray_workers.dataset_file import write_dataset

from ..kernels.acquisition.traces import blob_delay, scan


def test_report_and_page_are_of_one_examination(tmp_path):
    write_dataset(tmp_path / "scan.h5", scan(blob_delay(12), elements=12))
    found = quality.examine_file(tmp_path / "scan.h5", "correlation")
    assert found.report == quality.quality_report(tmp_path / "scan.h5", "correlation")
    assert found.page == quality.quality_page(tmp_path / "scan.h5", "correlation")
    assert found.report["picker"] == found.picked.picker == "correlation"


def test_the_page_is_about_the_slice_with_most_findings(tmp_path, drawn):
    one = scan(blob_delay(16), elements=16)
    both = [np.stack([t, t]) for t in (one.waveform.object, one.waveform.water)]
    for traces in both:
        traces[1, :, 3] = 0.0
    write_dataset(
        tmp_path / "scan.h5", replace(one, slice_z_m=np.array([0.0, 0.01]), waveform=Waveform(*both))
    )
    assert quality.quality_page(tmp_path / "scan.h5", "aic").startswith(b"\x89PNG")
    assert "Quality of Scan, slice 1: usable" in drawn.words()


def test_more_traces_than_a_task_may_hold_are_refused_before_they_are_read(tmp_path, monkeypatch):
    write_dataset(tmp_path / "scan.h5", scan(elements=8))
    monkeypatch.setattr(quality, "LARGEST_BYTES", 1000)
    with pytest.raises(InvalidInput, match="bytes of traces; accepted: at most 1000"):
        quality.quality_report(tmp_path / "scan.h5", "aic")
    assert quality.examine_file(tmp_path / "scan.h5").report["pairs"] == 56
