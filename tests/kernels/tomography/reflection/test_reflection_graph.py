"""Reflection image of a small scan: pulse, muting, order of tasks, restart, result, on a device."""

import random
from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl.lost_device import DeviceLostError
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.reflection import reflection_graph, reflection_plan
from bentray_kernels.tomography.reflection.echoes import (
    Pulse,
    echo_window,
    high_pass,
    measure_pulse,
    without_water_shot,
)
from bentray_kernels.tomography.reflection.element_times import solve_times, times_between
from bentray_kernels.tomography.reflection.reflection_graph import ReflectionGraph, echo_signals
from bentray_kernels.tomography.reflection.reflection_plan import plan_reflection
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.solver_choice import echo_engine, needs_device

from ..graph_runs import run_in_random_order
from .point_echoes import CENTRE_HZ, RADIUS, RATE_HZ, T0, WATER, pulse, ring, traces

# An eighth of a wavelength.
PIXEL = 3.75e-4
POINT, DELAY = np.array([0.006, -0.0045]), 1.3e-6
SETTINGS = Settings.from_values(method="sart", nodes=24, iterations=1, reflection=True, pixel_m=PIXEL)


def scan(water=True, **changes):
    elements = ring()
    whole = traces(elements, [POINT], delay_s=DELAY, transmitted=30.0)
    alone = traces(elements, [], delay_s=DELAY, transmitted=30.0)
    fields = {
        "element_position_m": elements,
        "tx": np.arange(24),
        "rx": np.arange(24),
        "water_speed_mps": WATER,
        "delta_tof_s": np.zeros((24, 24)),
        "waveform": Waveform(whole.astype(np.float32), alone.astype(np.float32) if water else None),
        "center_frequency_hz": CENTRE_HZ,
        "sampling_rate_hz": RATE_HZ,
        "t0_s": T0,
    }
    return Dataset(**{**fields, **changes})


def begun(dataset=None, settings=SETTINGS):
    dataset = dataset or scan()
    corner = -1.1 * RADIUS
    speed = np.full((23, 23), WATER)
    plan = plan_reflection(dataset, settings, speed, -corner / 11.0, (corner, corner))
    return ReflectionGraph((MemorySource(dataset), 0), plan, 400, RATE_HZ)


@pytest.fixture
def small_batches(monkeypatch):
    monkeypatch.setattr(reflection_plan, "TASK_BYTES", 5 * 8 * 24 * 800)


@pytest.mark.usefixtures("small_batches")
def test_tasks_may_finish_in_any_order_and_resume():
    expected = run_in_random_order(begun(), random.Random(1))
    assert (expected.done, expected.total) == (24, 24)
    for seed, stop in ((2, 1), (3, 4), (4, 6)):
        broken = run_in_random_order(begun(), random.Random(seed), stop)
        assert broken.done < broken.total
        again = begun()
        again.restore(broken.checkpoint)
        run_in_random_order(again, random.Random(seed + 10))
        for one, other in zip(again.sums, expected.sums, strict=True):
            assert np.array_equal(one, other)
        assert again.first() == []


@pytest.mark.parametrize("water", [True, False])
def test_delay_of_the_pulse_is_measured_with_and_without_a_water_shot(water):
    graph = run_in_random_order(begun(scan(water)), random.Random(1))
    assert graph.pulse.delay_s == pytest.approx(DELAY, abs=0.3 / RATE_HZ)
    # 0.1 of the maximum of exp(-(0.9 f t)^2).
    assert graph.pulse.length_s == pytest.approx(np.sqrt(np.log(10.0)) / (0.9 * CENTRE_HZ), abs=2.0 / RATE_HZ)


def test_reconstruction_has_an_image_of_the_point_on_its_own_grid():
    result = reconstruct(scan(), SETTINGS)
    image = result.reflection
    assert image.spacing_m == (PIXEL, PIXEL)
    assert image.db.shape != result.speed.shape
    assert (image.db.max(), image.db.min()) == (0.0, -100.0)
    brightest = np.array(image.origin_m) + PIXEL * np.array(
        np.unravel_index(image.db.argmax(), image.db.shape)
    )
    assert np.abs(brightest - POINT).max() <= 0.5 * PIXEL + 1e-9
    assert "delays in the reconstructed speed" in result.provenance["reflection"]
    assert result.settings.reflection.enabled


def from_the_point(image):
    """Distance of each pixel, m."""
    x, y = (image.origin_m[k] + image.spacing_m[k] * np.arange(image.db.shape[k]) for k in (0, 1))
    return np.hypot(x[:, None] - POINT[0], y[None, :] - POINT[1])


def test_transmitted_waves_are_muted():
    # 30 times as strong as the echo, they would outshine it.
    image = reconstruct(scan(), SETTINGS).reflection
    away = from_the_point(image)
    assert image.db[away > 0.008].max() < -8.0


def test_slow_tails_of_transmitted_waves_leave_no_energy_in_the_image():
    # As strong as the echo, longer than the mute, and with equal phase in all traces.
    elements = ring()
    direct = np.linalg.norm(elements[:, None] - elements[None], axis=-1) / WATER + DELAY
    late = np.maximum(T0 + np.arange(400) / RATE_HZ - direct[..., None], 0.0)
    tail = late / 4e-6 * np.exp(1.0 - late / 4e-6)
    whole, alone = scan().waveform.object + tail, scan().waveform.water + tail
    images = [
        reconstruct(scan(waveform=Waveform(whole.astype(np.float32), water)), SETTINGS).reflection
        for water in (alone.astype(np.float32), None)
    ]
    for image in images:
        away = from_the_point(image)
        assert away.flat[image.db.argmax()] <= PIXEL
        # Without the high pass it has -7 dB.
        assert image.db[away > 0.008].max() < -18.0


def with_ringing(arrival_s, samples=400):
    """Transmitted pulses that ring for long at the frequency of the echoes, (24, 24, samples)."""
    late = T0 + np.arange(samples) / RATE_HZ - DELAY - arrival_s[..., None]
    ringing = np.where(late > 0.0, late / 4e-6 * np.exp(1.0 - late / 4e-6), 0.0)
    return 30.0 * pulse(late) + ringing * np.cos(2.0 * np.pi * CENTRE_HZ * late)


@pytest.mark.parametrize("inner", [WATER, 1.2 * WATER, 0.9 * WATER])
def test_ringing_after_the_pulse_is_taken_from_the_water_shot(inner):
    """Also behind a fast object, whose pulses arrive before those in water."""
    elements, corner, nodes = ring(), -1.1 * RADIUS, 41
    line = np.linspace(corner, -corner, nodes)
    speed = np.where(np.hypot(line[:, None], line[None]) < 0.015, inner, WATER)
    spacing = line[1] - line[0]
    direct = np.linalg.norm(elements[:, None] - elements[None], axis=-1) / WATER
    inside = elements - corner
    arrival = times_between(solve_times(speed, spacing, inside), spacing, inside / spacing)
    # As long in both directions, less the error of the solution.
    np.testing.assert_allclose(arrival, arrival.T, atol=0.005 * arrival.max())
    energy = []
    for water in (None, 0.5 * with_ringing(direct)):
        dataset = scan(waveform=Waveform(with_ringing(arrival).astype(np.float32), water))
        plan = plan_reflection(dataset, SETTINGS, speed, spacing, (corner, corner))
        signals = echo_signals(dataset, plan, Pulse(DELAY, 3.4e-6), arrival, np.arange(24))
        energy.append(float((signals.parts**2).sum()))
    assert energy[1] < 0.02 * energy[0]


def test_a_water_shot_that_makes_a_trace_louder_is_not_used():
    random = np.random.default_rng(1)
    times = np.arange(400) / RATE_HZ
    arrival = np.full(2, 30e-6)
    window = np.broadcast_to((times > 38e-6).astype(float), (2, 400))
    pulses = np.stack([pulse(times - 30e-6)] * 2)
    noisy = pulses + 0.1 * random.standard_normal((2, 400))
    # The second would leave a pulse of water behind the mute.
    water = pulses + np.stack([0.1 * random.standard_normal(400), pulse(times - 42e-6)])
    kept = without_water_shot(noisy, water, arrival, window, times, 1.0 / CENTRE_HZ)
    assert np.array_equal(kept, noisy * window)
    # Nor one without a pulse, or of the opposite sign.
    for other in (np.zeros_like(water), -water):
        assert np.array_equal(
            without_water_shot(noisy, other, arrival, window, times, 1.0 / CENTRE_HZ), noisy * window
        )


def test_several_slices_are_stacked():
    one = scan()
    both = np.stack([one.waveform.object, 0.5 * one.waveform.object])
    water = np.stack([one.waveform.water] * 2)
    dataset = scan(
        slice_z_m=np.array([0.0, 2e-3]), delta_tof_s=np.zeros((2, 24, 24)), waveform=Waveform(both, water)
    )
    image = reconstruct(dataset, SETTINGS).reflection
    assert image.db.shape[2] == 2
    assert image.spacing_m[2] == 2e-3
    assert image.db[..., 0].max() == 0.0
    # The transmitted waves are half as strong, too, so that the echo is half of the other one.
    assert image.db[..., 1].max() == pytest.approx(-6.02, abs=0.01)


def test_delays_in_water_move_the_image():
    found = begun(settings=SETTINGS.changed(delays="water"))._plan.speed
    assert (found == WATER).all()


@pytest.mark.parametrize(
    ("changes", "settings", "field"),
    [
        ({"waveform": None}, {}, "reflection"),
        ({"center_frequency_hz": None}, {}, "acquisition@center_frequency_hz"),
        ({}, {"pixel_m": 1e-6}, "pixel_m"),
        ({}, {"pixel_m": 0.5}, "pixel_m"),
    ],
)
def test_what_is_impossible_is_named(changes, settings, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        reconstruct(scan(**changes), SETTINGS.changed(**settings))


def test_volumes_are_rejected():
    with pytest.raises(InvalidInput, match="decomposition"):
        SETTINGS.changed(decomposition="volume")


def test_window_opens_after_the_pulse_and_closes_with_the_record():
    shot = traces(ring(), [], delay_s=DELAY, transmitted=1.0)
    at = T0 + np.arange(400) / RATE_HZ
    expected = np.linalg.norm(ring()[:1] - ring(), axis=1)[None] / WATER
    pulse = measure_pulse([shot[0]], expected, np.ones((1, 24), bool), at)
    window = echo_window(expected[0], pulse, at, 1.0 / CENTRE_HZ)
    assert np.abs(shot[0] * window).max() < 0.1
    assert window[:, -1].max() == 0.0
    assert window[3, np.searchsorted(at, expected[0, 3] + DELAY + 8e-6)] == 1.0


def test_the_window_rises_and_falls_by_raised_cosines_of_a_period():
    at, period = np.arange(41) * 1e-6, 8e-6
    ((*window,),) = echo_window(np.array([3e-6]), Pulse(4e-6, 5e-6), at, period)
    rise = np.sin(np.pi / 16.0 * np.arange(9)) ** 2
    # The pulse of 5 µs is over at 12 µs, the record at 40 µs.
    np.testing.assert_allclose(window, [*np.zeros(12), *rise, *np.ones(11), *rise[::-1]], atol=1e-12)


@pytest.mark.parametrize(("relative", "part"), [(0.25, 0.0), (0.45, 0.5), (0.7, 1.0), (1.0, 1.0)])
def test_the_high_pass_keeps_the_phases_of_what_it_passes(relative, part):
    at = np.arange(1600) / RATE_HZ
    wave = np.sin(2.0 * np.pi * relative * CENTRE_HZ * at) * np.hanning(1600)
    passed = high_pass(wave[None], RATE_HZ, CENTRE_HZ)[0]
    np.testing.assert_allclose(passed, part * wave, atol=0.02)
    later = high_pass(wave[None], RATE_HZ, CENTRE_HZ, np.array([8.0 / RATE_HZ]))[0]
    np.testing.assert_allclose(later[8:], passed[:-8], atol=1e-3)


def test_a_scan_of_zeros_has_no_pulse():
    with pytest.raises(InvalidInput, match="pulse"):
        measure_pulse([np.zeros((2, 50))], np.zeros((1, 2)), np.ones((1, 2), bool), np.arange(50) * 1e-7)


# SART would be on the device too.
ON_PROCESSOR = SETTINGS.changed(method="gauss-newton")
ON_DEVICE = ON_PROCESSOR.changed(device="opencl")


@pytest.mark.opencl
def test_the_image_on_a_device_is_that_of_compiled_code():
    here, there = (reconstruct(scan(), plan) for plan in (ON_PROCESSOR, ON_DEVICE))
    assert here.reflection.db.min() == -100.0
    loud = here.reflection.db > -60.0
    assert np.abs(there.reflection.db - here.reflection.db)[loud].max() < 0.05
    assert there.provenance["reflection"].endswith("; echoes summed on OpenCL devices")
    assert "OpenCL" not in here.provenance["reflection"]
    np.testing.assert_array_equal(reconstruct(scan(), ON_DEVICE).reflection.db, there.reflection.db)


@pytest.mark.opencl
def test_a_device_that_fails_leaves_the_sums_to_compiled_code(monkeypatch):
    calls = []

    def failing(*given):
        calls.append(len(given))
        if len(calls) % 2:
            raise DeviceLostError("broken")
        return reflection_graph.sum_echoes(*given)

    monkeypatch.setattr(reflection_graph, "sum_echoes_opencl", failing)
    result = reconstruct(scan(), ON_DEVICE).reflection.db
    assert len(calls) % 2 == 0
    assert calls
    np.testing.assert_array_equal(result, reconstruct(scan(), ON_PROCESSOR).reflection.db)


def test_only_a_reflection_image_on_opencl_needs_the_device():
    plain = Settings(method="gauss-newton", device="opencl")
    assert (echo_engine(ON_DEVICE), needs_device(ON_DEVICE)) == ("opencl", True)
    for plan_of in (ON_PROCESSOR, ON_DEVICE.changed(device="auto"), ON_DEVICE.changed(device="cpu"), plain):
        assert echo_engine(plan_of) == "compiled"
    assert not needs_device(ON_PROCESSOR)
    assert replace(plain, device="cpu").device == "cpu"
