"""The self-test finds faults of wrong devices and none of right ones; verdicts and their cache."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels import eikonal
from bentray_kernels.compilation import cache_folder
from bentray_kernels.opencl import records, select_device, self_test, self_test_results
from bentray_kernels.opencl.self_test import STAGES
from bentray_kernels.opencl.self_test_results import SelfTestResult, examine, in_a_child, self_test_result


@pytest.mark.parametrize("shape", [(9, 8), (5, 4, 6), (1, 12)])
def test_the_reference_is_first_order_marching(shape):
    crossing = np.random.default_rng(3).uniform(0.2, 5.0, shape)
    source = tuple(n // 2 for n in shape)
    tof = eikonal.solve(1.0 / crossing, 1.0, source, "fmm", order=1)
    assert np.allclose(self_test.reference(crossing, source), tof, rtol=1e-11)


@pytest.mark.parametrize("stage", [*self_test.NEEDED, "double2", "double4"])
def test_a_right_device_has_no_fault(session, stage):
    assert self_test.fault_of(session, stage) == ""


def test_the_wrong_root_of_one_lane_is_found(session, monkeypatch):
    def wrong(session, width, a, b):
        root = np.sqrt(a)
        root[3] *= 1.0 + 1e-12
        return root, np.minimum(a, b)

    monkeypatch.setattr(self_test, "probe", wrong)
    assert self_test.fault_of(session, "double16") == "wrong sqrt"


@pytest.mark.parametrize("lane", [1, 40, 255])
def test_the_wrong_minimum_of_one_lane_is_found(session, monkeypatch, lane):
    def wrong(session, width, a, b):
        lower = np.minimum(a, b)
        lower[lane] = np.maximum(a, b)[lane]
        return np.sqrt(a), lower

    monkeypatch.setattr(self_test, "probe", wrong)
    assert self_test.fault_of(session, "double8") == "wrong fmin"


@pytest.mark.parametrize(("ndim", "bad"), [(2, 1e-8), (3, np.nan)])
def test_wrong_times_are_found(session, monkeypatch, ndim, bad):
    def wrong(session, crossings, seeds):
        result = np.stack([self_test.reference(c, (4,) * c.ndim) for c in crossings])
        if result[0].ndim == ndim:
            result[-1].flat[-1] += bad
        return result

    monkeypatch.setattr(self_test, "travel_times", wrong)
    assert self_test.fault_of(session, "solve") == f"wrong travel times in {ndim}-D"


@pytest.mark.opencl
def test_the_program_answers_one_line_a_stage(capsys):
    device = select_device().device
    self_test.main([str(device.index), device.label, "double1", "solve"])
    answers = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert answers == [{"stage": "double1", "fault": ""}, {"stage": "solve", "fault": ""}]


def test_another_device_of_that_index_is_not_tried():
    for index in (0, 99):
        with pytest.raises(SystemExit, match=f"Fast Platform:GPU 9000 is no longer OpenCL device {index}"):
            self_test.main([str(index), "Fast Platform:GPU 9000", "double1"])


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


@pytest.mark.parametrize(
    ("program", "answers", "ending"),
    [
        (
            "raise SystemExit(\"error: unknown target CPU 'generic'\\nDevice failed\\n(options: -DREAL)\")",
            {},
            "ended with exit code 1 (error: unknown target CPU 'generic')",
        ),
        (
            'import os\nprint("""{"stage": "double1", "fault": ""}""", flush=True)\nprint("-")\nos.abort()',
            {"double1": ""},
            "ended by signal 6",
        ),
    ],
    ids=["the compiler's error", "aborts"],
)
def test_a_child_that_ends_early_is_survived_and_says_why(
    gpu, monkeypatch, tmp_path, program, answers, ending
):
    package = tmp_path / "child"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "self_test.py").write_text(program)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(self_test_results, "__package__", "child")
    answered, ended = in_a_child(gpu, STAGES, 60.0)
    assert answered == answers
    assert ended.startswith(ending)


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
