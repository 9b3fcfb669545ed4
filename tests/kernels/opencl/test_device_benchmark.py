"""The benchmark of a device: what it times, which engine it prefers for a size, and its cache."""

from dataclasses import replace

import pytest

from bentray_kernels.opencl import device_benchmark
from bentray_kernels.opencl.device_benchmark import (
    ENGINES,
    DeviceBenchmark,
    Timing,
    benchmark_engine,
    benchmark_of,
    examine,
    stored_benchmark,
)

# The device needs 1 s to start and a fifth of the time for each unit.
SLOW_START = (Timing(10.0, 0.1, 1.02), Timing(1000.0, 10.0, 3.0))


def child_of(fault="", ending="ended with exit code 0"):
    """A child process of a device; with a fault of its own, or that ends before it answers."""
    calls = []

    def child(device, engine, time_out_s):
        calls.append((engine, time_out_s))
        timings = [] if fault else [list(row) for row in SLOW_START]
        answers = [{"driver": "a remark"}, {"engine": engine, "fault": fault, "timings": timings}]
        return answers if ending == "ended with exit code 0" else [], ending

    child.calls = calls
    return child


@pytest.mark.parametrize(("size", "faster"), [(1.0, False), (100.0, False), (126.0, True), (1e6, True)])
def test_the_faster_engine_depends_on_the_size(size, faster):
    assert DeviceBenchmark(SLOW_START).faster(size) is faster


def test_an_engine_that_was_not_tried_or_is_wrong_is_not_preferred():
    assert not DeviceBenchmark().faster(1e9)
    assert not DeviceBenchmark((), "wrong", 1).faster(1e9)


def test_times_never_become_negative_or_shrink_with_the_size():
    noisy = (Timing(10.0, 1.0, 0.5), Timing(100.0, 0.4, 0.6))
    assert DeviceBenchmark(noisy).faster(1.0)
    assert not DeviceBenchmark(noisy).faster(1e6)


@pytest.mark.parametrize(
    ("child", "fault"),
    [
        (child_of("differs by 0.1"), "differs by 0.1"),
        (child_of(ending="ended by signal 6"), "ended by signal 6"),
        (child_of(ending="no answer in 7 s"), "no answer in 7 s"),
    ],
)
def test_wrong_results_and_a_process_that_ends_are_faults(gpu, fresh, child, fault):
    assert examine(gpu, "wave", child, 7.0) == DeviceBenchmark((), fault, 1)
    assert child.calls == [("wave", 7.0)]


def test_a_trial_is_remembered_until_the_driver_or_the_sources_change(gpu, monkeypatch, fresh):
    child = child_of()
    monkeypatch.setattr(device_benchmark, "in_a_child", child)
    first = benchmark_of(gpu, "field")
    assert benchmark_of(gpu, "field") == first == stored_benchmark(gpu, "field")
    assert len(child.calls) == 1
    assert stored_benchmark(gpu, "wave") is None, "each engine has its own"
    benchmark_of(replace(gpu, driver="1.2.4"), "field")
    assert len(child.calls) == 2
    monkeypatch.setattr(device_benchmark, "digest", lambda module: "of another version")
    benchmark_of(gpu, "field")
    assert len(child.calls) == 3


@pytest.mark.parametrize(
    "content",
    ["", "[]", "{}", '{"timings": [], "fault": "", "attempts": 0}', '{"timings": 1, "fault": 1}', "null"],
)
def test_a_damaged_cache_is_ignored_and_rebuilt(gpu, monkeypatch, fresh, content):
    monkeypatch.setattr(device_benchmark, "in_a_child", child_of())
    whole = benchmark_of(gpu, "field")
    (file,) = fresh.iterdir()
    for damaged in (content, "\x00\xff"):
        file.write_text(damaged, encoding="latin-1")
        assert stored_benchmark(gpu, "field") is None
    assert benchmark_of(gpu, "field") == whole == stored_benchmark(gpu, "field")


def test_times_that_no_clock_gives_are_ignored(gpu, monkeypatch, fresh):
    monkeypatch.setattr(device_benchmark, "in_a_child", child_of())
    benchmark_of(gpu, "field")
    (file,) = fresh.iterdir()
    text = file.read_text()
    for number in ("-1.02", "NaN", "0.0"):
        file.write_text(text.replace("1.02", number))
        assert stored_benchmark(gpu, "field") is None


def test_failed_trials_are_counted_and_repeated_on_request(gpu, monkeypatch, fresh):
    monkeypatch.setattr(device_benchmark, "in_a_child", child_of("wrong"))
    for attempts in (1, 2):
        assert benchmark_engine(gpu, "field").attempts == attempts
    assert benchmark_of(gpu, "field") == stored_benchmark(gpu, "field") == DeviceBenchmark((), "wrong", 3)
    monkeypatch.setattr(device_benchmark, "in_a_child", child_of())
    assert benchmark_of(gpu, "field") == DeviceBenchmark(SLOW_START)


@pytest.mark.opencl
@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("engine", ENGINES)
def test_the_child_process_times_engines(opencl_session, engine):
    (answer,), ending = device_benchmark.in_a_child(opencl_session.device, engine, 300.0)
    assert ending == "ended with exit code 0" or ending.startswith("ended with exit code 0 (")
    assert (answer["engine"], answer["fault"]) == (engine, "")
    (small, large) = (Timing(*times) for times in answer["timings"])
    assert small.size < large.size
    assert min(*small, *large) > 0.0
