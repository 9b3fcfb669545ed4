"""Examination and picking of jobs: what `examine` and `pick` give at once, from a file, a batch a call."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bentray_kernels.acquisition import PICKERS, Waveform, pick
from bentray_kernels.acquisition.quality import examine
from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Cancelled, ThreadPool, run
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_kernels.tomography.waveform.band_inversion import Model
from bentray_kernels.tomography.waveform.refinement_graph import evaluate_emitter
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.wave import time_blocks
from bentray_workers.cluster.job_cancellation import JobEnded
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.picking_files import ScanFindings, read_findings, write_findings
from bentray_workers.reconstruction import reconstruction_run, trace_sizes
from bentray_workers.reconstruction.file_scan import FileSource
from bentray_workers.reconstruction.picking_graph import (
    PICKED,
    PickingFiles,
    PickingGraph,
    PickingSource,
    measure_traces,
    pick_emissions,
)
from bentray_workers.reconstruction.quality_report import examine_file

from ...kernels.acquisition.traces import RATE_HZ, blob_delay, scan
from ...kernels.tomography.waveform.scans import SETTINGS
from ...kernels.tomography.waveform.scans import scan as wave_scan

ELEMENTS = 16


PLAN = Settings(method="sart", nodes=24, iterations=1)


@cache
def clean():
    return scan(blob_delay(ELEMENTS), elements=ELEMENTS, noise=0.01)


def disordered(traces):
    """Element 3 receives upside down, 5 and 9 are swapped."""
    traces = traces.copy()
    traces[:, 3] *= -1.0
    traces[:, [5, 9]] = traces[:, [9, 5]]
    return traces


def damaged(traces):
    """The same, 12 is dead, and one trace holds a NaN."""
    traces = disordered(traces)
    traces[:, 12] = 0.0
    traces[12] = 0.0
    traces[0, 8, 40] = np.nan
    return traces


def spoilt(dataset, by):
    return replace(dataset, waveform=Waveform(by(dataset.waveform.object), by(dataset.waveform.water)))


def stacked(*datasets):
    both = [np.stack([getattr(one.waveform, name) for one in datasets]) for name in ("object", "water")]
    heights = 0.01 * np.arange(len(datasets))
    return replace(datasets[0], slice_z_m=heights, waveform=Waveform(*both))


def arrived(dataset, folder, picker="aic", *, examined=True):
    """What goes on of a dataset in a file, and what was found."""
    path = folder / "scan.h5"
    write_dataset(path, dataset)
    files = PickingFiles.in_folder(folder)
    settings = Settings.from_values(method="sart", picker=picker, examine=examined)
    graph = PickingGraph(PickingSource(path, path.stat().st_mtime_ns, folder, settings), files)
    run({"picking": graph}, ThreadPool())
    found = read_findings(files.findings)
    return read_dataset(files.picked if found.changed else path), found


def assert_same(one, other):
    np.testing.assert_array_equal(one.differential_tof(), other.differential_tof())
    known = np.isfinite(one.differential_tof())
    np.testing.assert_array_equal(one.sigma_s[known], other.sigma_s[known])
    assert (one.picker, one.t0_s) == (other.picker, other.t0_s)
    assert one.waveform is other.waveform is None


@pytest.mark.parametrize("samples", [30_000, 10**9])
@pytest.mark.parametrize("picker", PICKERS)
def test_batches_equal_the_whole(tmp_path, monkeypatch, picker, samples):
    monkeypatch.setattr(trace_sizes, "TASK_SAMPLES", samples)
    assert_same(arrived(clean(), tmp_path, picker, examined=False)[0], pick(clean(), picker))


@pytest.mark.parametrize("whole", [True, False])
def test_faults_are_found_and_corrected_as_in_one_piece(tmp_path, monkeypatch, whole):
    monkeypatch.setattr(trace_sizes, "TASK_SAMPLES", 10**9 if whole else 30_000)
    both = stacked(clean(), spoilt(clean(), damaged))
    expected = examine(both)
    picked, found = arrived(both, tmp_path)
    assert_same(picked, expected.picked)
    np.testing.assert_array_equal(picked.valid, expected.picked.valid)
    assert [f.to_dict() for f in found.findings] == [f.to_dict() for f in expected.report.findings]
    told = found.words(stacked=True)
    for words in (
        "slice 1: polarity: 1 inverted in reception (3), corrected",
        "slice 1: swapped channels: elements 5 and 9 fit each other's places in reception (5, 9), corrected",
        "slice 1: dead elements: 1 without a pulse in reception (12), left out",
        "slice 1: values: water: 1 traces with samples that are not finite, left out",
    ):
        assert words in told
    assert "slice 0" not in told


def test_a_clean_scan_gives_the_image_that_it_gave_unexamined(tmp_path):
    write_dataset(tmp_path / "scan.h5", clean())
    expected = reconstruct_here(pick(clean()), PLAN)
    result = reconstruction_run.reconstruct(None, tmp_path / "scan.h5", PLAN)
    np.testing.assert_array_equal(result.speed, expected.speed)
    used = int(np.isfinite(pick(clean()).delta_tof_s).sum())
    pairs = f"{used} of {ELEMENTS * (ELEMENTS - 1)} pairs used"
    found = {"quality": "nothing found", "pairs": f"{pairs}, 0 left out"}
    assert result.provenance == {**expected.provenance, **found}
    plain = reconstruction_run.reconstruct(None, tmp_path / "scan.h5", PLAN.changed(examine=False))
    np.testing.assert_array_equal(plain.speed, expected.speed)
    assert plain.provenance == {**expected.provenance, "pairs": f"{pairs}, not examined"}


def test_progress_counts_examined_and_picked_emissions(tmp_path, monkeypatch):
    monkeypatch.setattr(trace_sizes, "TASK_SAMPLES", 50_000)
    write_dataset(tmp_path / "scan.h5", clean())
    told = []
    reconstruction_run.reconstruct(None, tmp_path / "scan.h5", PLAN, told.append)
    steps = {
        phase: [p.done for p in told if p.phase == phase] for phase in dict.fromkeys(p.phase for p in told)
    }
    assert list(steps) == ["examining", "picking", "reconstructing"]
    assert {p.total for p in told if p.phase != "reconstructing"} == {ELEMENTS}
    assert steps["examining"][0] == steps["picking"][0] == 0
    assert steps["picking"][-1] == ELEMENTS
    assert all(len(set(steps[phase])) > 3 for phase in ("examining", "picking"))
    assert all(done == sorted(done) for done in steps.values())


def test_calls_end_with_their_emission_once_the_job_has(tmp_path):
    path, folder = tmp_path / "scan.h5", tmp_path / "job"
    write_dataset(path, clean())
    folder.mkdir()
    source = PickingSource(
        path, path.stat().st_mtime_ns, folder, Settings.from_values(method="sart", picker="aic")
    )
    with source.slice(0) as one:
        assert one.waveform.object[0].any()
        folder.rmdir()
        with pytest.raises(JobEnded):
            one.waveform.object[1]
    for function, arguments in ((measure_traces, (range(4),)), (pick_emissions, ((), range(4)))):
        with pytest.raises(JobEnded):
            function(source, 0, *arguments)


def test_channels_put_back_give_the_image_of_the_clean_scan(tmp_path):
    path = tmp_path / "scan.h5"
    write_dataset(path, spoilt(clean(), disordered))
    right = reconstruct_here(pick(clean()), PLAN).speed
    result = reconstruction_run.reconstruct(None, path, PLAN)
    np.testing.assert_array_equal(result.speed, right)
    assert "swapped channels" in result.provenance["quality"]
    taken = reconstruction_run.reconstruct(None, path, PLAN.changed(examine=False))
    assert not np.array_equal(taken.speed, right)
    assert "quality" not in taken.provenance


def test_a_scan_that_must_not_be_used_is_rejected(tmp_path):
    write_dataset(tmp_path / "scan.h5", replace(clean(), sampling_rate_hz=1.2 * RATE_HZ))
    with pytest.raises(InvalidInput, match=r"sampling rate: found arrivals in water at .* examine false"):
        reconstruction_run.reconstruct(None, tmp_path / "scan.h5", PLAN)


def planted(pair, seconds, **changes):
    delta = blob_delay(ELEMENTS).copy()
    delta[pair] += seconds
    return replace(clean(), delta_tof_s=delta, sigma_s=None, **changes)


def silent(dataset):
    """The scan whose element 5 records nothing, beside its times."""
    traces = [data.copy() for data in (dataset.waveform.object, dataset.waveform.water)]
    for data in traces:
        data[:, 5] = 0.0
    return replace(dataset, waveform=Waveform(*traces))


TIMES = {"waveform": None}


@pytest.mark.parametrize(
    ("dataset", "check"),
    [
        (planted((2, 9), 3e-6, **TIMES), "cycle jumps"),
        (planted((2, 9), 3e-6, center_frequency_hz=None, **TIMES), "outliers"),
        (planted((2, 9), 3e-6, center_frequency_hz=None), "outliers"),
        (planted((2, 9), -2e-5, center_frequency_hz=None, **TIMES), "apparent speed"),
        (planted((2, 9), 3e-6), "cycle jumps"),
        (silent(planted((2, 9), 3e-6)), "dead elements"),
        (planted((2, 9), 0.0, center_frequency_hz=None, **TIMES), None),
        (planted((2, 9), 0.0), None),
        (clean(), None),
        (spoilt(clean(), damaged), "polarity"),
    ],
)
def test_a_reconstruction_leaves_out_what_the_quality_report_says(tmp_path, dataset, check):
    """Times of the file or picked, with and without a frequency and traces: pair for pair, in one count."""
    picked, found = arrived(dataset, tmp_path)
    quality = examine_file(tmp_path / "scan.h5", draw=False)
    report = quality.examined
    # An estimated frequency is stated elsewhere in a result.
    findings = [finding for finding in report.findings if finding.check != "centre frequency"]
    assert [f.to_dict() for f in found.findings] == [f.to_dict() for f in findings]
    for mine, theirs in zip(found.findings, findings, strict=True):
        np.testing.assert_array_equal(mine.pairs, theirs.pairs)
    assert (found.pairs, found.usable) == (report.pairs, report.usable)
    assert found.pairs_used.startswith(f"{report.usable:,} of {report.pairs:,} pairs used, ")
    np.testing.assert_array_equal(picked.differential_tof(), quality.picked.differential_tof())
    assert (tmp_path / PICKED).exists() is (check is not None or not dataset.picked)
    assert check is None or check in {finding.check for finding in found.findings}
    assert found.left_out == (0 if check is None else report_left_out(dataset, report))


def report_left_out(dataset, report):
    out = np.zeros((ELEMENTS, ELEMENTS), dtype=bool)
    for finding in report.findings:
        if finding.action == "left out" and finding.pairs is not None:
            out |= finding.pairs
    known = np.isfinite(dataset.differential_tof()) if dataset.picked else ~np.eye(ELEMENTS, dtype=bool)
    return int((out & known).sum())


def test_without_a_water_shot_the_times_are_nearly_the_same(tmp_path):
    bare = replace(clean(), waveform=Waveform(clean().waveform.object))
    (tmp_path / "with").mkdir()
    (tmp_path / "without").mkdir()
    expected, _ = arrived(clean(), tmp_path / "with")
    picked, findings = arrived(bare, tmp_path / "without")
    assert "water shot" in {finding.check for finding in findings.findings}
    both = np.isfinite(expected.delta_tof_s) & np.isfinite(picked.delta_tof_s)
    assert both.sum() > 0.9 * np.isfinite(expected.delta_tof_s).sum()
    assert np.std((picked.delta_tof_s - expected.delta_tof_s)[both]) < 0.03 / clean().center_frequency_hz


def test_picked_times_survive_a_kill(tmp_path, monkeypatch):
    write_dataset(tmp_path / "scan.h5", spoilt(clean(), damaged))
    expected = reconstruction_run.reconstruct(None, tmp_path / "scan.h5", PLAN, work_dir=tmp_path / "work")
    monkeypatch.setattr(reconstruction_run, "PickingGraph", None)
    again = reconstruction_run.reconstruct(None, tmp_path / "scan.h5", PLAN, work_dir=tmp_path / "work")
    np.testing.assert_array_equal(again.speed, expected.speed)
    assert again.provenance == expected.provenance


def test_waves_are_refined_from_channels_put_back(tmp_path, monkeypatch):
    """As far as the problem of the first band; from there on only that counts."""
    problems = []

    def begun(source, chosen, run_graphs, graph_of):
        problems.append(WaveScan(source, SETTINGS).problem(0))
        raise Cancelled

    monkeypatch.setattr(reconstruction_run, "run_reconstruction", begun)
    for name, by in (("clean.h5", np.array), ("wrong.h5", disordered)):
        write_dataset(tmp_path / name, spoilt(wave_scan(), by))
        with pytest.raises(Cancelled):
            reconstruction_run.reconstruct(None, tmp_path / name, replace(PLAN, method="waveform"))
    clean_one, put_right = problems
    np.testing.assert_array_equal(put_right.wavelet, clean_one.wavelet)
    np.testing.assert_array_equal(put_right.weight, clean_one.weight)
    assert set(put_right.traces) == set(clean_one.traces)
    for emitter, traces in clean_one.traces.items():
        np.testing.assert_array_equal(put_right.traces[emitter], traces)


def test_wave_comparison_stops_with_its_job(tmp_path, monkeypatch):
    path, folder = tmp_path / "scan.h5", tmp_path / "job"
    write_dataset(path, wave_scan())
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
