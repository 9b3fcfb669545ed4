"""SART of slices on an OpenCL device: the images of compiled code, the same bits however the work is cut."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import Session, device_selection
from bentray_kernels.phantoms import TABLE6_SIDE_M
from bentray_kernels.tomography import Problem, Settings, reconstruct
from bentray_kernels.tomography.grid_schedule import initial_slowness
from bentray_kernels.tomography.sart.device_slices import SliceSize, ring_bytes, slices_in_flight
from bentray_kernels.tomography.sart.sart_slices import SliceCall, advance_slices
from bentray_kernels.tomography.sart.sart_step import begin
from bentray_kernels.tomography.stage_graphs import update_sart_slices

from ....table6 import table6_scan

pytestmark = pytest.mark.opencl

NODES, ELEMENTS, WATER = 48, 24, 1375.0

# In the images of three iterations, m/s: rms of the difference from compiled code, and the largest one. A ray
# whose neighbours pass on different sides of a lesion may take the other side because of rounding.
RMS_MPS, LARGEST_MPS = 0.05, 2.0


@pytest.fixture(scope="module")
def rings():
    """A scan of three slices with gaps in the data, and an emitter without any."""
    scan = table6_scan(ELEMENTS, NODES)
    delta = np.stack([part * scan.delta_tof_s for part in (1.0, 0.5, 1.1)])
    delta[np.random.default_rng(0).random(delta.shape) < 0.1] = np.nan
    delta[1, 3] = np.nan
    return [replace(scan, delta_tof_s=times) for times in delta]


def plan(**changes):
    values = {"nodes": NODES, "side_m": TABLE6_SIDE_M, "method": "sart", "iterations": 3, "device": "opencl"}
    return Settings.from_values(**{**values, **changes})


def advanced(rings, settings, emitters=10**6):
    """The final states of all slices, updated together."""
    problems = [Problem.from_dataset(dataset, settings) for dataset in rings]
    states = [begin(initial_slowness(problem, None)) for problem in problems]
    while not all(state.done for state in states):
        calls = [SliceCall(*pair, emitters, k) for k, pair in enumerate(zip(problems, states, strict=True))]
        states = advance_slices(calls, settings)
    return states


@pytest.mark.parametrize("changes", [{}, {"rays": "straight"}, {"subset": 5, "smoothing_nodes": 0.0}])
def test_the_images_are_those_of_compiled_code(opencl_session, rings, changes):
    computed, expected = (advanced(rings, plan(**changes, device=device)) for device in ("opencl", "cpu"))
    for first, other in zip(computed, expected, strict=True):
        difference = 1.0 / first.slowness - 1.0 / other.slowness
        assert np.ptp(1.0 / other.slowness) > 30.0
        assert np.sqrt((difference**2).mean()) < RMS_MPS
        assert np.abs(difference).max() < LARGEST_MPS
        assert np.abs(first.coverage - other.coverage).max() < 0.05 * other.coverage.max()
        assert first.residuals.sum() == other.residuals.sum() > 0
        assert np.abs(first.residuals - other.residuals).sum() <= 0.02 * other.residuals.sum()
        for iteration, theirs in zip(first.history, other.history, strict=True):
            assert iteration.residual_rms_s == pytest.approx(theirs.residual_rms_s, rel=1e-3)
            assert iteration.emitters == theirs.emitters


def test_a_slice_has_the_same_bits_alone_and_in_parts(opencl_session, rings):
    settings = plan(iterations=2)
    together, again = advanced(rings, settings), advanced(rings, settings, emitters=7)
    alone = advanced(rings[:1], settings)
    for state, other in [*zip(together, again, strict=True), (together[0], alone[0])]:
        assert np.array_equal(state.slowness, other.slowness)
        assert np.array_equal(state.coverage, other.coverage)
        assert np.array_equal(state.residuals, other.residuals)
        assert state.history == other.history


def test_tiles_of_slices_change_no_bit(opencl_session, rings, monkeypatch):
    settings = plan(iterations=1)
    together = advanced(rings, settings)
    from bentray_kernels.tomography.sart import device_slices

    monkeypatch.setattr(device_slices, "PROCESSOR_SLICES", 2)
    for image, other in zip(together, advanced(rings, settings), strict=True):
        assert np.array_equal(image.slowness, other.slowness)


def test_what_a_device_cannot_hold_is_refused_by_number(opencl_session, monkeypatch):
    size = SliceSize((256, 256), 512, 512, 1, 1)
    monkeypatch.setattr(
        opencl_session, "device", replace(opencl_session.device, kind="gpu", memory_bytes=40 * size.bytes)
    )
    assert slices_in_flight(opencl_session, size) == 20
    small = replace(opencl_session.device, memory_bytes=size.bytes)
    monkeypatch.setattr(opencl_session, "device", small)
    with pytest.raises(
        InvalidInput, match=f"a slice takes {size.bytes} bytes.*at most {size.bytes // 2} bytes"
    ):
        slices_in_flight(opencl_session, size)
    monkeypatch.setattr(opencl_session, "device", replace(small, memory_bytes=0, buffer_bytes=0))
    wide = 10**6
    assert ring_bytes(wide) > opencl_session.handle.local_mem_size
    with pytest.raises(InvalidInput, match="local memory"):
        slices_in_flight(opencl_session, SliceSize((wide, wide), 1, 1, 1, 1))


def test_a_lost_device_is_replaced_by_the_processor(fresh_choice, rings, caplog):
    """With a queue of another context from the tenth launch on, so with a real error of the driver."""
    import pyopencl as cl

    session, launch, launches = fresh_choice, fresh_choice.launch, []

    def failing(*arguments):
        launches.append(arguments)
        if len(launches) == 10:
            session.queue = cl.CommandQueue(cl.Context([session.handle]))
        launch(*arguments)

    session.launch = failing
    settings = plan(iterations=1)
    result = reconstruct(rings[0], settings)
    assert session.lost
    assert session.lost in caplog.text
    assert np.array_equal(result.speed, reconstruct(rings[0], settings.changed(device="cpu")).speed)


@pytest.fixture
def fresh_choice(opencl_session, monkeypatch):
    """The device, opened for this test alone."""
    session = Session(opencl_session.device)
    monkeypatch.setattr(device_selection, "_found", lambda *_: session)
    return session


def test_calls_of_several_scans_are_told_apart(opencl_session, rings):
    settings = plan(iterations=1)

    class Scan:
        def __init__(self, index):
            self.index = index

        def stages(self):
            return (settings,)

        def problems(self, indices, stage=-1):
            return tuple(Problem.from_dataset(rings[self.index], settings) for _ in indices)

    start = begin(initial_slowness(Problem.from_dataset(rings[0], settings), None))
    calls = [(scan, 0, 0, start, 100) for scan in (Scan(0), Scan(1))]
    for (state, seconds), expected in zip(update_sart_slices(calls), (rings[:1], rings[1:2]), strict=True):
        assert np.array_equal(state.slowness, advanced(expected, settings)[0].slowness)
        assert seconds > 0.0
