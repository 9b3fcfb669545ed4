"""Delay and sum against a plain reference, a point in water, any split of the emissions, on a device."""

import numpy as np
import pytest

from bentray_kernels.opencl import OpenCLFallbackWarning
from bentray_kernels.tomography.reflection import delay_and_sum_opencl
from bentray_kernels.tomography.reflection.delay_and_sum import Pixels, Signals, Sums, sum_echoes
from bentray_kernels.tomography.reflection.delay_and_sum_opencl import sum_echoes_opencl
from bentray_kernels.tomography.reflection.echoes import analytic
from bentray_kernels.tomography.reflection.element_times import solve_times
from bentray_kernels.tomography.reflection.with_reflection import envelope_of

from .point_echoes import RATE_HZ, T0, WATER, ring, traces

SPACING, NODES, FACTOR = 2e-3, 37, 2
# Of the pixels, in the coordinates of the ring; the point is on one.
FIRST, STEP, COUNT = np.array([-0.004, -0.012]), 5e-4, (37, 35)
POINT = FIRST + STEP * np.array([17, 18])
EVERYONE = np.arange(24)


def made(points=(POINT,)):
    """Signals, times and pixels of a ring in water."""
    elements = ring()
    corner = -0.5 * SPACING * (NODES - 1)
    times = solve_times(np.full((NODES, NODES), WATER), SPACING, elements - corner)
    recorded = traces(elements, points)
    parts = analytic(recorded.reshape(-1, recorded.shape[-1]), FACTOR).reshape(*recorded.shape[:2], 2, -1)
    parts[..., 0] = parts[..., -1] = 0.0
    used = ~np.eye(len(elements), dtype=bool)
    signals = Signals(parts, used, T0, FACTOR * RATE_HZ)
    inside = np.ones(COUNT, dtype=bool)
    inside[:3, :5] = False
    return signals, times, Pixels((FIRST - corner) / SPACING, STEP / SPACING, inside)


def arguments(signals, times, pixels, emissions=EVERYONE, angle=90.0):
    some = Signals(signals.parts[emissions], signals.used[emissions], signals.first_s, signals.rate_hz)
    return some, times, SPACING, EVERYONE[emissions], EVERYONE, pixels, angle


def summed(*given):
    return sum_echoes(*arguments(*given))


def reference(signals, pixels, angle):
    """The equation of ``sum_echoes`` in NumPy, with straight rays in water."""
    elements = ring()
    x, y = (FIRST[k] + STEP * np.arange(COUNT[k]) for k in (0, 1))
    place = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    away = place[None] - elements[:, None, None]
    distance = np.linalg.norm(away, axis=-1)
    direction = away / distance[..., None]
    least = np.cos(np.radians(angle))
    samples = np.arange(signals.parts.shape[-1])
    echo, power, weight = np.zeros(COUNT, complex), np.zeros(COUNT), np.zeros(COUNT)
    for e in range(len(elements)):
        of_emitter = np.zeros(COUNT, complex)
        for r in np.flatnonzero(signals.used[e]):
            cosine = (direction[e] * direction[r]).sum(axis=-1)
            w = np.maximum(0.0, (cosine - least) / (1.0 - least))
            at = ((distance[e] + distance[r]) / WATER - signals.first_s) * signals.rate_hz
            read = [np.interp(at, samples, part) for part in signals.parts[e, r]]
            of_emitter += w * (read[0] + 1j * read[1])
            weight += w
        echo += of_emitter
        power += np.abs(of_emitter) ** 2
    return [np.where(pixels.inside, one, 0.0) for one in (echo, power, weight)]


@pytest.mark.parametrize("angle", [90.0, 180.0, 40.0])
def test_sums_equal_those_of_the_equation(angle):
    signals, times, pixels = made()
    found = summed(signals, times, pixels, EVERYONE, angle)
    for one, expected in zip(found, reference(signals, pixels, angle), strict=True):
        assert np.abs(one - expected).max() < 2e-3 * np.abs(expected).max()


def test_a_point_is_imaged_where_it_is():
    signals, times, pixels = made()
    image = envelope_of(summed(signals, times, pixels), 24)
    assert np.unravel_index(image.argmax(), image.shape) == (17, 18)
    # A mean of coherent echoes of size 1, read by linear interpolation.
    assert 0.9 < image.max() <= 1.001


def test_any_split_of_the_emissions_has_the_same_bits():
    signals, times, pixels = made()
    whole = summed(signals, times, pixels)
    for each in (1, 7):
        parts = [summed(signals, times, pixels, np.arange(k, min(k + each, 24))) for k in range(0, 24, each)]
        total = parts[0]
        for part in parts[1:]:
            total = type(total)(*(a + b for a, b in zip(total, part, strict=True)))
        if each == 1:
            for one, expected in zip(total, whole, strict=True):
                assert np.array_equal(one, expected)
        assert np.allclose(total.echo, whole.echo, atol=1e-4 * np.abs(whole.echo).max())


def test_coherence_factor_is_one_for_equal_echoes_and_small_for_random_ones():
    rng = np.random.default_rng(2)
    phases = np.exp(2j * np.pi * rng.random((64, 40, 40)))
    weight = np.full((40, 40), 64.0)
    equal = Sums(np.full((40, 40), 64.0 + 0j), np.full((40, 40), 64.0), weight)
    random = Sums(phases.sum(axis=0), (np.abs(phases) ** 2).sum(axis=0), weight)
    assert np.allclose(envelope_of(equal, 64), 1.0)
    factor = envelope_of(random, 64) / (np.abs(random.echo) / weight)
    assert factor.mean() == pytest.approx(1.0 / 64.0, rel=0.1)


def assert_equal(found, expected, part=1e-4):
    for one, other in zip(found, expected, strict=True):
        assert one.dtype == other.dtype
        assert np.abs(one - other).max() <= part * np.abs(other).max()


@pytest.mark.opencl
@pytest.mark.parametrize("angle", [90.0, 40.0])
def test_sums_are_those_of_compiled_code(angle):
    scan = made()
    given = arguments(*scan, angle=angle)
    found, expected = sum_echoes_opencl(*given), sum_echoes(*given)
    assert_equal(found, expected)
    outside = ~scan[2].inside
    assert not any(one[outside].any() for one in found)
    for one, again in zip(found, sum_echoes_opencl(*given), strict=True):
        np.testing.assert_array_equal(one, again)


@pytest.mark.opencl
def test_parts_of_pixels_and_of_emissions_have_the_same_bits(monkeypatch):
    scan = made()
    whole = sum_echoes_opencl(*arguments(*scan))
    monkeypatch.setattr(delay_and_sum_opencl, "PIXELS", 128)
    for one, other in zip(sum_echoes_opencl(*arguments(*scan)), whole, strict=True):
        np.testing.assert_array_equal(one, other)
    some = np.array([3, 11, 20])
    assert_equal(sum_echoes_opencl(*arguments(*scan, some)), sum_echoes(*arguments(*scan, some)))


def test_compiled_code_computes_without_a_device(monkeypatch):
    monkeypatch.setenv("BENTRAY_OPENCL_DEVICE", "none")
    given = arguments(*made())
    monkeypatch.setattr(delay_and_sum_opencl, "session_or_warning", lambda instead: None)
    for one, other in zip(sum_echoes_opencl(*given), sum_echoes(*given), strict=True):
        np.testing.assert_array_equal(one, other)
    assert issubclass(OpenCLFallbackWarning, UserWarning)
