"""Amplitudes that jobs read from traces: as in memory, in batches, beside picked and recorded times."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform, pick
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.reconstruction import reconstruction_run, trace_sizes

from ...kernels.acquisition.traces import FREQUENCY_HZ, RATE_HZ, absorbed, blob_delay, scan

ELEMENTS = 16
PLAN = Settings.from_values(method="sart", nodes=24, iterations=1, rays="straight", examine=False)


@pytest.fixture(scope="module")
def lossy():
    """A disc that is slow and absorbs: a neper where it delays by half a microsecond."""
    clean = scan(blob_delay(ELEMENTS), elements=ELEMENTS)
    weak = absorbed(clean.waveform.object, 2e6 * blob_delay(ELEMENTS), RATE_HZ, FREQUENCY_HZ)
    return replace(clean, waveform=Waveform(weak.astype(np.float32), clean.waveform.water))


def test_jobs_read_the_same_amplitudes_as_in_memory(lossy, tmp_path, monkeypatch):
    monkeypatch.setattr(trace_sizes, "TASK_SAMPLES", 30_000)
    plan = PLAN.changed(amplitudes="spectrum")
    picked = replace(pick(lossy), waveform=lossy.waveform)
    expected = reconstruct_here(picked, plan)
    middle = expected.attenuation[12, 12]
    assert middle > 5.0 * expected.attenuation[3:6, 10:14].max()
    for name, dataset in (("traces", lossy), ("times", picked)):
        path = tmp_path / f"{name}.h5"
        write_dataset(path, dataset)
        found = reconstruction_run.reconstruct(None, path, plan)
        np.testing.assert_array_equal(found.attenuation, expected.attenuation)
        np.testing.assert_array_equal(found.speed, expected.speed)
        for settings, reads in ((plan, True), (PLAN, False)):
            summary = counts_in(path).summary(settings)
            assert summary.amplitudes is reads
            # Those of a scan with times are examined.
            assert counts_in(path).summary(settings.changed(examine=True)).traces_bytes > 0
            assert (summary.traces_bytes > 0) is (reads or name == "traces")
    assert reconstruction_run.reconstruct(None, tmp_path / "times.h5", PLAN).attenuation is None


def test_a_scan_without_traces_and_focusing_of_spectra_are_rejected(lossy, tmp_path):
    write_dataset(tmp_path / "scan.h5", pick(lossy))
    with pytest.raises(InvalidInput, match="waveform/object"):
        reconstruction_run.reconstruct(None, tmp_path / "scan.h5", PLAN.changed(amplitudes="ratio"))
    with pytest.raises(InvalidInput, match="focusing"):
        Settings.from_values(method="sart", amplitudes="spectrum", focusing=True)
    with pytest.raises(InvalidInput, match="amplitudes"):
        Settings.from_values(method="sart", amplitudes="height")
