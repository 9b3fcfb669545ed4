"""The adjoint: gradients against finite differences, dot products of both directions, blocks of time."""

from functools import partial

import llvmlite.binding as llvm
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.waveform import misfits
from bentray_kernels.tomography.waveform.misfits import correlation
from bentray_kernels.wave import adjoint
from bentray_kernels.wave import time_blocks as cut
from bentray_kernels.wave.adjoint import misfit_gradient
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import forward, place_elements, simulate
from bentray_kernels.wave.vector_width import use_widest_vectors

from . import emissions_scan
from .emissions_scan import change, slope

SPACING, STEP, STEPS, SHAPE = 1e-3, 2e-7, 180, (40, 42)
EMITTER = np.array([0.0123, 0.0201])
RECEIVERS = np.array([[0.0301, 0.0311], [0.0202, 0.0352], [0.031, 0.012]])
TIME = np.arange(STEPS) * STEP
WAVELET = np.exp(-(((TIME - 6e-6) * 2e5) ** 2)) * np.sin(2.0 * np.pi * 2e5 * (TIME - 6e-6))


def medium(speed, dtype=np.float64, loss=None):
    return Medium.from_speed(speed, SPACING, STEP, attenuation=loss, edge_nodes=8, dtype=dtype)


def speeds(seed=0, shape=SHAPE):
    return 1500.0 + 40.0 * np.random.default_rng(seed).standard_normal(shape)


def windows():
    arrival = np.linalg.norm(RECEIVERS - EMITTER, axis=1) / 1500.0 + 6e-6
    return misfits.arrival_window(arrival, TIME, 6e-6, 8e-6)


def host_of(by, speed, loss, way):
    """The medium after a change of its speed or attenuation by a factor."""
    if by == "attenuation":
        return lambda factor: medium(speed, loss=loss + factor * way)
    # The loss is held as a rate in time, so that the loss over distance changes with the speed.
    return lambda factor: medium(
        speed + factor * way, loss=None if loss is None else loss * speed / (speed + factor * way)
    )


@pytest.mark.parametrize("measure", [misfits.correlation, misfits.least_squares])
@pytest.mark.parametrize(
    ("by", "windowed", "lossy"),
    [("speed", False, False), ("speed", True, False), ("speed", True, True), ("attenuation", True, True)],
)
def test_gradient_of_every_misfit_is_that_of_finite_differences(measure, by, windowed, lossy):
    weight = windows() if windowed else np.ones((3, 1))
    recorded = simulate(medium(speeds(1)), EMITTER, RECEIVERS, WAVELET)
    way, loss = change(2, SHAPE), 20.0 + 5.0 * speeds(3) / 1500.0 if lossy else None
    host = host_of(by, speeds(0), loss, way)

    def misfit(traces):
        return measure(traces, recorded, weight)

    def value(factor):
        return misfit(simulate(host(factor), EMITTER, RECEIVERS, WAVELET))[0]

    shot = misfit_gradient(host(0.0), EMITTER, RECEIVERS, WAVELET, misfit, by=by)
    small = 3e-2 if by == "speed" else 0.1
    assert (shot.gradient * way).sum() == pytest.approx(slope(value, small), rel=1e-6)
    assert shot.misfit == value(0.0) > 0.0


def test_source_to_traces_and_back_are_transposes():
    rng = np.random.default_rng(6)
    host = medium(speeds(5))
    source, detectors = place_elements(host, EMITTER[None]), place_elements(host, RECEIVERS)
    wavelet, residual = rng.standard_normal(STEPS), rng.standard_normal((3, STEPS))
    traces, _ = forward(host, source, detectors, wavelet, 0)
    # Read at the emitter, the adjoint field is the transpose of the whole run.
    turned = np.zeros(STEPS)
    for r in range(3):
        receiver = place_elements(host, RECEIVERS[r : r + 1])
        turned += forward(host, receiver, source, residual[r, ::-1].copy(), 0)[0][0][::-1]
    assert (traces * residual).sum() == pytest.approx(wavelet @ turned, rel=1e-10)


@pytest.mark.parametrize(("by", "small"), [("speed", 0.1), ("attenuation", 0.5)])
def test_born_modelling_and_the_gradient_are_transposes(by, small):
    residual, way = np.random.default_rng(8).standard_normal((3, STEPS)), change(9, SHAPE)
    host = host_of(by, speeds(7), np.full(SHAPE, 12.0), way)

    def correlated(traces):
        return float((traces * residual).sum()), residual

    gradients = misfit_gradient(host(0.0), EMITTER, RECEIVERS, WAVELET, correlated, by=by)
    born = slope(lambda factor: simulate(host(factor), EMITTER, RECEIVERS, WAVELET), small)
    assert (born * residual).sum() == pytest.approx((gradients.gradient * way).sum(), rel=1e-7)


@pytest.mark.parametrize("by", ["speed", "attenuation"])
def test_fewer_stored_fields_and_single_precision_change_the_gradient_little(by):
    recorded = simulate(medium(speeds(1)), EMITTER, RECEIVERS, WAVELET)

    def misfit(traces):
        return misfits.least_squares(traces, recorded, np.ones((3, 1)))

    smooth = np.full(SHAPE, 1500.0)
    exact = misfit_gradient(medium(smooth), EMITTER, RECEIVERS, WAVELET, misfit, 1, by).gradient
    cheap = misfit_gradient(medium(smooth, np.float32), EMITTER, RECEIVERS, WAVELET, misfit, 4, by).gradient
    assert np.sqrt(((cheap - exact) ** 2).sum() / (exact**2).sum()) < 2e-2


def test_rejects_a_zero_step():
    with pytest.raises(InvalidInput, match="every"):
        misfit_gradient(medium(speeds(0)), EMITTER, RECEIVERS, WAVELET, lambda traces: (0.0, traces), 0)


class Unheard(Exception):
    """Exception that a poll raises."""


@given(steps=st.integers(0, 5000), nodes=st.integers(1, 10**9))
def test_every_step_is_in_exactly_one_block(steps, nodes):
    polled = []
    listed = list(cut.split_steps(steps, nodes, lambda: polled.append(None)))
    assert [n for first, end in listed for n in range(first, end)] == list(range(steps))
    assert all((end - first) % 2 == 0 for first, end in listed[:-1])
    assert all((end - first - 2) * nodes <= cut.BLOCK for first, end in listed)
    assert len(polled) == len(listed)


@pytest.mark.parametrize("by", ["speed", "attenuation"])
def test_time_blocks_give_the_bits_of_one_run(monkeypatch, by):
    recorded = simulate(medium(speeds(1)), EMITTER, RECEIVERS, WAVELET)
    compare = partial(correlation, recorded=recorded, weight=np.ones((3, 1)))
    whole = misfit_gradient(medium(speeds()), EMITTER, RECEIVERS, WAVELET, compare, 3, by)
    monkeypatch.setattr(cut, "BLOCK", 4 * medium(speeds()).keep.size)
    parts = misfit_gradient(medium(speeds()), EMITTER, RECEIVERS, WAVELET, compare, 3, by)
    assert parts.misfit == whole.misfit
    np.testing.assert_array_equal(parts.gradient, whole.gradient)
    np.testing.assert_array_equal(parts.illumination, whole.illumination)
    again = simulate(medium(speeds(1)), EMITTER, RECEIVERS, WAVELET)
    np.testing.assert_array_equal(again, recorded)


@pytest.mark.parametrize("most", [3, STEPS // 4 + 3])
def test_poll_error_stops_both_directions(monkeypatch, most):
    monkeypatch.setattr(cut, "BLOCK", 4 * medium(speeds()).keep.size)
    polled = []

    def poll():
        polled.append(None)
        if len(polled) == most:
            raise Unheard

    def compare(traces):
        return 0.0, traces

    with pytest.raises(Unheard):
        misfit_gradient(medium(speeds()), EMITTER, RECEIVERS, WAVELET, compare, poll=poll)
    assert len(polled) == most


def test_loops_take_512_bits_where_the_processor_has_them():
    if not llvm.get_host_cpu_features().get("avx512f"):
        pytest.skip("the processor has no vectors of 512 bits")

    @njit
    def add(into, other):
        use_widest_vectors()
        for k in range(into.shape[0]):
            into[k] += other[k]

    numbers = np.arange(3, dtype=np.float32)
    add(numbers, np.ones_like(numbers))
    assert numbers.tolist() == [1.0, 2.0, 3.0]
    assert "zmm" in next(iter(add.inspect_asm().values()))


def test_a_gradient_does_not_depend_on_the_one_before_it():
    def gradient(emitter, misfit):
        # Each emitter has its own cone: where it stores nothing, the fields of the other one are left.
        until = np.full(len(emissions_scan.RECEIVERS), 120)
        gradients = adjoint.misfit_gradient(
            emissions_scan.medium(),
            emitter,
            emissions_scan.RECEIVERS,
            emissions_scan.WAVELET,
            misfit,
            4,
            until=until,
        )
        return gradients.gradient.tobytes(), gradients.illumination.tobytes()

    def energy(traces):
        return float((traces**2).sum()), traces

    def nested(traces):
        gradient(emissions_scan.EMITTERS[1], energy)
        return energy(traces)

    adjoint._kept.fields = None
    fresh = gradient(emissions_scan.EMITTERS[0], energy)
    gradient(emissions_scan.EMITTERS[1], energy)
    kept = adjoint._kept.fields
    assert gradient(emissions_scan.EMITTERS[0], energy) == fresh
    assert adjoint._kept.fields is kept
    assert gradient(emissions_scan.EMITTERS[0], nested) == fresh
