"""The quality tasks: report and page of a file, the slice with most faults, and a bound on traces."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.acquisition.calibration import calibrate, water_times
from bentray_kernels.acquisition.emissions import Emissions
from bentray_kernels.acquisition.quality import examine
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import read, write_dataset
from bentray_workers.reconstruction import quality_report as quality

from ...kernels.acquisition.traces import blob_delay, scan


def test_report_and_page_are_of_one_examination(tmp_path):
    write_dataset(tmp_path / "scan.h5", scan(blob_delay(12), elements=12))
    result = quality.examine_file(tmp_path / "scan.h5", "correlation")
    assert result.report == quality.quality_report(tmp_path / "scan.h5", "correlation")
    assert result.page == quality.quality_page(tmp_path / "scan.h5", "correlation")
    assert result.report["picker"] == result.picked.picker == "correlation"


def test_the_page_is_about_the_slice_with_most_findings(tmp_path, undrawn):
    dataset = scan(blob_delay(16), elements=16)
    both = [np.stack([t, t]) for t in (dataset.waveform.object, dataset.waveform.water)]
    for traces in both:
        traces[1, :, 3] = 0.0
    write_dataset(
        tmp_path / "scan.h5", replace(dataset, slice_z_m=np.array([0.0, 0.01]), waveform=Waveform(*both))
    )
    assert quality.quality_page(tmp_path / "scan.h5", "aic").startswith(b"\x89PNG")
    assert "Quality of Scan, slice 1: usable" in undrawn.words()


def test_one_emission_is_in_memory_and_all_are_counted(tmp_path, monkeypatch):
    one = scan(blob_delay(12), elements=12)
    both = [np.stack([t, t]) for t in (one.waveform.object, one.waveform.water)]
    both[0][1, :, 3] = both[1][1, :, 3] = 0.0
    several = replace(one, slice_z_m=np.array([0.0, 0.01]), waveform=Waveform(*both))
    write_dataset(tmp_path / "scan.h5", several)

    def all_at_once(*_, **__):
        raise AssertionError("the traces of more than one emission were asked for")

    monkeypatch.setattr(Emissions, "__array__", all_at_once)
    monkeypatch.setattr(read, "_traces", all_at_once)
    told = []
    computed, fitted = quality.calibrate_file(
        tmp_path / "scan.h5", "aic", lambda *step: told.append(step), fit_speed=False
    )
    expected = examine(several)
    assert computed.report == expected.report.to_dict()
    np.testing.assert_array_equal(computed.picked.delta_tof_s, expected.picked.delta_tof_s)
    np.testing.assert_array_equal(fitted.emission_delay_s, calibrate(one, water_times(one)).emission_delay_s)
    # Of two slices: object, water, and the times picked from both.
    assert told == [(k, 72) for k in range(1, 73)]


def test_more_traces_than_a_task_may_hold_are_rejected_before_they_are_read(tmp_path, monkeypatch):
    write_dataset(tmp_path / "scan.h5", scan(elements=8))
    monkeypatch.setattr(quality, "LARGEST_BYTES", 1000)
    with pytest.raises(InvalidInput, match="bytes of traces; accepted: at most 1000"):
        quality.quality_report(tmp_path / "scan.h5", "aic")
    assert quality.examine_file(tmp_path / "scan.h5").report["pairs"] == 56
