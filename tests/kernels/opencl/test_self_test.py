"""The self-test finds the faults of a wrong device and none of a right one."""

import json

import numpy as np
import pytest

from bentray_kernels import eikonal
from bentray_kernels.opencl import select_device, self_test


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
