"""Waves in space: against the Green function, orders, edges, loss, reciprocity, mirrored objects, memory."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave.adjoint import misfit_gradient
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.memory import emission_bytes
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import OPTIMISED, longest_step, symbol

from .test_simulation import WATER, pulse

SPACING = 1e-3
STEP = 2.7e-7


def green(across, time, wavelet, grid=None):
    """The wavelet delayed by its way and divided by 4 pi times it.

    Args:
        across: from emitter to receiver, (3,), m.
        grid: order in space of the grid at whose speed waves shall run this way; 0: of its time steps alone;
            None: at that of water.
    """
    way, step = float(np.linalg.norm(across)), time[1]
    number = 2.0 * np.pi * np.fft.rfftfreq(4 * time.size, step) / WATER
    if grid is not None:
        along = np.minimum(number, np.pi / SPACING)[:, None] * SPACING * across / way
        square = (symbol(along, grid) if grid else along**2).sum(axis=1)
        courant = WATER * step / SPACING
        turned = 2.0 / courant * np.arcsin(np.minimum(0.5 * courant * np.sqrt(square), 1.0))
        number[1:] *= number[1:] * SPACING / turned[1:]
    late = np.fft.rfft(wavelet, 4 * time.size) * np.exp(-1j * number * way)
    return np.fft.irfft(late, 4 * time.size)[: time.size] / (4.0 * np.pi * way)


def water(shape, step=STEP, edge_nodes=16, loss=0.0, order=8):
    loss = np.full(shape, loss)
    return Medium.from_speed(
        np.full(shape, WATER), SPACING, step, attenuation=loss, edge_nodes=edge_nodes, order=order
    )


def off(computed, expected):
    """Relative rms error."""
    return np.linalg.norm(computed - expected) / np.linalg.norm(expected)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=6, deadline=None)
def test_traces_are_those_of_the_green_function(seed):
    """Waves of 5.4 nodes and more between elements between nodes, at the speed that the grid has."""
    nodes = np.array([24, 18, 18])
    points = np.random.default_rng(seed).uniform(4.0, nodes - 5.0, (2, 3)) * SPACING
    across = points[1] - points[0]
    assume(np.linalg.norm(across) > 5.0 * SPACING)
    time = np.arange(130) * STEP
    traces = simulate(water(nodes, edge_nodes=20), points[0], points[1:], pulse(time, 1.8e5))[0]
    assert off(traces, green(across, time, pulse(time, 1.8e5), 8)) < 0.015


@pytest.mark.parametrize(("order", "other"), [(8, 6), (6, 8), (OPTIMISED, 6)])
def test_the_order_in_space_is_the_requested_one(order, other):
    """Waves of 3.5 nodes and more: their speed is that of the stencil, which a test of its own holds."""
    source, receiver = np.array([6e-3, 12e-3, 12e-3]), np.array([30e-3, 12e-3, 12e-3])
    time = np.arange(148) * STEP
    wavelet = pulse(time, 2.8e5)
    traces = simulate(water((37, 25, 25), edge_nodes=20, order=order), source, receiver[None], wavelet)[0]
    assert off(traces, green(receiver - source, time, wavelet, order)) < 0.009
    assert off(traces, green(receiver - source, time, wavelet, other)) > 0.05


def test_error_falls_as_the_square_of_the_time_step():
    source, receiver = np.array([4e-3, 5e-3, 5e-3]), np.array([11e-3, 7e-3, 8e-3])
    traces = []
    for finer in (1, 2, 4):
        time = STEP / finer * np.arange(110 * finer)
        result = simulate(water((16, 13, 13), STEP / finer), source, receiver[None], pulse(time, 1.8e5))
        traces.append(result[0, ::finer])
    ratio = np.linalg.norm(traces[0] - traces[1]) / np.linalg.norm(traces[1] - traces[2])
    assert np.log2(ratio) == pytest.approx(2.0, abs=0.2)


def test_energy_leaves_through_the_edges():
    time = np.arange(400) * STEP
    trace = simulate(
        water((16, 16, 16)), np.full(3, 7e-3), np.array([[3e-3, 11e-3, 9e-3]]), pulse(time, 2e5)
    )[0]
    assert (trace[-200:] ** 2).sum() < 1e-5 * (trace**2).sum()


def test_loss_is_the_given_one():
    time = np.arange(120) * STEP
    source, receivers = np.array([4e-3, 9e-3, 9e-3]), np.array([[9e-3, 9e-3, 9e-3], [19e-3, 9e-3, 9e-3]])
    without, damped = (
        np.linalg.norm(
            simulate(water((24, 19, 19), loss=loss), source, receivers, pulse(time, 1.8e5)), axis=1
        )
        for loss in (0.0, 20.0)
    )
    assert np.log(without / damped) == pytest.approx(20.0 * (receivers - source)[:, 0], rel=0.02)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_symmetric_media_give_symmetric_traces(axis):
    speed = np.full((14, 14, 14), WATER)
    speed[4:10, 4:9, 4:8] = 1400.0
    speed = np.minimum(speed, np.flip(speed, axis))
    medium = Medium.from_speed(speed, SPACING, STEP, edge_nodes=10)
    time = np.arange(110) * STEP
    middle = np.array([3.2, 4.1, 9.4])
    middle[axis] = 6.5
    sides = np.tile([10.3, 8.8, 3.1], (2, 1))
    sides[1, axis] = 13.0 - sides[0, axis]
    heard = simulate(medium, middle * SPACING, sides * SPACING, pulse(time, 1.8e5))
    assert off(heard[1], heard[0]) < 1e-5
    in_water = simulate(
        water((14, 14, 14), edge_nodes=10), middle * SPACING, sides * SPACING, pulse(time, 1.8e5)
    )
    assert off(heard, in_water) > 0.05


def test_memory_is_known_before_and_refused_beyond_the_room():
    speed, loss = np.full((30, 24, 20), WATER), np.full((30, 24, 20), 3.0)
    planned = emission_bytes(speed.shape, 16)
    tracemalloc.start()
    medium = Medium.from_speed(speed, SPACING, STEP, attenuation=loss, edge_nodes=16, memory_bytes=planned)
    simulate(medium, np.full(3, 8e-3), np.full((1, 3), 9e-3), pulse(np.arange(130) * STEP, 1.8e5))
    _, taken = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 0.7 * planned < taken < planned
    with pytest.raises(InvalidInput, match=str(planned)):
        Medium.from_speed(speed, SPACING, STEP, edge_nodes=16, memory_bytes=planned - 1)


def test_rejects_unsupported_3d_settings():
    medium, time = water((14, 14, 14), edge_nodes=8), np.arange(130) * STEP
    wavelet, at = pulse(time, 1.8e5), np.full((1, 3), 5e-3)
    for wrong in (
        lambda: misfit_gradient(medium, at[0], at, wavelet, lambda traces: (0.0, traces)),
        lambda: simulate(medium, at[0], at[:, :2], wavelet),
        lambda: simulate(medium, at[0], at + 9e-3, wavelet),
        lambda: water((14, 14, 14), 1.01 * longest_step(WATER, SPACING, dimensions=3)),
    ):
        with pytest.raises(InvalidInput):
            wrong()
