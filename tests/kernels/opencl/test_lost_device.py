"""A device that fails in the middle: real errors of the driver, one line in the log, the CPU once."""

import logging

import numpy as np
import pytest

from bentray_kernels import eikonal
from bentray_kernels.opencl import DeviceLostError, Session, Work, device_selection, select_engine
from bentray_kernels.opencl.lost_device import computed, computing_on, cpu_only, on_cpu

pytestmark = pytest.mark.opencl

SPEED = 1500.0 + np.zeros((20, 20))


@pytest.fixture
def lost(fresh, opencl_session, monkeypatch):
    """The device, opened for this test alone, with a queue of another context in the middle of its work."""
    import pyopencl as cl

    session = Session(opencl_session.device)
    monkeypatch.setattr(device_selection, "_found", lambda *_: session)
    launch = session.launch
    launches = []

    def failing(*arguments):
        launches.append(arguments)
        if len(launches) == 2:
            session.queue = cl.CommandQueue(cl.Context([session.handle]))
        launch(*arguments)

    monkeypatch.setattr(session, "launch", failing)
    return session


def solve():
    return eikonal.solve(SPEED, 1e-3, (0.0, 0.0), "fim-opencl")


def test_an_error_in_the_middle_is_a_lost_device_with_a_line_in_the_log(lost, caplog):
    with caplog.at_level(logging.WARNING), pytest.raises(DeviceLostError, match=" failed: "):
        solve()
    assert [record.getMessage() for record in caplog.records] == [lost.lost]
    assert lost.device.label in lost.lost
    with pytest.raises(DeviceLostError, match=" failed: "):
        solve()
    assert len(caplog.records) == 1, "it is not tried again"


def test_the_cpu_computes_it_again_once(lost):
    runs = []

    def work():
        runs.append(cpu_only())
        return solve()

    result, why = computed(work)
    assert runs == [False, True]
    assert why == lost.lost != ""
    np.testing.assert_array_equal(result, eikonal.solve(SPEED, 1e-3, (0.0, 0.0), "fim"))


def test_errors_of_the_work_itself_are_not_those_of_the_device(lost):
    with pytest.raises(ZeroDivisionError):
        computed(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError), computing_on(lost):
        raise ZeroDivisionError
    assert lost.lost == ""


def test_too_little_memory_does_not_lose_the_device(lost):
    import pyopencl as cl

    for code, gone in (("MEM_OBJECT_ALLOCATION_FAILURE", False), ("OUT_OF_RESOURCES", True)):
        with pytest.raises(DeviceLostError, match=code), computing_on(lost):
            raise cl.MemoryError(f"clEnqueueNDRangeKernel failed: {code}")
        assert bool(lost.lost) is gone


def test_a_thread_returns_to_the_device_after_an_error_on_the_cpu(lost):
    with pytest.raises(ZeroDivisionError):
        on_cpu(lambda: 1 // 0)
    assert not cpu_only()
    assert select_engine(Work("eikonal", 1.0), "cpu") is None
