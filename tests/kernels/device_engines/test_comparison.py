"""The comparison of engines on a device with compiled code: right, wrong, and as shares of bandwidth."""

from dataclasses import replace

import pytest

from bentray_kernels.device_engines.comparison import compare, copy_bytes_per_s, measured
from bentray_kernels.device_engines.problems import (
    ENGINES_COMPARED,
    benchmark_problems,
    engines,
    field,
    gradients,
    projection,
    refraction,
    sart,
    traces,
    traces_in_space,
)
from bentray_kernels.opencl import device_selection
from bentray_kernels.opencl.device_benchmark import ENGINES

pytestmark = pytest.mark.opencl


@pytest.mark.parametrize(
    "engine",
    [
        lambda: projection(12, 2),
        lambda: traces(40, 60, 2),
        lambda: traces_in_space(12, 32),
        lambda: gradients(40, 60, 2),
        lambda: sart(32, 2),
        pytest.param(lambda: refraction(32), marks=pytest.mark.slow),
        pytest.param(lambda: field(32), marks=pytest.mark.slow),
    ],
    ids=["eikonal", "traces", "space", "wave", "sart", "refraction", "field"],
)
def test_the_device_agrees_with_compiled_code_within_the_bound(engine):
    errors = measured(engine(), 1e9, 1)
    assert errors.compiled_s > 0.0
    assert errors.device_s > 0.0
    assert 0.0 <= errors.difference <= errors.engine.bound
    assert errors.right
    bounded = errors.engine.least_bytes is not None
    assert (errors.bandwidth_share is not None) is bounded
    if bounded:
        assert errors.bandwidth_share == pytest.approx(errors.engine.least_bytes / errors.device_s / 1e9)


def test_a_wrong_result_is_seen():
    engine = traces(40, 60, 1)
    there = engine.there
    comparison = measured(replace(engine, there=lambda: 1.01 * there()), None, 1)
    assert comparison.difference == pytest.approx(0.01, rel=0.01)
    assert not comparison.right
    assert comparison.bandwidth_share is None
    unable = measured(replace(engine, there=None), 1e9, 1)
    assert (unable.device_s, unable.difference, unable.right) == (None, None, False)


def test_a_copy_measures_the_bandwidth(opencl_session):
    assert 1e6 < copy_bytes_per_s(opencl_session) < 1e14


def test_every_engine_of_the_trial_has_a_small_and_a_large_problem():
    for name in ("eikonal", "wave"):
        small, large = benchmark_problems(name)
        assert small.engine == large.engine == name
        assert small.size < large.size
    assert set(ENGINES) == {"eikonal", "wave", "sart", "reflection", "refraction", "field"}


def test_without_a_device_there_is_nothing_to_compare(monkeypatch):
    monkeypatch.setattr(device_selection, "_found", lambda *_: "this machine has no OpenCL device")
    device_selection._warn_once.cache_clear()
    with pytest.warns(device_selection.OpenCLFallbackWarning):
        assert list(compare(True)) == []
    device_selection._warn_once.cache_clear()


def test_the_number_of_engines_is_known_before_they_are_built():
    assert sum(1 for _ in engines(quick=True)) == ENGINES_COMPARED
