"""Leaving out nodes that do not matter changes neither the traces that count nor the gradient."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform.misfits import arrival_window, correlation
from bentray_kernels.wave.adjoint import misfit_gradient
from bentray_kernels.wave.light_cone import BLOCK_STEPS, TILE, everywhere, light_cone
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import place_scan, simulate
from bentray_kernels.wave.stencil import HALO, OPTIMISED, longest_step

SPACING, NODES = 1e-3, 110
STEP = 0.95 * longest_step(1650.0, SPACING, order=OPTIMISED)
TIME = np.arange(400) * STEP
LATE = (TIME - 9e-6) * 2.5e5
WAVELET = np.exp(-((0.9 * LATE) ** 2)) * np.sin(2.0 * np.pi * LATE)
ANGLE = 2.0 * np.pi * np.arange(24) / 24
RING = 0.5 * (NODES - 1) * SPACING + 0.045 * np.column_stack((np.cos(ANGLE), np.sin(ANGLE)))


def medium(seed=0, loss=None, dtype=np.float64):
    """Rough tissue between 1400 and 1600 m/s."""
    rough = np.random.default_rng(seed).standard_normal((NODES // 10, NODES // 10))
    speed = np.clip(1500.0 + 60.0 * np.kron(rough, np.ones((10, 10))), 1400.0, 1600.0)
    return Medium.from_speed(speed, SPACING, STEP, attenuation=loss, dtype=dtype, order=OPTIMISED)


def shot(emitter):
    """(receivers, window, samples that count) of an emitter."""
    receivers = np.delete(RING, emitter, axis=0)
    arrival = np.linalg.norm(receivers - RING[emitter], axis=1) / 1500.0 + 9e-6
    window = arrival_window(arrival, TIME, 2e-5, 2e-5)
    return receivers, window, window.shape[1] - (window[:, ::-1] > 0.0).argmax(axis=1)


def off(computed, expected):
    return np.linalg.norm(computed - expected) / np.linalg.norm(expected)


@pytest.mark.parametrize("by", ["speed", "attenuation"])
@pytest.mark.parametrize("emitter", [0, 3, 5])
def test_traces_and_gradients_are_those_of_all_nodes(by, emitter):
    receivers, window, until = shot(emitter)
    host = medium(emitter, loss=np.full((NODES, NODES), 3.0) if by == "attenuation" else None)
    recorded = simulate(medium(7), RING[emitter], receivers, WAVELET)

    def misfit(traces):
        return correlation(traces, recorded, window)

    arguments = (host, RING[emitter], receivers, WAVELET, misfit, 3, by)
    whole, part = misfit_gradient(*arguments), misfit_gradient(*arguments, until=until)
    assert part.misfit == pytest.approx(whole.misfit, rel=1e-6)
    inner = (slice(6, -6), slice(6, -6))
    assert off(part.gradient[inner], whole.gradient[inner]) < 1e-5
    assert off(part.illumination[inner], whole.illumination[inner]) < 0.03
    traces = [simulate(host, RING[emitter], receivers, WAVELET, until=some) for some in (None, until)]
    assert off(window * traces[1], window * traces[0]) < 1e-5
    assert not traces[1][np.arange(TIME.size) >= until[:, None]].any()
    assert traces[0][np.arange(TIME.size) >= until[:, None]].any()


def test_half_of_the_nodes_is_left_out():
    receivers, _, until = shot(0)
    host = medium()
    spans = light_cone(host, *place_scan(host, RING[0], receivers, WAVELET), until)
    updated = TILE * (spans[:, :, 1] - spans[:, :, 0]).sum() * BLOCK_STEPS
    assert updated < 0.65 * TIME.size * (host.keep.size)


@settings(max_examples=30, deadline=None)
@given(
    st.tuples(st.integers(12, 70), st.integers(12, 70)),
    st.lists(st.integers(0, 300), min_size=1, max_size=5),
    st.integers(0, 99),
)
def test_spans_lie_within_the_grid(shape, until, seed):
    rng = np.random.default_rng(seed)
    host = Medium.from_speed(np.full(shape, 1500.0), SPACING, STEP, edge_nodes=8, order=OPTIMISED)
    points = rng.uniform(0.0, 1.0, (len(until) + 1, 2)) * (np.array(shape) - 1) * SPACING
    source, detectors = place_scan(host, points[0], points[1:], WAVELET)
    spans = light_cone(host, source, detectors, np.array(until))
    assert len(spans) == max(1, -(-max(until) // BLOCK_STEPS))
    assert spans.shape[1:] == everywhere(host).shape[1:]
    assert (spans[..., 0] >= HALO).all()
    assert (spans[..., 1] <= host.keep.shape[1] - HALO).all()
    assert (spans[..., 0] <= spans[..., 1]).all()


def test_where_no_sample_counts_nothing_is_simulated():
    receivers, _, _ = shot(0)
    assert not simulate(medium(), RING[0], receivers, WAVELET, until=np.zeros(len(receivers), int)).any()
