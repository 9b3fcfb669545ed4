"""The table of engines on an OpenCL device: rows of a comparison, and the reason where there is no device."""

from dataclasses import replace

import pytest
from benchmarks.devices.devices import rows, rows_of

from bentray_kernels.device_engines import Comparison
from bentray_kernels.device_engines.problems import traces
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
