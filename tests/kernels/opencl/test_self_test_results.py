"""Verdicts on devices that pass, return wrong values, abort or hang; and the cache of verdicts."""

from dataclasses import replace

import pytest

from bentray_kernels.compilation import cache_folder
from bentray_kernels.opencl import records, self_test_results
from bentray_kernels.opencl.self_test import STAGES
from bentray_kernels.opencl.self_test_results import SelfTestResult, examine, in_a_child, self_test_result


def child_of(bad):
    """A child process of a device that is right but for ``bad``: stage to fault, or None to abort there."""
    calls = []

    def child(device, stages, time_out_s):
        calls.append(tuple(stages))
        answers = {}
        for stage in stages:
            if bad.get(stage, "") is None:
                return answers, "ended by signal 6"
            answers[stage] = bad.get(stage, "")
        return answers, "ended with exit code 0"

    child.calls = calls
    return child


def test_a_right_device_is_tried_once(gpu):
    child = child_of({})
    assert examine(gpu, child) == SelfTestResult("", (1, 2, 4, 8, 16), {})
    assert child.calls == [STAGES]


def test_the_faults_of_pocl_cost_only_the_widths(gpu):
    """PoCL 3.0-rc2: double8 aborts and double16 is silently wrong; our kernels use neither."""
    child = child_of({"double8": None, "double16": "wrong fmin"})
    answer = examine(gpu, child)
    assert answer.usable
    assert answer.widths == (1, 2, 4)
    assert answer.faults == {"double8": "ended by signal 6", "double16": "wrong fmin"}
    assert child.calls == [STAGES, ("double16",)]


@pytest.mark.parametrize("stage", ["double1", "solve"])
@pytest.mark.parametrize(("fault", "said"), [(None, "ended by signal 6"), ("wrong sqrt", "wrong sqrt")])
def test_fault_in_a_required_feature_rejects_the_device(gpu, stage, fault, said):
    child = child_of({stage: fault, "double4": None})
    answer = examine(gpu, child)
    assert not answer.usable
    assert answer.reason == f"{stage}: {said}"
    assert len(child.calls) <= 2, "what cannot be used is not tried any further"


def test_an_answer_of_a_child_to_another_question_is_ignored(gpu):
    def child(device, stages, time_out_s):
        return {"double32": ""}, "ended with exit code 0"

    answer = examine(gpu, child)
    assert answer.reason == "double1: ended with exit code 0"


def test_a_hanging_child_is_stopped(gpu):
    answers, ending = in_a_child(gpu, STAGES, 0.01)
    assert answers == {}
    assert ending == "no answer in 0.01 s"


def test_a_failing_child_reports_the_reason(gpu):
    answers, ending = in_a_child(gpu, STAGES, 60.0)
    assert answers == {}
    assert ending.startswith("ended with exit code 1 (Fast Platform:GPU 9000 is no longer")


def test_compiler_error_is_reported_as_the_reason(gpu, monkeypatch, tmp_path):
    package = tmp_path / "refusing"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "self_test.py").write_text(
        "raise SystemExit(\"error: unknown target CPU 'generic'\\nDevice failed\\n(options: -DREAL)\")"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(self_test_results, "__package__", "refusing")
    answers, ending = in_a_child(gpu, STAGES, 60.0)
    assert answers == {}
    assert ending == "ended with exit code 1 (error: unknown target CPU 'generic')"


def test_an_aborting_child_is_survived(gpu, monkeypatch, tmp_path):
    package = tmp_path / "aborting"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "self_test.py").write_text(
        'import os\nprint(\'{"stage": "double1", "fault": ""}\', flush=True)\nprint(\'remark\')\nos.abort()\n'
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(self_test_results, "__package__", "aborting")
    answers, ending = in_a_child(gpu, STAGES, 60.0)
    assert answers == {"double1": ""}
    assert ending.startswith("ended by signal 6")


def test_device_without_double_precision_is_not_tested(gpu, monkeypatch, fresh):
    monkeypatch.setattr(self_test_results, "in_a_child", None)
    answer = self_test_result(replace(gpu, double_precision=False))
    assert answer.reason == "it has no double precision"
    assert answer.widths == ()


def test_a_pass_is_remembered_on_disk_until_the_driver_or_the_processor_changes(gpu, monkeypatch, fresh):
    child = child_of({"double8": None})
    monkeypatch.setattr(self_test_results, "in_a_child", child)
    first = self_test_result(gpu)
    tried = len(child.calls)
    self_test_result.cache_clear()
    assert self_test_result(gpu) == first
    assert len(child.calls) == tried
    self_test_result(replace(gpu, driver="1.2.4"))
    assert len(child.calls) == 2 * tried
    monkeypatch.setattr(records, "processor", lambda: frozenset({"model name: another", "avx2"}))
    self_test_result.cache_clear()
    self_test_result(gpu)
    assert len(child.calls) == 3 * tried


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"widths": 3, "faults": {}}', '{"widths": [1], "faults": 1}']
)
def test_damaged_cache_does_not_pass_a_device(gpu, monkeypatch, fresh, content):
    monkeypatch.setattr(self_test_results, "in_a_child", child_of({}))
    self_test_result(gpu)
    (file,) = fresh.iterdir()
    file.write_text(content)
    self_test_result.cache_clear()
    monkeypatch.setattr(self_test_results, "in_a_child", child_of({"solve": "wrong travel times in 2-D"}))
    assert not self_test_result(gpu).usable


def test_a_refusal_is_not_remembered_on_disk(gpu, monkeypatch, fresh):
    monkeypatch.setattr(self_test_results, "in_a_child", child_of({"solve": None}))
    assert not self_test_result(gpu).usable
    assert not list(fresh.iterdir())


def test_verdict_holds_without_a_cache_folder(gpu, monkeypatch, fresh):
    fresh.write_text("a file where the folder should be")
    monkeypatch.setattr(self_test_results, "in_a_child", child_of({}))
    monkeypatch.setattr(cache_folder, "_temporary_folder", lambda: None)
    with pytest.warns(cache_folder.CacheFolderWarning):
        assert self_test_result(gpu).usable
