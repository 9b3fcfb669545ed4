"""Reading scans without a centre frequency."""

from dataclasses import replace

import pytest

from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.dataset.scan import counts_in, read_header

from ....kernels.acquisition.traces import FREQUENCY_HZ, scan


@pytest.mark.parametrize("stacked", [False, True])
def test_a_missing_centre_frequency_is_estimated_from_the_traces(tmp_path, stacked):
    whole = replace(scan(), center_frequency_hz=None)
    if stacked:
        traces = whole.waveform
        slices = replace(traces, object=traces.object[None], water=traces.water[None])
        whole = replace(whole, waveform=slices, slice_z_m=whole.element_position_m[:1, 0])
    write_dataset(tmp_path / "scan.h5", whole)
    result = read_header(tmp_path / "scan.h5").dataset
    assert result.waveform is None
    assert result.center_frequency_hz == pytest.approx(FREQUENCY_HZ, rel=0.1)
    assert counts_in(tmp_path / "scan.h5").frequency_hz == result.center_frequency_hz
    assert counts_in(tmp_path / "scan.h5").summary(Settings(method="waveform")).traces is not None


def test_a_frequency_of_the_file_is_kept(tmp_path):
    write_dataset(tmp_path / "scan.h5", scan())
    header = read_header(tmp_path / "scan.h5")
    assert header.dataset.center_frequency_hz == FREQUENCY_HZ
    assert header.spectrum is None


def test_whether_the_water_is_assumed_survives_the_file(tmp_path):
    for assumed in (False, True):
        write_dataset(tmp_path / "scan.h5", replace(scan(), water_temperature_assumed=assumed))
        assert read_dataset(tmp_path / "scan.h5").water_temperature_assumed is assumed
