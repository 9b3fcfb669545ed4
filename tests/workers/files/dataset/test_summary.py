"""Header, counts and summary of a file equal those of the whole dataset."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.pairs import from_dataset
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.dataset.scan import counts_in, read_header

from ....kernels.acquisition.traces import FREQUENCY_HZ, scan
from ..datasets import small


@pytest.mark.parametrize("reciprocity", [True, False])
def test_summary_counts_match_the_problem(tmp_path, reciprocity):
    dataset, path = small(), tmp_path / "scan.h5"
    write_dataset(path, dataset)
    asked = Settings.from_values(method="sart", reciprocity=reciprocity)
    summary, pairs = counts_in(path).summary(asked), from_dataset(dataset, asked, 0)
    assert (summary.emitters, summary.receivers) == pairs.delta_tof.shape
    assert (summary.pairs, summary.slices, summary.in_space, summary.height_m) == (12 * 24, 1, False, 0.0)
    assert summary.width_m == pytest.approx(0.2, rel=1e-2)
    # Traces beside times are examined, too.
    traces = dataset.waveform.object.nbytes + dataset.waveform.water.nbytes
    assert (summary.traces_bytes, summary.amplitudes) == (traces, False)


def test_traces_that_must_be_picked_and_heights_count(tmp_path, scan):
    dataset, path = replace(small(), delta_tof_s=None), tmp_path / "traces.h5"
    write_dataset(path, dataset)
    assert counts_in(path).summary(Settings(method="sart")).traces_bytes == 2 * 12 * 24 * 20 * 2
    write_dataset(path, replace(scan, log_ratio_np=np.zeros_like(scan.delta_tof_s)))
    summary = counts_in(path).summary(Settings(method="sart"))
    assert (summary.slices, summary.pairs, summary.height_m) == (3, 3 * 24 * 24, 0.006)
    assert summary.amplitudes


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
