"""The table of engines on an OpenCL device: measured on one, and with the reason where there is none."""

import pytest
from benchmarks.devices._engines import gradients, projection, traces
from benchmarks.devices.devices import copied_bytes_per_s, measured, rows

from bentray_kernels.opencl import choice, choose
from bentray_service.cli.output.benchmark_context import BenchmarkContext


def test_without_a_device_nothing_is_met_and_the_reason_is_given(monkeypatch):
    monkeypatch.setattr(choice, "find_devices", list)
    choice._found.cache_clear()
    choice._warn_once.cache_clear()
    try:
        found = list(rows(BenchmarkContext(True, lambda *_: None)))
    finally:
        choice._found.cache_clear()
        choice._warn_once.cache_clear()
    assert [(row.value, row.met) for row in found] == [(None, False)]
    assert "no OpenCL device" in found[0].detail


@pytest.mark.opencl
@pytest.mark.parametrize(
    "engine", [projection(12, 2), traces(40, 60, 2), gradients(40, 60, 2)], ids=lambda engine: engine.name
)
def test_an_engine_is_compared_with_compiled_code(engine):
    device = choose().device
    assert device is not None
    speed, difference = measured(engine, device, 1e9, 1)
    assert speed.value > 0.0
    assert device.label in speed.detail
    assert 0.0 <= difference.value <= difference.goal
    assert difference.met


@pytest.mark.opencl
def test_the_rate_of_a_copy_is_the_base_of_the_shares():
    assert 1e6 < copied_bytes_per_s(choose().device, 2**20) < 1e14


@pytest.mark.opencl
def test_a_wrong_result_is_not_met():
    engine = traces(40, 60, 1)
    there = engine.there
    wrong = type(engine)(**{**vars(engine), "there": lambda: 1.01 * there()})
    _, difference = measured(wrong, choose().device, 1e9, 1)
    assert difference.value == pytest.approx(0.01, rel=0.01)
    assert not difference.met
