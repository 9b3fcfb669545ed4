"""Scans read by tasks: a wave comparison ends when its job has been deleted."""

import pytest

from bentray_kernels.tomography.waveform.band_inversion import Model
from bentray_kernels.tomography.waveform.refinement_graph import evaluate_emitter
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.wave import time_blocks
from bentray_workers.cluster.job_cancellation import JobEnded
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.picking_files import ScanFindings, write_findings
from bentray_workers.reconstruction.file_scan import FileSource

from ...kernels.tomography.waveform.scans import SETTINGS, scan


def test_wave_comparison_stops_with_its_job(tmp_path, monkeypatch):
    path, folder = tmp_path / "scan.h5", tmp_path / "job"
    write_dataset(path, scan())
    folder.mkdir()
    write_findings(folder / "findings.json", ScanFindings((), examined=True, changed=False))
    stamp = path.stat().st_mtime_ns
    waves = WaveScan(FileSource(path, stamp, path, stamp, folder / "findings.json"), SETTINGS)
    problem = waves.problem(0)
    water = Model(problem.water.speed + 0.0 * problem.region)
    assert evaluate_emitter(waves, 0, water, 0).misfit > 0.0
    monkeypatch.setattr(time_blocks, "BLOCK", 10**5)
    folder.rename(tmp_path / "job.ended")
    with pytest.raises(JobEnded):
        evaluate_emitter(waves, 0, water, 0)
