"""The table of engines on an OpenCL device: rows of a comparison, and the reason where there is no device."""

from dataclasses import replace

import pytest
from benchmarks.devices._whole_runs import ITERATIONS, VOLUMES, volume, whole_runs
from benchmarks.devices.devices import rates_of, rows, rows_of

from bentray_kernels.device_engines import Comparison
from bentray_kernels.device_engines.problems import projection, refraction, traces
from bentray_kernels.opencl import Device
from bentray_service.cli.output.benchmark_context import BenchmarkContext

GPU = Device(0, "Fast Platform", "GPU 9000", "gpu", "OpenCL 3.0", "1.2.3", True)


def test_without_a_device_nothing_is_met_and_the_reason_is_given(monkeypatch):
    monkeypatch.setenv("BENTRAY_DEVICE", "cpu")
    found = list(rows(BenchmarkContext(True, lambda *_: None)))
    assert [(row.value, row.met) for row in found] == [(None, False)]
    assert found[0].detail == "BENTRAY_DEVICE=cpu hides every device"


@pytest.mark.opencl
@pytest.mark.parametrize(("kind", "goal"), [("gpu", 1.0), ("cpu", 0.5)])
def test_a_comparison_becomes_two_rows(kind, goal):
    found = Comparison(traces(40, 60, 1), 3.0, 2.0, 1e-6, 0.25)
    speed, difference = rows_of(found, replace(GPU, kind=kind))
    assert (speed.value, speed.goal, speed.met) == (1.5, goal, True)
    rate = f"{found.engine.size / 2.0:.3g} node updates a second"
    assert f"Fast Platform:GPU 9000: 2e+03 ms, {rate}, 0.25 of the bandwidth" in speed.detail
    assert (difference.value, difference.met) == (1e-6, True)
    assert not list(rows_of(found._replace(difference=0.01), GPU))[1].met
    for row in rows_of(Comparison(found.engine), GPU):
        assert (row.value, row.met) == (None, False)
        assert "computes it wrong" in row.detail


@pytest.mark.opencl
def test_times_and_rates_with_goals_of_their_own():
    (time,) = rates_of(Comparison(projection(12, 1), 3e-3, 2e-3, 0.0), GPU)
    assert (time.value, time.unit, time.met) == (2.0, "ms", True)
    (rate,) = rates_of(Comparison(refraction(32), 1.0, 0.01, 0.0), GPU)
    assert (rate.value, rate.goal, rate.met) == (pytest.approx(100.0), 60.0, True)
    assert not list(rates_of(Comparison(projection(12, 2), 3e-3, 2e-3, 0.0), GPU))
    assert not list(rates_of(Comparison(projection(12, 1)), GPU))


def test_large_runs_are_not_made_on_a_processor():
    found = list(whole_runs(BenchmarkContext(False, lambda *_: None), replace(GPU, kind="cpu")))
    assert [row.value for row in found] == [None] * 4
    assert all("--quick" in row.detail for row in found)
    assert f"128² by 40, 256 transducers, {ITERATIONS} iterations" in found[0].target
    assert [(row.goal, row.unit) for row in found] == [(30.9, "s"), (3.0, "s"), (6.0, "s"), (6.0, "s")]
    assert VOLUMES[1][:3] == (256, 44, 512)


@pytest.mark.opencl
@pytest.mark.nightly
def test_a_quick_run_has_a_time_of_every_whole_run(opencl_session):
    found = list(whole_runs(BenchmarkContext(True, lambda *_: None), opencl_session.device))
    assert len(found) == 2
    assert all(row.value > 0.0 for row in found)
    assert "best constant" in found[1].detail


def test_the_slices_of_a_volume_are_of_one_ring():
    dataset = volume(24, 2, 8)
    assert dataset.delta_tof_s.shape == (2, 8, 8)
    assert len(dataset.slice_z_m) == 2
