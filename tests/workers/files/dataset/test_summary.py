"""The summary of a file equals that of the whole dataset."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.pairs import from_dataset
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.scan import counts_in

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
