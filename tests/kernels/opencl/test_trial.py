"""The trial of a device: what it times, which engine it prefers for a size, and its cache."""

from dataclasses import replace

import pytest

from bentray_kernels.opencl import trial
from bentray_kernels.opencl.trial import ENGINES, Timing, Trial, examine, stored_trial, trial_of

# The device needs 1 s to start and a fifth of the time for each unit.
SLOW_START = (Timing(10.0, 0.1, 1.02), Timing(1000.0, 10.0, 3.0))


def child_of(bad=()):
    """A child process of a device that ends it at the engines in ``bad``."""
    calls = []

    def child(device, engines, time_out_s):
        calls.append(tuple(engines))
        answers = []
        for engine in engines:
            if engine in bad:
                return answers, "ended by signal 6"
            answers.append({"engine": engine, "fault": "", "timings": [list(one) for one in SLOW_START]})
        return answers, "ended with exit code 0"

    child.calls = calls
    return child


@pytest.mark.parametrize(("size", "faster"), [(1.0, False), (100.0, False), (126.0, True), (1e6, True)])
def test_the_faster_engine_depends_on_the_size(size, faster):
    assert Trial({"field": SLOW_START}, {}).faster("field", size) is faster


def test_an_engine_that_was_not_tried_or_is_wrong_is_not_preferred():
    assert not Trial({}, {}).faster("field", 1e9)
    assert not Trial({"field": SLOW_START}, {"field": "wrong"}).faster("field", 1e9)


def test_times_never_become_negative_or_shrink_with_the_size():
    noisy = (Timing(10.0, 1.0, 0.5), Timing(100.0, 0.4, 0.6))
    assert Trial({"field": noisy}, {}).faster("field", 1.0)
    assert not Trial({"field": noisy}, {}).faster("field", 1e6)


def test_an_engine_that_ends_the_process_costs_only_itself(gpu):
    child = child_of({"wave"})
    found = examine(gpu, child)
    assert found.faults == {"wave": "ended by signal 6"}
    assert set(found.timings) == set(ENGINES) - {"wave"}
    assert child.calls == [ENGINES, ENGINES[2:]]


def test_wrong_results_are_a_fault(gpu):
    def child(device, engines, time_out_s):
        return [{"engine": name, "fault": "differs by 0.1", "timings": []} for name in engines], ""

    assert examine(gpu, child) == Trial({}, dict.fromkeys(ENGINES, "differs by 0.1"))


def test_a_trial_is_remembered_until_the_driver_or_the_sources_change(gpu, monkeypatch, fresh):
    child = child_of()
    monkeypatch.setattr(trial, "in_a_child", child)
    first = trial_of(gpu)
    trial_of.cache_clear()
    assert trial_of(gpu) == first == stored_trial(gpu)
    assert len(child.calls) == 1
    trial_of(replace(gpu, driver="1.2.4"))
    assert len(child.calls) == 2
    monkeypatch.setattr(trial, "digest", lambda module: "of another version")
    trial_of.cache_clear()
    trial_of(gpu)
    assert len(child.calls) == 3


@pytest.mark.parametrize(
    "content",
    ["", "[]", "{}", '{"timings": {}, "faults": {}}', '{"timings": 1, "faults": 1}', "\x00\xff", "null"],
)
def test_a_damaged_cache_is_ignored_and_rebuilt(gpu, monkeypatch, fresh, content):
    monkeypatch.setattr(trial, "in_a_child", child_of())
    whole = trial_of(gpu)
    (file,) = fresh.iterdir()
    file.write_text(content, encoding="latin-1")
    assert stored_trial(gpu) is None
    trial_of.cache_clear()
    assert trial_of(gpu) == whole == stored_trial(gpu)


def test_times_that_no_clock_gives_are_ignored(gpu, monkeypatch, fresh):
    monkeypatch.setattr(trial, "in_a_child", child_of())
    trial_of(gpu)
    (file,) = fresh.iterdir()
    text = file.read_text()
    for number in ("-1.02", "NaN", "0.0"):
        file.write_text(text.replace("1.02", number))
        assert stored_trial(gpu) is None


def test_a_faulty_trial_is_not_remembered_on_disk(gpu, monkeypatch, fresh):
    monkeypatch.setattr(trial, "in_a_child", child_of({"field"}))
    assert trial_of(gpu).faults == {"field": "ended by signal 6"}
    assert not fresh.exists()


@pytest.mark.opencl
@pytest.mark.slow
@pytest.mark.parametrize("engines", [("eikonal", "field"), pytest.param(ENGINES, marks=pytest.mark.nightly)])
def test_the_child_process_times_engines(opencl_session, engines):
    answers, ending = trial.in_a_child(opencl_session.device, engines, 500.0)
    assert ending == "ended with exit code 0" or ending.startswith("ended with exit code 0 (")
    assert [(one["engine"], one["fault"]) for one in answers] == [(name, "") for name in engines]
    for one in answers:
        (small, large) = (Timing(*times) for times in one["timings"])
        assert small.size < large.size
        assert min(*small, *large) > 0.0
